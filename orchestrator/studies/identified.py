"""What identifications of a study have found, as `orchestrator identify --save` has left it in its folder ``identified``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import read_json
from orchestrator.studies.markdown import filled, number, table

FOLDER = "identified"


@dataclass(frozen=True)
class Identification:
    """One result: its `name`, and what ``identification.json`` says."""

    name: str
    content: Mapping[str, Any]

    @property
    def used(self) -> dict[str, Mapping[str, Any]]:
        """The claims that were fitted, by id."""
        return {one["id"]: one for one in self.content["used"]}

    @property
    def predicted(self) -> dict[str, Mapping[str, Any]]:
        """The claims that were foretold, by id."""
        return {one["id"]: one for one in self.content["predicted"]}

    def ours(self, claim: str) -> Sequence[float] | None:
        """Return what the parameters found give of a claim; None where it was neither fitted nor foretold."""
        found = self.used.get(claim) or self.predicted.get(claim)
        return None if found is None else list(found["ours"])


def load(folder: Path) -> list[Identification]:
    """Return the identifications in the folder of a study, by name; `InputError` for a file that is none."""
    found = [Identification(path.stem, read_json(path)) for path in sorted((folder / FOLDER).glob("*.json"))]
    for one in found:
        if not {"used", "predicted", "parameters"} <= set(one.content):
            raise InputError(
                f"{folder / FOLDER / one.name}.json: is no result of an identification; make it by `orchestrator identify "
                f"{one.name} --save`, or remove it"
            )
    return found


def is_used(found: Sequence[Identification], claim: str) -> bool:
    """Return whether any of the identifications was fitted to a claim."""
    return any(claim in one.used for one in found)


# -- the section of the page ----------------------------------------------------------------------------------


def section(found: Sequence[Identification]) -> str:
    """Return the section of the page; empty where nothing was identified."""
    if not found:
        return ""
    parts = [
        "# What the paper leaves open, identified",
        filled(
            "Parameters that the paper does not give, by least squares of some claims (*fitted*); the others are *foretold*. "
            "The uncertainty of a claim is what it may differ by to be met. `orchestrator identify NAME` does it."
        ),
        *(_one(one) for one in found),
        "## Fitted and foretold",
        _claims(found),
    ]
    return "\n\n".join(parts)


def _one(one: Identification) -> str:
    content = one.content
    rows = (_parameter(parameter) for parameter in content["parameters"])
    head = ("parameter", "unit", "found", "deviation", "interval", "bounds", "")
    doubts = [f"- {line}." for line in content["doubts"]]
    counts = f"{_met(content['used'])} of the claims fitted are met, {_met(content['predicted'])} of those foretold."
    correlated = list(_correlated(content))
    words = f"Correlated by more than 0.9: {', '.join(correlated)}." if correlated else ""
    parts = [
        f"## {content['title']}",
        filled(counts),
        table(head, rows),
        filled(words),
        "\n".join(map(_indented, doubts)),
    ]
    return "\n\n".join(part for part in parts if part)


def _indented(line: str) -> str:
    return filled(line, "  ")


def _met(outcomes: Sequence[Mapping[str, Any]]) -> str:
    return f"{sum(bool(one['met']) for one in outcomes)} of {len(outcomes)}"


def _parameter(one: Mapping[str, Any]) -> tuple[str, ...]:
    interval = "" if one["interval"] is None else f"{one['interval'][0]:.3g} to {one['interval'][1]:.3g}"
    deviation = "open" if one["standard_deviation"] is None else f"{one['standard_deviation']:.2g}"
    said = "not determined" if not one["determined"] else f"at its {one['at_bound']} bound" if one["at_bound"] else ""
    bounds = f"{one['from']:g} to {one['to']:g}"
    return f"`{one['name']}`", one["unit"] or "1", f"{one['value']:.4g}", deviation, interval, bounds, said


def _correlated(content: Mapping[str, Any]) -> Iterator[str]:
    names = [one["name"] for one in content["parameters"]]
    for i, row in enumerate(content["correlation"]):
        for j, value in enumerate(row[:i]):
            if value is not None and abs(value) > 0.9:
                yield f"`{names[j]}` and `{names[i]}` ({value:.2f})"


def _claims(found: Sequence[Identification]) -> str:
    ids = dict.fromkeys(name for one in found for name in (*one.used, *one.predicted))
    paper = {name: (one.used.get(name) or one.predicted.get(name)) for one in found for name in ids if one.ours(name)}
    rows = (
        (name, (paper[name] or {})["unit"], number((paper[name] or {})["data"]), *(_cell(one, name) for one in found))
        for name in ids
    )
    return table(("claim", "unit", "paper", *(one.name for one in found)), rows)


def _cell(one: Identification, claim: str) -> str:
    outcome = one.used.get(claim) or one.predicted.get(claim)
    if outcome is None:
        return "–"
    use = "fitted" if claim in one.used else "foretold"
    return f"{number(outcome['ours'], 3)} ({use}, {'met' if outcome['met'] else 'not met'})"
