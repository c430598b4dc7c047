"""Measures: one number, or a band, from a signal over time, by name.

Each is a pure function of the times (n,) s and the values (n,). A peak is looked for between the rows, too: a parabola
through the highest row and its neighbours, whose error is of third order in the interval. Deviations are counted from the
first row, at which the robot stands over the line at rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestrator.coupling.errors import InputError, nearest

Value = float | tuple[float, ...]
Measure = Callable[[np.ndarray, np.ndarray], Value]

SETTLED = 0.05
"""Part of the largest deviation within which a signal has settled: the 5 % of control engineering."""
TAIL = 0.1
"""Part of the run, at its end, whose mean is the value that a signal has settled to."""


def start(time: np.ndarray, values: np.ndarray) -> float:
    """Return the first value."""
    return float(values[0])


def end(time: np.ndarray, values: np.ndarray) -> float:
    """Return the last value."""
    return float(values[-1])


def settled(time: np.ndarray, values: np.ndarray) -> float:
    """Return the value that the signal has settled to: its mean over the last tenth of the run."""
    return float(np.mean(values[time >= time[-1] - TAIL * (time[-1] - time[0])]))


def highest(time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest value, between the rows too."""
    return _vertex(time, values, int(np.argmax(values)))[1]


def lowest(time: np.ndarray, values: np.ndarray) -> float:
    """Return the smallest value, between the rows too."""
    return _vertex(time, values, int(np.argmin(values)))[1]


def largest(time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest magnitude."""
    return max(abs(highest(time, values)), abs(lowest(time, values)))


def band(time: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Return the smallest and the largest value."""
    return lowest(time, values), highest(time, values)


def amplitude(time: np.ndarray, values: np.ndarray) -> float:
    """Return half of what lies between the largest and the smallest value."""
    return 0.5 * (highest(time, values) - lowest(time, values))


def swing(time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest deviation, either way, from the value that the signal settles to."""
    return largest(time, values - settled(time, values))


def peak(time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest deviation from the first value, with its sign."""
    return _vertex(time, values - values[0], _at_peak(values))[1]


def peak_time(time: np.ndarray, values: np.ndarray) -> float:
    """Return when the deviation from the first value is largest, s from the start."""
    return _vertex(time, values - values[0], _at_peak(values))[0] - float(time[0])


def first_peak(time: np.ndarray, values: np.ndarray) -> float:
    """Return the deviation from the first value where it first turns back, with its sign."""
    return _vertex(time, values - values[0], _at_first_peak(values))[1]


def first_peak_time(time: np.ndarray, values: np.ndarray) -> float:
    """Return when the deviation from the first value first turns back, s from the start."""
    return _vertex(time, values - values[0], _at_first_peak(values))[0] - float(time[0])


def change(time: np.ndarray, values: np.ndarray) -> float:
    """Return by how much the signal has settled away from its first value."""
    return settled(time, values) - float(values[0])


def overshoot(time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest deviation by that which remains: 1 for a signal that creeps to its end, 2 for an undamped spring
    whose load is let go."""
    remains = change(time, values)
    return peak(time, values) / remains if remains else float("nan")


def settling_time(time: np.ndarray, values: np.ndarray) -> float:
    """Return when the signal has come within 5 % of its largest deviation from the value that it settles to, for good, s
    from the start."""
    apart = np.abs(values - settled(time, values))
    outside = np.flatnonzero(apart > SETTLED * apart.max()) if apart.max() > 0.0 else np.zeros(0, int)
    if not outside.size:
        return 0.0
    last = int(outside[-1])
    if last + 1 == len(time):
        return float(time[-1] - time[0])
    before, after, bound = apart[last], apart[last + 1], SETTLED * apart.max()
    return float(time[last] + (time[last + 1] - time[last]) * (before - bound) / (before - after) - time[0])


def rise(time: np.ndarray, values: np.ndarray) -> float:
    """Return the settled value by the first one."""
    return settled(time, values) / float(values[0]) if values[0] else float("nan")


MEASURES: dict[str, Measure] = {
    function.__name__: function
    for function in (
        start, end, settled, highest, lowest, largest, band, amplitude, swing, peak, peak_time, first_peak, first_peak_time,
        change, overshoot, settling_time, rise,
    )
}  # fmt: skip
"""The measures by name."""


def measure_named(name: str) -> Measure:
    """Return a measure by its name; `InputError` if there is none."""
    if name not in MEASURES:
        raise InputError(f"no measure {name!r}{nearest(name, MEASURES)}; there are {', '.join(MEASURES)}")
    return MEASURES[name]


def _at_peak(values: np.ndarray) -> int:
    return int(np.argmax(np.abs(values - values[0])))


def _at_first_peak(values: np.ndarray) -> int:
    """Return the row at which the deviation first turns back; the last one if it never does.

    Ripples count not: what turns back has reached a tenth of the largest deviation.
    """
    apart = np.abs(values - values[0])
    turns = np.flatnonzero((apart[1:-1] >= apart[:-2]) & (apart[1:-1] > apart[2:])) + 1
    turns = turns[apart[turns] >= 0.1 * apart.max()]
    return int(turns[0]) if turns.size else len(values) - 1


def _vertex(time: np.ndarray, values: np.ndarray, i: int) -> tuple[float, float]:
    """Return time and value of the vertex of the parabola through row `i` and its neighbours; the row itself at an end,
    or where it is no extreme."""
    if not 0 < i < len(values) - 1:
        return float(time[i]), float(values[i])
    before, here, after = values[i - 1 : i + 2]
    bend = before - 2.0 * here + after
    if bend == 0.0 or (here - before) * (here - after) < 0.0:
        return float(time[i]), float(here)
    shift = 0.5 * (before - after) / bend
    return float(time[i] + shift * (time[i + 1] - time[i])), float(here - 0.25 * (before - after) * shift)
