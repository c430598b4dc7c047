"""The outline refined: runs are added between places whose verdict or limit differs, until it is known as exactly as asked."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from orchestrator.studies.sweep.boxes import Place, divided
from orchestrator.studies.sweep.design import Row, bare
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.ranges import cell
from orchestrator.studies.sweep.study import Refine, Study


def kind_of(refine: Refine, outcomes: Sequence[Outcome]) -> Hashable | None:
    """Return what differs beyond an outline; None where nothing is known: what failed has no outline."""
    worst = cell(outcomes)
    if worst.verdict == "none":
        return None
    return worst.verdict if refine.outline == "verdict" else (worst.verdict, worst.binding)


def more_rows(study: Study, outcomes: Sequence[Outcome]) -> list[Row]:
    """Return the runs that have to be added to `outcomes`; none where the outline is known as exactly as asked."""
    refine = study.refine
    if refine is None:
        return []
    found, number, group = list[Row](), len(outcomes), 1 + max(o.row.group for o in outcomes)
    for others, mine in _lines(study, outcomes).items():
        grid = [[float(bare(value)) for value in study.values[key]] for key in refine.widths]
        known = {place: kind_of(refine, some) for place, some in mine.items()}
        for place in divided(grid, known, list(refine.widths.values()))[1]:
            n = len(found)
            found.append(Row(number + n + 1, _varied(study, others, place), {}, group + n, 0))
    return found


def _lines(study: Study, outcomes: Sequence[Outcome]) -> dict[tuple[Any, ...], dict[Place, list[Outcome]]]:
    """Return the outcomes by their place among the keys that are refined, for each combination of the others."""
    assert study.refine is not None
    others = [key for key in study.values if key not in study.refine.widths]
    found: dict[tuple[Any, ...], dict[Place, list[Outcome]]] = {}
    for outcome in outcomes:
        inputs = outcome.row.inputs
        line = found.setdefault(tuple(inputs[key] for key in others), {})
        line.setdefault(tuple(float(inputs[key]) for key in study.refine.widths), []).append(outcome)
    return found


def _varied(study: Study, others: Sequence[Any], place: Place) -> Mapping[str, Any]:
    """Return the values of a run, as the study has them."""
    assert study.refine is not None
    at, rest = dict(zip(study.refine.widths, place, strict=True)), iter(others)
    return {key: _like(values, at[key] if key in at else next(rest)) for key, values in study.values.items()}


def _like(values: Sequence[Any], number: Any) -> Any:
    """Return a value as those of the study are: the same one, or a number in their unit."""
    for value in values:
        if bare(value) == number:
            return value
    return {**values[0], "value": number} if isinstance(values[0], Mapping) else number
