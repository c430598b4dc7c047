"""Which communication points are recorded, and what a row says of those since the row before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interval:
    """Every so many macro steps a row; the last point always has one.

    Attributes
    ----------
    every : macro steps from row to row
    is_largest, is_sum : whether a signal, by its name, says the largest value, or the sum, since the communication point
        before; a row says it of all since the row before
    """

    every: int = 1
    is_largest: Callable[[str], object] = lambda name: False
    is_sum: Callable[[str], object] = lambda name: False


class Between:
    """What is kept of the points between two rows.

    Parameters
    ----------
    signals : of the rows, in their order
    """

    def __init__(self, interval: Interval, signals: Sequence[str]):
        self._largest = _places(signals, interval.is_largest)
        self._sums = _places(signals, interval.is_sum)
        self._held: tuple[np.ndarray, np.ndarray] | None = None

    def join(self, row: np.ndarray) -> None:
        """Add what the points before have had to the `row` (signals,) of the present one."""
        if self._held is not None:
            largest, sums = self._held
            row[self._largest] = np.maximum(row[self._largest], largest)
            row[self._sums] += sums

    def keep(self, row: np.ndarray) -> None:
        """Keep what the next row has to say of this point, and of those before."""
        self._held = row[self._largest], row[self._sums]

    def clear(self) -> None:
        """Begin after a row."""
        self._held = None


def _places(signals: Iterable[str], wanted: Callable[[str], object]) -> np.ndarray:
    return np.array([i for i, name in enumerate(signals) if wanted(name)], dtype=np.intp)
