"""The reports of all macro steps as columns: a tenth of the memory of as many objects, and on disk if they are many."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from operator import attrgetter
from typing import Any, overload

import numpy as np

from orchestrator.coupling.run.columns import Rows
from orchestrator.coupling.stepping.report import StepReport

NAMES = tuple(field.name for field in fields(StepReport))
KINDS: dict[str, type] = {
    "iterations": int, "subdivisions": int, "rejected": int, "columns": int, "by_model": bool, "converged": bool,
}  # fmt: skip
"""What is no real number."""
POWER = "power_residual."
"""Begins the name of the column of one load: W, its power residual in each macro step."""


_all = attrgetter(*NAMES)


class Steps(Sequence[StepReport]):
    """The reports in their order; each is made when it is asked for.

    Parameters
    ----------
    rows : as `add` has written them
    """

    def __init__(self, rows: Rows):
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, index: int) -> StepReport: ...
    @overload
    def __getitem__(self, index: slice) -> list[StepReport]: ...
    def __getitem__(self, index: int | slice) -> StepReport | list[StepReport]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return _report(self.rows.row(index))

    def __iter__(self) -> Iterator[StepReport]:
        for piece in self.rows.pieces():
            yield from map(_report, piece)

    def column(self, name: str) -> np.ndarray:
        """Return what all reports say by one name, (n,)."""
        return self.rows.column(name).astype(KINDS.get(name, float), copy=False)


def add(rows: Rows, report: StepReport, powers: Any) -> None:
    """Write a report and the power residuals of all loads (W) as the next row."""
    row = rows.next
    row[: len(NAMES)] = _all(report)
    row[len(NAMES) :] = powers
    rows.add()


def _report(row: np.ndarray) -> StepReport:
    values = zip(NAMES, row.tolist(), strict=False)  # after them stand the loads
    return StepReport(**{name: KINDS.get(name, float)(value) for name, value in values})
