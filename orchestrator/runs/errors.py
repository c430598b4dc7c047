"""The parts of an error, estimated or measured."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from orchestrator.coupling.run.compare import matching_rows
from orchestrator.coupling.run.results import Table

CONSTANT = 1e-6
"""A signal that moves by less than this (m, rad …) counts as constant, as the roll of a landing at midspan, which is zero
by symmetry."""
PEAK = re.compile(r"contact\d+\.normal_force_max")
"""Signals whose largest value over the run has an error of its own; elsewhere it is the largest difference over time."""

MESH_ORDER = 3
"""Order of the error in the element length that is reckoned with: 4 where the motion is smooth, less where an impact makes
waves shorter than the elements."""
RIGHT = {"finer": "19 of 20 cases (4 of 5 peak forces)", "coarser": "3 of 5 cases"}
"""Estimate → in how many cases of its calibration it is within a factor 3 (docs/notebook/estimate.md)."""
Differences = dict[str, float]
"""Signal → largest difference, in its unit."""
NAMES = {"coupling": "coupling and macro step", "inner_steps": "inner steps", "mesh": "mesh"}
"""Part → what it is called where people read it."""
CURES = {
    "coupling": "take a smaller macro step (--macro-step {macro_step:g})",
    "inner_steps": "take shorter inner steps (integration_step of cable or robot)",
    "mesh": "lower cable.parameters.mesh_tolerance (without n_elements and grading, which give a mesh of your own)",
}
"""Part → what makes it smaller."""


@dataclass(frozen=True)
class Parts:
    """Error of a signal, largest over the run, in its unit; of a peak force that of its largest value.

    Attributes
    ----------
    coupling : of the exchange at macro steps, and of the iteration
    inner_steps : of the steps that components make inside a macro step; None where it is part of `coupling`, or there are none
    mesh : of the cable's mesh; None where there is none, or that of a foreign cable
    total : their sum, an estimate; or the whole difference from a reference on a finer mesh; NaN where a part is not known
    """

    coupling: float | None
    inner_steps: float | None
    mesh: float | None
    total: float

    @property
    def by_part(self) -> dict[str, float | None]:
        """Part → its value, in the order of `NAMES`."""
        return {part: getattr(self, part) for part in NAMES}

    @property
    def known(self) -> dict[str, float]:
        """The parts that there are."""
        return {part: value for part, value in self.by_part.items() if value is not None}

    @property
    def covered(self) -> list[str]:
        """What the total covers, in words."""
        return [NAMES[part] for part in self.known]

    @property
    def largest(self) -> str:
        """The part that is most of the total."""
        return max(self.known, key=self.known.__getitem__)

    def content(self) -> dict[str, Any]:
        """Return what is written of it."""
        return asdict(self)

    @classmethod
    def from_content(cls, content: Mapping[str, float | None]) -> Parts:
        """Return what was written; JSON has no NaN, and says null."""
        total = content["total"]
        nan = float("nan")
        values = {p: nan if content[p] is None and total is None else content[p] for p in NAMES}
        return cls(**values, total=nan if total is None else total)


def range_of(values: np.ndarray, moved: float | None = None) -> float:
    """Return what errors of a signal are held against, in its unit: its peak-to-peak.

    A constant one has no range. What error it has goes with its size: a mesh leaves 5 nm in the place of the rig's line at
    rest, 2e-8 of the sag. So it is held against that size; or against `CONSTANT`, if that is zero as well.

    Parameters
    ----------
    values : (n,)
    moved : its peak-to-peak, if that is known otherwise
    """
    moved = float(np.ptp(values)) if moved is None else moved
    return moved if moved > CONSTANT else max(float(np.max(np.abs(values))), CONSTANT)


def missed(parts: Mapping[str, Parts], tolerances: Mapping[str, float], table: Mapping[str, np.ndarray]) -> list[str]:
    """Return the signals whose error is larger than their tolerance allows."""
    judged = [name for name in tolerances if name in parts and name in table]
    return [name for name in judged if parts[name].total > tolerances[name] * range_of(table[name])]


def verdict_on(parts: Parts, allowed: float, doubtful: bool) -> str:
    """Return ``within``, ``missed`` or ``not known``; ``doubtful`` is what would be within, where no calibration speaks for
    it. `allowed` has the signal's unit."""
    if np.isnan(parts.total):
        return "not known"
    return "missed" if parts.total > allowed else "doubtful" if doubtful else "within"


def judged(table: Table, tolerances: Iterable[str]) -> list[str]:
    """Return the signals whose error is estimated: those with a tolerance, and the peak forces of all contacts."""
    return [name for name in dict.fromkeys([*tolerances, *filter(PEAK.fullmatch, table)]) if name in table]


def differences(table: Table, other: Table, names: Iterable[str]) -> Differences:
    """Return the largest difference by signal at the times that both tables have; of a peak that of the largest values."""
    coarse, fine = sorted((table, other), key=lambda t: len(t["time"]))
    rows = matching_rows(fine["time"], coarse["time"])
    return {name: _difference(coarse[name], fine[name], rows, name) for name in names if name in other}


def _difference(coarse: np.ndarray, fine: np.ndarray, rows: np.ndarray, name: str) -> float:
    if PEAK.fullmatch(name):
        return float(abs(np.max(coarse) - np.max(fine)))
    return float(np.max(np.abs(coarse - fine[rows])))


def left_out(ratio: float) -> float:
    """Return what the difference from a mesh `ratio` times as fine is multiplied by to have the error of the coarser one."""
    return 1.0 / (1.0 - ratio**-MESH_ORDER)
