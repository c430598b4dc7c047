"""The maps of a sweep as data: axes, and of each place margin, limit, verdict, probability and runs (``map.json``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

from orchestrator.studies.sweep.boxes import Edges, Side, areas, divided, middle
from orchestrator.studies.sweep.design import bare, groups
from orchestrator.studies.sweep.outcome import ALL, Chances, Outcome
from orchestrator.studies.sweep.ranges import Cell, cell, is_number, unit_of, values_of
from orchestrator.studies.sweep.refine import kind_of
from orchestrator.studies.sweep.solve import Swept
from orchestrator.studies.sweep.study import Study

FORMAT = 1
STORE = "runs"
"""Folder of the runs in that of the sweep."""
Values = tuple[Any, ...]
LABELS = {
    "landing.position": "Landing position",
    "landing.height": "Height of the drop",
    "landing.velocity": "Speed at touch-down",
    "robot": "Robot",
    "robot.parameters.mass": "Mass of the robot",
    "scenario": "Scenario",
    "cable.conductor": "Conductor",
    "cable.parameters.mass_damping": "Damping of the line",
    "contact.parameters.friction_coefficient": "Coefficient of friction",
}
"""Of axes; other keys stand for themselves."""


@dataclass(frozen=True)
class Axis:
    """A key that varies, as an axis.

    Attributes
    ----------
    values : in rising order where they are numbers, else in that of the study
    is_refined : whether values were added where the outline is; the map then ends at its first and last value
    """

    key: str
    unit: str
    values: Sequence[Any]
    is_refined: bool = False

    @property
    def label(self) -> str:
        """What a person calls it."""
        return LABELS.get(self.key, self.key)

    @property
    def title(self) -> str:
        """The label, with the unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    @property
    def has_numbers(self) -> bool:
        """Whether values are places on a scale, two at least; if not, they stand side by side."""
        return len(self.values) > 1 and all(is_number(value) for value in self.values)

    def at(self, value: Any) -> float:
        """Return where a value stands on the axis: itself, or its number from 0."""
        return float(value) if self.has_numbers else float(self.values.index(value))

    def side(self, value: Any) -> Side:
        """Return from where to where a value stands for the axis: half of the way to its neighbours."""
        if not self.has_numbers:
            return self.at(value) - 0.5, self.at(value) + 0.5
        i, end = self.values.index(value), len(self.values) - 1
        low = self.values[i - 1] if i > 0 else value if self.is_refined else 2.0 * value - self.values[1]
        high = self.values[i + 1] if i < end else value if self.is_refined else 2.0 * value - self.values[-2]
        return middle(low, value), middle(value, high)

    @property
    def range(self) -> Side:
        """From where to where it reaches."""
        return self.side(self.values[0])[0], self.side(self.values[-1])[1]

    def content(self) -> dict[str, Any]:
        """Return what ``map.json`` says of it."""
        return {
            "key": self.key,
            "label": self.label,
            "unit": self.unit,
            "numeric": self.has_numbers,
            "values": list(self.values),
            "range": list(self.range),
        }


@dataclass(frozen=True)
class Spot:
    """A place of a map.

    Attributes
    ----------
    at : its values
    areas : the parts of the map that it stands for, a side an axis
    outcomes : of the runs there
    """

    at: Values
    areas: list[Edges]
    outcomes: Sequence[Outcome]

    @property
    def cell(self) -> Cell:
        """The worst of all runs there."""
        return cell(self.outcomes)


def shown(study: Study, outcomes: Sequence[Outcome], keys: Sequence[str]) -> tuple[Study, Sequence[Outcome]]:
    """Return what a map over `keys` can show: where others vary, too, without runs that were added on one line alone."""
    if study.refine is None or set(varying(study)) <= set(keys):
        return study, outcomes
    grid = len(groups(study))
    return study.model_copy(update={"refine": None}), [o for o in outcomes if o.row.number <= grid]


def axis_of(study: Study, outcomes: Sequence[Outcome], key: str) -> Axis:
    """Return the axis of a key; `InputError` where it does not vary."""
    values = [bare(value) for value in values_of(study, key, outcomes)]
    found = Axis(key, unit_of(study, key), values, key in study.refine.widths if study.refine is not None else False)
    return replace(found, values=sorted(values)) if found.has_numbers else found


def spots(study: Study, outcomes: Sequence[Outcome], axes: Sequence[Axis]) -> list[Spot]:
    """Return the places of a map over one axis or more, in the order of their runs; without axes the only one."""
    at: dict[Values, list[Outcome]] = {}
    for outcome in outcomes:
        at.setdefault(tuple(outcome.row.inputs[axis.key] for axis in axes), []).append(outcome)
    parts = _areas(study, at, axes)
    return [Spot(place, parts.get(place, []), mine) for place, mine in at.items()]


