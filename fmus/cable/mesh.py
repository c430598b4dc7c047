"""Where the nodes stand along the unstretched cable: equal elements, or graded ones.

The bending layer √(EI/H) at a support or a wheel is some decimetres long, the waves of interest some tens of
metres. A graded mesh is fine at the supports and at the landing point; from there an element is at most
about twice as long as its neighbour, up to the longest length.
"""

from __future__ import annotations

import numpy as np

GROWTH = np.log(2.0)
"""Growth of the element length with distance from a refined point: neighbours differ by a factor of 2."""


def nodes(length: float, n_elements: int, grading: float = 1.0, position: float = -1.0) -> np.ndarray:
    """Return the arc lengths of the nodes, ascending from 0 to `length`.

    Parameters
    ----------
    length : unstretched length, m
    n_elements : number of elements
    grading : ratio of the longest to the shortest element wanted; 1 means equal elements
    position : arc length of a refined point besides both supports, m; negative for none

    Returns
    -------
    s : (n_elements + 1,) float, m
    """
    if grading <= 1.0:
        return np.linspace(0.0, length, n_elements + 1)
    refined = [0.0, length] + ([position] if 0.0 < position < length else [])
    fine = np.unique(np.concatenate([_clustered(length, at) for at in refined]))
    distance = np.min([np.abs(fine - at) for at in refined], axis=0)
    longest = _longest_element(fine, distance, n_elements, grading)
    count = _count(fine, distance, longest, grading)
    s = np.interp(np.arange(n_elements + 1), count * n_elements / count[-1], fine)
    s[0], s[-1] = 0.0, length
    return s


def _clustered(length: float, at: float) -> np.ndarray:
    """Return sample points, dense near `at`, on which the element count is integrated."""
    offsets = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 2000)]) * length
    points = np.concatenate([at - offsets, at + offsets])
    return np.concatenate([points[(points >= 0.0) & (points <= length)], [0.0, length]])


def _count(fine: np.ndarray, distance: np.ndarray, longest: float, grading: float) -> np.ndarray:
    """Return the number of elements of the wanted lengths from 0 to each sample point."""
    density = 1.0 / np.minimum(longest, longest / grading + GROWTH * distance)
    return np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])


def _longest_element(fine: np.ndarray, distance: np.ndarray, n_elements: int, grading: float) -> float:
    """Bisect for the longest element with which the wanted lengths fill the cable `n_elements` times."""
    low, high = fine[-1] / n_elements * 0.5, fine[-1] * grading
    for _ in range(80):
        middle = np.sqrt(low * high)
        if _count(fine, distance, middle, grading)[-1] > n_elements:
            low = middle
        else:
            high = middle
    return float(high)
