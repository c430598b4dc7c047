"""How wrong the coupled runs are: errors against a reference, observed orders, verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.run.results import Table


@dataclass(frozen=True)
class SignalError:
    """Error of one signal at the communication points, over the whole run.

    Attributes
    ----------
    max_error, rms_error : in the signal's unit
    scale : the reference's peak-to-peak, in the signal's unit
    relative_max_error : `max_error` / `scale`
    """

    max_error: float
    rms_error: float
    scale: float
    relative_max_error: float


def signal_errors(table: Table, reference: Table) -> dict[str, SignalError]:
    """Return the errors of all signals that `table` and `reference` both have.

    Every time of `table` must be among the reference's.
    """
    rows = matching_rows(reference["time"], table["time"])
    common = [name for name in table if name in reference and name != "time"]
    return {name: _signal_error(table[name], reference[name], rows) for name in common}


def matching_rows(times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the places of `wanted` among the rising `times`, up to rounding; all must be there."""
    rows = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    rows -= np.abs(times[rows - 1] - wanted) <= np.abs(times[rows % len(times)] - wanted)
    gap = np.abs(times[rows] - wanted)
    if np.any(gap > 1e-9 * (1.0 + np.abs(wanted))):
        raise ValueError(f"the reference has no value at t = {wanted[np.argmax(gap)]:g} s")
    return rows


def communication_times(stop_time: float, macro_steps: Iterable[float]) -> np.ndarray:
    """Return the communication points of all macro steps together, each once: (n,) s."""
    grids = [np.arange(round(stop_time / step) + 1) * step for step in macro_steps]
    times = np.sort(np.concatenate(grids))
    return times[np.append(True, np.diff(times) > 1e-9 * (1.0 + stop_time))]


def observed_order(macro_steps: Iterable[float], errors: Iterable[float]) -> float:
    """Return the slope of log(error) over log(macro step) by least squares; NaN where an error is zero."""
    steps, values = np.array(list(macro_steps)), np.array(list(errors))
    if len(np.unique(steps)) < 2 or not np.all(np.isfinite(values)) or np.any(values <= 0.0):
        return float("nan")
    return float(np.polyfit(np.log(steps), np.log(values), 1)[0])


def _signal_error(values: np.ndarray, reference: np.ndarray, rows: np.ndarray) -> SignalError:
    difference = np.abs(values - reference[rows])
    largest, scale = float(np.max(difference)), float(np.ptp(reference))
    relative = largest / scale if scale > 0.0 else (0.0 if largest == 0.0 else float("inf"))
    rms = largest * float(np.sqrt(np.mean((difference / largest) ** 2))) if largest > 0.0 else 0.0
    return SignalError(largest, rms, scale, relative)


def largest_difference(table: Table, other: Table) -> Mapping[str, float]:
    """Return the largest difference by signal between two tables at the times of `table`."""
    return {name: error.max_error for name, error in signal_errors(table, other).items()}
