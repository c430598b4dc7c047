"""Where a sweep is safe: the worst of all runs at each value, and stretches of values in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.studies.sweep.design import bare
from orchestrator.studies.sweep.outcome import WORST_FIRST, Outcome, Standing
from orchestrator.studies.sweep.study import Study


@dataclass(frozen=True)
class Cell:
    """What is known of a combination of values: the worst of all runs there.

    Attributes
    ----------
    margin : least of all limits, as a share of the limit; NaN where nothing is known
    safe : whether all runs are; None where one failed or was not judged, and none is known to be unsafe
    binding : the limit with the least margin
    verdict : the worst of all runs
    """

    margin: float
    safe: bool | None
    binding: str
    verdict: Standing


def cell(outcomes: Sequence[Outcome]) -> Cell:
    """Return the worst of all runs at a place."""
    known = [outcome for outcome in outcomes if outcome.margins]
    worst = min(known, key=lambda outcome: outcome.margins[outcome.binding], default=None)
    verdicts = [outcome.safe for outcome in outcomes]
    safe = False if False in verdicts else None if None in verdicts or not verdicts else True
    found: list[Standing] = [outcome.verdict for outcome in outcomes]
    verdict: Standing = min(found, key=WORST_FIRST.index) if found else "none"
    if worst is None:
        return Cell(np.nan, safe, "", verdict)
    return Cell(worst.margins[worst.binding], safe, worst.binding, verdict)


def line(study: Study, outcomes: Sequence[Outcome], x: str) -> list[Cell]:
    """Return the worst at each value of `x`."""
    return [cell([o for o in outcomes if o.row.varied[x] == value]) for value in values_of(study, x, outcomes)]


def values_of(study: Study, key: str, outcomes: Sequence[Outcome] = ()) -> list[Any]:
    """Return the values of a key that varies, with those of `outcomes` besides; `InputError` where it does not."""
    known = study.values
    if key not in known:
        there = ", ".join(known) or "nothing"
        raise InputError(f"{study.path}: {key} does not vary{nearest(key, known)}; there varies {there}")
    more = (outcome.row.varied[key] for outcome in outcomes) if study.refine is not None else ()
    return [*known[key], *{bare(v): v for v in more if v not in known[key]}.values()]


def safe_ranges(study: Study, outcomes: Sequence[Outcome], x: str) -> str:
    """Return where it is safe along `x`, in words; between its values nothing is known."""
    cells, numbers = line(study, outcomes, x), [bare(v) for v in values_of(study, x, outcomes)]
    return f"{x}: safe {stretches_in_words(numbers, [one.safe is True for one in cells], unit_of(study, x))}"


def stretches_in_words(values: Sequence[Any], good: Sequence[bool], unit: str) -> str:
    """Return where among `values` it is good: ``from 35 to 265 m (11 values)``, ``with fptlir``, ``nowhere``."""
    if not all(is_number(value) for value in values):
        return f"with {', '.join(str(v) for v, one in zip(values, good, strict=True) if one) or 'none'}"
    order = np.argsort(values)
    at = [values[i] for i in order]
    parts = [_words(at[first], at[last], unit) for first, last in stretches([good[i] for i in order])]
    return f"{', '.join(parts) or 'nowhere'} ({len(at)} values)"


def all_ranges(study: Study, outcomes: Sequence[Outcome]) -> list[str]:
    """Return where it is safe along the first key that varies, a line for each combination of the others."""
    keys = [key for key, values in study.values.items() if len(values) > 1]
    if not keys or not any(outcome.limits for outcome in outcomes):
        return []
    found = list[str]()
    for chosen in product(*(study.values[key] for key in keys[1:])):
        others = dict(zip(keys[1:], chosen, strict=True))
        mine = [o for o in outcomes if all(o.row.varied[key] == value for key, value in others.items())]
        where = ", ".join(f"{key} {bare(value)}" for key, value in others.items())
        found.append(safe_ranges(study, mine, keys[0]) + (f"; {where}" if where else ""))
    return found


def _words(low: float, high: float, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    return f"at {low:g}{unit}" if low == high else f"from {low:g} to {high:g}{unit}"


def stretches(safe: Sequence[bool]) -> list[tuple[int, int]]:
    """Return first and last index of each unbroken stretch of true."""
    edges = np.flatnonzero(np.diff([0, *map(int, safe), 0]))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]


def unit_of(study: Study, key: str) -> str:
    """Return the unit in which a key's values stand; SI where they are bare, as far as that is known."""
    value = study.values[key][0]
    if isinstance(value, dict):
        return str(value.get("unit", ""))
    return UNITS.get(key, "")


UNITS = {"landing.position": "m", "landing.height": "m", "landing.velocity": "m/s", "robot.parameters.mass": "kg"}
"""Of bare values of the keys that are varied most."""


def is_number(value: Any) -> bool:
    """Whether a value can be put on an axis."""
    return isinstance(value, int | float) and not isinstance(value, bool)