def _areas(study: Study, at: Mapping[Values, Sequence[Outcome]], axes: Sequence[Axis]) -> dict[Values, list[Edges]]:
    """Return what of the map each place stands for.

    Where the outline was refined a place stands for its part of the boxes that were divided, on each line by itself.
    """
    refine = study.refine
    if refine is None:
        return {place: [[axis.side(v) for axis, v in zip(axes, place, strict=True)]] for place in at}
    inner = [i for i, axis in enumerate(axes) if axis.key in refine.widths]
    lines: dict[Values, list[Values]] = {}
    for place in at:
        lines.setdefault(tuple(v for i, v in enumerate(place) if i not in inner), []).append(place)
    found: dict[Values, list[Edges]] = {}
    for places in lines.values():
        mine = {tuple(place[i] for i in inner): place for place in places}
        known = {short: kind_of(refine, at[place]) for short, place in mine.items()}
        grid = [[bare(value) for value in study.values[axes[i].key]] for i in inner]
        parts = areas(divided(grid, known, [refine.widths[axes[i].key] for i in inner])[0])
        for short, place in mine.items():
            found[place] = [_sides(axes, place, dict(zip(inner, part, strict=True))) for part in parts.get(short, [])]
    return found


def _sides(axes: Sequence[Axis], place: Values, known: Mapping[int, Side]) -> Edges:
    return [known.get(i, axis.side(v)) for i, (axis, v) in enumerate(zip(axes, place, strict=True))]


# -- what is written --------------------------------------------------------------------------------------------


def varying(study: Study) -> list[str]:
    """Return the keys that have several values."""
    return [key for key, values in study.values.items() if len(values) > 1]


def content(found: Swept) -> dict[str, Any]:
    """Return what ``map.json`` holds: over two keys the worst of all runs, then each combination of the others."""
    study, outcomes = found.study, found.outcomes
    keys, likely = varying(study), dict(zip(sorted({o.row.group for o in outcomes}), found.chances, strict=False))
    slices = _slices(study, outcomes, keys[2:])
    axes = [axis_of(study, outcomes, key) for key in keys[:2]]
    return {
        "format": FORMAT,
        "study": study.name,
        "title": study.title,
        "complete": found.complete,
        "refined": None if study.refine is None else study.refine.widths,
        "axes": [axis.content() for axis in axes],
        "limits": sorted({name for outcome in outcomes for name in outcome.limits}),
        "maps": [
            {"where": where, "cells": [_cell(spot, likely) for spot in spots(of, mine, axes)]}
            for where, (of, mine) in slices
        ],
    }


def _slices(
    study: Study, outcomes: Sequence[Outcome], keys: Sequence[str]
) -> Iterator[tuple[dict[str, Any], tuple[Study, Sequence[Outcome]]]]:
    """Yield the study with all outcomes, then with those of each combination of `keys`."""
    yield {}, shown(study, outcomes, [key for key in varying(study) if key not in keys])
    for chosen in product(*([bare(v) for v in study.values[key]] for key in keys)) if keys else ():
        where = dict(zip(keys, chosen, strict=True))
        yield where, (study, [o for o in outcomes if all(o.row.inputs[key] == value for key, value in where.items())])


def _cell(spot: Spot, likely: Mapping[int, Chances]) -> dict[str, Any]:
    found, known = spot.cell, [outcome for outcome in spot.outcomes if outcome.margins]
    worst = min(known, key=lambda o: o.margins[o.binding], default=spot.outcomes[0])
    names = sorted({name for outcome in known for name in outcome.margins})
    return {
        "at": list(spot.at),
        "areas": [[list(side) for side in part] for part in spot.areas],
        "margin": found.margin,
        "binding": found.binding,
        "verdict": found.verdict,
        "margins": {name: min(o.margins[name] for o in known if name in o.margins) for name in names},
        "probability": _probability([likely[g] for g in {o.row.group for o in spot.outcomes} if g in likely]),
        "run": worst.row.number,
        "folder": None if worst.done.directory is None else f"{STORE}/{worst.done.directory.name}",
        "recorded": worst.is_recorded,
        "runs": [outcome.row.number for outcome in spot.outcomes],
        "failed": sum(outcome.done.failure is not None for outcome in spot.outcomes),
    }


def _probability(found: Sequence[Chances]) -> dict[str, Any] | None:
    """Return the probability that limits hold; of several combinations that of the least probable."""
    worst = min(found, key=lambda one: one.of[ALL].estimate, default=None)
    return None if worst is None else {name: asdict(one) for name, one in worst.of.items()}
