"""The course of an input over time: a table, linear or stepwise between its times, and its means over steps.

What an FMU is given for a step [t, t + h] is the mean of the course over it and, where the FMU has an input for it, the slope
12/h³ ∫ x (τ - t - h/2) dτ: its L² projection on linear functions, exact where the course is linear within the step.
"""

from __future__ import annotations

import csv
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.reading import text_of

ROUNDING = 1e-12
"""Relative; a jump that lies after a communication point by less belongs to it."""
Interpolation = Literal["linear", "step"]


class Course:
    """An input over time; before the first time it has the first value, after the last the last.

    Two entries of one time are a jump: the course has the last value from then on.

    Parameters
    ----------
    time : (n,) s, ascending
    value : (n,)
    interpolation : ``linear`` between the entries, or ``step``: each value holds until the next time

    Raises
    ------
    ValueError : the table is empty, of unequal length, not finite or out of order; the message says where
    """

    def __init__(self, time: Sequence[float], value: Sequence[float], interpolation: Interpolation = "linear"):
        _check(time, value)
        self.stepwise = interpolation == "step"
        t, x = [float(one) for one in time], [float(one) for one in value]
        if self.stepwise:  # the same as a linear one that jumps
            t, x = (
                [t[0], *(s for one in t[1:] for s in (one, one))],
                [s for one in x[:-1] for s in (one, one)] + [x[-1]],
            )
        self.time, self.value = t, x

    def after(self, t: float) -> float:
        """Return the value at `t` (s), and from then on where it jumps there."""
        i = bisect_right(self.time, t)
        return self._between(i - 1, i, t)

    def reached(self, t: float) -> float:
        """Return the value at the communication point `t`, a jump there included, whichever way the time was rounded."""
        last = bisect_right(self.time, t + ROUNDING * max(1.0, abs(t))) - 1
        return self.after(max(t, self.time[last]) if last >= 0 else t)

    def before(self, t: float) -> float:
        """Return the value that the course comes to at `t` (s), before it jumps there."""
        i = bisect_left(self.time, t)
        return self._between(i - 1, i, t)

    def _between(self, i: int, j: int, t: float) -> float:
        """Return the value at `t` on the line from entry `i` to entry `j`; beyond the table that of its end."""
        if i < 0:
            return self.value[0]
        if j >= len(self.time):
            return self.value[-1]
        a, b = self.value[i], self.value[j]
        if a == b:
            return a
        return a + (b - a) * ((t - self.time[i]) / (self.time[j] - self.time[i]))

    def kinks(self, start: float, end: float) -> list[float]:
        """Return the times within (`start`, `end`) at which the course is not straight."""
        return sorted(set(self.time[bisect_right(self.time, start) : bisect_left(self.time, end)]))

    def over(self, t: float, h: float) -> tuple[float, float]:
        """Return mean and slope over the step from `t` to `t + h` (s): the linear function nearest to the course in L²."""
        edges = [t, *self.kinks(t, t + h), t + h]
        if len(edges) == 2:
            first, last = self.after(t), self.before(t + h)
            return 0.5 * (first + last), (last - first) / h
        mean = moment = 0.0
        for a, b in pairwise(edges):
            first, last = self.after(a), self.before(b)
            length, middle = b - a, 0.5 * (first + last)
            mean += length * middle
            moment += length * (middle * (0.5 * (a - t + b - t) - 0.5 * h) + length * (last - first) / 12.0)
        return mean / h, 12.0 * moment / h**3

    def is_whole(self) -> bool:
        """Return whether all values are whole numbers."""
        return all(x == round(x) for x in self.value)


def _check(time: Sequence[float], value: Sequence[float]) -> None:
    if not len(time) or not len(value):
        raise ValueError("the table is empty; give at least one time and one value")
    if len(time) != len(value):
        raise ValueError(f"{len(time)} times and {len(value)} values; give one value for each time")
    for name, column in (("time", time), ("value", value)):
        wrong = next((i for i, x in enumerate(column) if not np.isfinite(x)), None)
        if wrong is not None:
            raise ValueError(f"{name}[{wrong + 1}] = {column[wrong]} is not a finite number; give one")
    wrong = next((i for i in range(1, len(time)) if time[i] < time[i - 1]), None)
    if wrong is not None:
        raise ValueError(
            f"time[{wrong + 1}] = {time[wrong]:g} s is before time[{wrong}] = {time[wrong - 1]:g} s; put the entries in order"
        )


def read_courses(path: Path, interpolation: Interpolation = "linear") -> dict[str, Course]:
    """Return the courses of a CSV file by their columns: FMPy's format for inputs.

    The first column is ``time`` in s, the others are variables; two rows of one time are a jump. `InputError` says what is
    wrong with the file.
    """
    time, columns = read_columns(path)
    try:
        return {name: Course(time, values, interpolation) for name, values in columns.items()}
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def read_columns(path: Path) -> tuple[list[float], dict[str, list[float]]]:
    """Return the times, and the other columns by their names, of a CSV file as FMPy has it for inputs."""
    try:
        rows = [row for row in csv.reader(StringIO(text_of(path, "a table of inputs"))) if row]
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as a table of inputs: {error}") from None
    names = [name.strip() for name in rows[0]] if rows else []
    if names[:1] != ["time"] or len(names) < 2:
        raise InputError(f'{path}: its first line must be a header: "time", then names of variables')
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two columns have one name; rename one of them")
    numbers = [_numbers(path, i, row, len(names)) for i, row in enumerate(rows[1:], start=2)]
    columns = {name: [row[i] for row in numbers] for i, name in enumerate(names)}
    return columns.pop("time"), columns


def _numbers(path: Path, line: int, row: Iterable[str], n: int) -> list[float]:
    try:
        numbers = [float(text) for text in row]
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {error}; write numbers") from None
    if len(numbers) != n:
        raise InputError(f"{path}, line {line}: {len(numbers)} numbers for {n} columns; give one for each")
    return numbers
