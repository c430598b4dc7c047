"""What is to be said of FMUs of others: where they depart from the standard, and what of them is executed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from orchestrator.coupling.fmu.description import departures
from orchestrator.coupling.graph.graph import Graph


def departing(graph: Graph, names: Iterable[str]) -> Iterator[str]:
    """Yield where the descriptions of the components `names` depart from the standard, a line an FMU."""
    found = {graph.components[name].path: name for name in reversed([*names]) if name in graph.components}
    for path, name in reversed(found.items()):
        problems = departures(path)
        if problems:
            version = graph.components[name].description.fmiVersion
            first, more = problems[0], f", and {len(problems) - 1} more" if len(problems) > 1 else ""
            yield f"{name}: its description departs from FMI {version}: {first}{more}"


def executed(graph: Graph) -> str:
    """Return a line on what of the FMUs has been executed where nothing is run."""
    files = dict.fromkeys(fmu.path.name for fmu in graph.components.values())
    return f"executed of the FMUs: loaded, instantiated, no step: {', '.join(files)}"
