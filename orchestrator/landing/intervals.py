"""Signals of an interval: what they say when communication points are left out.

A contact's largest values and its impulse belong to the interval since the communication point before. A table that is
looked at at fewer points, as a finer run held against a coarser one is, must say them of the longer intervals.
"""

from __future__ import annotations

import re

import numpy as np

from orchestrator.coupling.run.compare import matching_rows
from orchestrator.coupling.run.results import Table

LARGEST = re.compile(r"contact\d+\.\w+_max")
SUMMED = re.compile(r"contact\d+\.impulse")


def coarsened(table: Table, times: np.ndarray) -> Table:
    """Return the rows of `table` at `times` (n,) s, all of them among its own; signals of an interval are those since the
    time before."""
    rows = matching_rows(table["time"], times)
    return {name: _at(name, np.asarray(values), rows) for name, values in table.items()}


def _at(name: str, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    combine = np.maximum if LARGEST.fullmatch(name) else np.add if SUMMED.fullmatch(name) else None
    if combine is None or len(rows) < 2:
        return values[rows]
    return np.append(values[rows[0]], combine.reduceat(values[: rows[-1] + 1], rows[:-1] + 1))
