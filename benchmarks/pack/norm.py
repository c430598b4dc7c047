"""The error of a result: the largest difference from the reference at its points, as a share of the reference's range.

e = max over k of abs(y(t_k) - r(t_k)) / (max r - min r), t_k = k Δ from 0 to the end of the run, for each signal.
"""

from __future__ import annotations

import numpy as np

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.run.results import Table

ROUNDING = 1e-9
"""Of the end of the run: how far the times of a result may be from those of the reference."""


def errors(result: Table, reference: Table) -> dict[str, float]:
    """Return the error of each signal of the reference; not finite where the result is not.

    Parameters
    ----------
    result : ``time`` (m,) s and signals (m,); the points of the reference are among them

    Raises
    ------
    InputError : a signal or a point of the reference is missing
    """
    rows = places(np.asarray(result["time"]), reference["time"])
    return {name: _error(result, name, rows, reference[name]) for name in reference if name != "time"}


def places(times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return where the `wanted` times are among `times`; `InputError` names the first that is not."""
    if not times.size:
        raise InputError("the result has no rows")
    rows = np.searchsorted(times, wanted - ROUNDING * wanted[-1])
    rows = np.minimum(rows, times.size - 1)
    missing = np.abs(times[rows] - wanted) > ROUNDING * wanted[-1]
    if missing.any():
        raise InputError(
            f"the result has no row at t = {wanted[missing][0]:.9g} s; "
            f"it needs one every {wanted[1] - wanted[0]:.9g} s until {wanted[-1]:.9g} s"
        )
    return rows


def _error(result: Table, name: str, rows: np.ndarray, reference: np.ndarray) -> float:
    if name not in result:
        raise InputError(f"the result has no column {name}{nearest(name, result)}")
    return float(np.max(np.abs(np.asarray(result[name])[rows] - reference)) / np.ptp(reference))
