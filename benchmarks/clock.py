"""The clock of all benchmarks: CPU time, contestants in turns.

Wall time says what else the machine was doing. CPU time of contestants that take turns says how they compare, by the
median over the rounds of the ratio within a round: what slows one down in a round slows down all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import process_time

import numpy as np

Times = dict[str, np.ndarray]
"""Contestant → its CPU time in every round, s."""


def turns(contestants: Mapping[str, Callable[[], float]], rounds: int) -> Times:
    """Let all contestants take turns; each returns the CPU time (s) that counts."""
    found: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            found[name].append(run())
    return {name: np.array(times) for name, times in found.items()}


def ratio(times: Times, name: str, peer: str) -> float:
    """Return the median over the rounds of a contestant's time over its peer's."""
    return float(np.median(times[name] / times[peer]))


def spent(call: Callable[[], object]) -> float:
    """Return the CPU time of a call, s."""
    start = process_time()
    call()
    return process_time() - start


class Loop:
    """CPU time of a loop that calls this after each of its steps, without the first step, which loads and compiles."""

    def __init__(self) -> None:
        self.first: float | None = None

    def __call__(self, _: object) -> None:
        if self.first is None:
            self.first = process_time()

    def spent(self) -> float:
        """Return the time since the first step, s."""
        assert self.first is not None, "the loop has made no step"
        return process_time() - self.first
