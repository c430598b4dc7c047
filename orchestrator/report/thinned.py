"""A long run as pictures show it: some of its points, with all extremes. No number is printed from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orchestrator.coupling.run.columns import some_of
from orchestrator.coupling.run.results import Table
from orchestrator.runs.result import Run

MOST = 20_001
"""Points that a curve of a picture may have, some ten for each of its pixels: 20 s at 1 ms."""
OF_STEPS = ("time", "iterations", "converged")
"""What a picture shows of each macro step."""


def thinned(run: Run) -> Run:
    """Return `run`, or of one with more than `MOST` points every k-th and those at which a signal is least or largest."""
    n = len(run.time)
    if n <= MOST:
        return run
    rows = _rows(run.table)
    fields = dict(run.fields)
    if "tension_max" in fields:
        fields["tension_max"] = fields["tension_max"][rows]
    steps = some_of(run.iterations, OF_STEPS)
    return replace(run, table=_at(run.table, rows), iterations=_at(steps, _steps(steps)), fields=fields)


def _rows(table: Table) -> np.ndarray:
    found = {row for name in table for row in _extremes(table[name])}
    n = len(table["time"])
    return np.unique([*range(0, n, -(-n // MOST)), n - 1, *found])


def _extremes(values: np.ndarray) -> tuple[int, int]:
    return int(np.argmin(values)), int(np.argmax(values))


def _steps(table: Table) -> np.ndarray:
    """Return the macro steps that are shown: every k-th, the extremes, and those that did not converge (so many at most)."""
    return np.unique([*_rows(table), *np.flatnonzero(~table["converged"])[:MOST]])


def _at(table: Table, rows: np.ndarray) -> Table:
    return {name: table[name][rows] for name in table}


def left_out(shown: Run, run: Run) -> str:
    """Return what a picture says of the points that are left out; empty where none are."""
    few, all_ = len(shown.time), len(run.time)
    return "" if few == all_ else f"{few} of {all_} points, all extremes among them"
