"""The loaded FMUs of a system, a master for them, and the signals worth keeping."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import InputError, RunError, nearest
from orchestrator.coupling.exchange import only_couples
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.sub_steps import check_steps
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS, Master
from orchestrator.landing.contract import is_unused
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.types import Scenario


@contextmanager
def opened(system: System | Scenario) -> Iterator[Graph]:
    """Give the graph of loaded FMUs; `InputError` if it cannot be made. A scenario is resolved first."""
    if isinstance(system, Scenario):
        system = resolve(system)
    scenario = system.scenario
    try:
        graph = system.graph()
        check_steps(graph.components, scenario.simulation.macro_step)
    except (ModuleError, ValueError) as error:
        raise InputError(f"{scenario.path}: {line}" for line in str(error).splitlines()) from None
    except FmuError as error:
        raise RunError(str(error), error.time) from None
    try:
        yield graph
    finally:
        graph.close()


def master_of(scenario: Scenario, graph: Graph) -> Master:
    """Return the scenario's master for `graph`; `InputError` if it cannot couple these FMUs."""
    known = recorded(graph, scenario)
    missing = [name for name in scenario.simulation.tolerances if name not in known]
    if missing:
        raise InputError(
            f"{scenario.path}: simulation.tolerances.{n}: no such signal{nearest(n, known)}" for n in missing
        )
    try:
        return MASTERS[scenario.simulation.master](graph, **scenario.master)
    except (ValueError, TypeError) as error:
        raise InputError(f"{scenario.path}: {error}") from None


def recorded(graph: Graph, scenario: Scenario) -> list[str]:
    """Return the signals to keep: those that are asked for, else those worth it.

    These are all outputs, without unused ports and what only serves the coupling, and the inputs over time.

    Raises
    ------
    InputError : there is no such signal, or it is no number
    """
    wanted = scenario.simulation.record
    if wanted is not None:
        _require_known(wanted, graph, scenario)
        return list(dict.fromkeys(wanted))
    contacts = sum(name.startswith("contact") for name in graph.components)
    outputs = [
        f"{component}.{name}"
        for component, fmu in graph.components.items()
        for name, port in fmu.ports.items()
        if port.causality == "output" and port.is_number and not is_idle(name, contacts)
    ]
    return [*outputs, *graph.courses]


def _require_known(wanted: Iterable[str], graph: Graph, scenario: Scenario) -> None:
    ports = {f"{component}.{name}": p for component, fmu in graph.components.items() for name, p in fmu.ports.items()}
    unknown = [f"no such signal{nearest(name, ports)}" if name not in ports else "" for name in wanted]
    texts = [
        f"is a {ports[name].kind}, no number" if name in ports and not ports[name].is_number else "" for name in wanted
    ]
    wrong = {name: one or other for name, one, other in zip(wanted, unknown, texts, strict=True) if one or other}
    if wrong:
        raise InputError(f"{scenario.path}: simulation.record: {name}: {why}" for name, why in wrong.items())


def is_idle(name: str, contacts: int) -> bool:
    """Whether an output is that of an unused port, or a mean or rate that only serves the coupling."""
    return only_couples(name) or is_unused(name, contacts)
