"""Where the nodes stand along the unstretched cable: found by itself, equal elements, or graded ones.

The bending layer √(EI/T) at a wheel or a clamp is some decimetres long, the waves of interest some metres to some tens
of metres. A mesh is fine where the cable bends, and grows from there. How fine, and how fast it may grow, was measured:
docs/notebook/mesh.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fmus.kernels.roots import root

TOLERANCE = 5e-4
"""Error of the motion, by its range, at which the sizes below stand; elements shrink with its fourth root: their order is 4."""
AT_WHEEL, AT_CLAMP, AT_PIN = 0.6, 0.5, 1.5
"""Length of the elements there, in bending layers."""
NEAR = 10.0
"""Bending layers around a wheel or a clamp within which the mesh grows slowly: short waves of an impact must pass."""
SLOW_GROWTH, FAST_GROWTH = 0.4, 1.0
"""Growth of the element length with the distance, near and farther away: e^0.4 = 1.5 and e = 2.7 from one to the next."""
LONGEST, LONGEST_UNKNOWN = 1.0 / 30.0, 1.0 / 80.0
"""Longest element, as a share of the length, where it is known where the wheels land, and where it is not."""
LIGHT = 1.0 / 6.0
"""Longest element, as a share of the length of line that has the mass of what lands: as long are the waves it makes."""
SHORTEST = 0.05
"""m; as long as what a wheel presses on: no element at a wheel needs to be shorter."""
MOST = 5000
"""Number of elements that no mesh exceeds."""


@dataclass(frozen=True)
class Line:
    """The cable as far as a mesh depends on it.

    Attributes
    ----------
    span, level_difference, length : m; `length` is the unstretched one
    ea, ei : N, N m²
    weight : N/m
    clamped : whether the supports hold the slope
    """

    span: float
    level_difference: float
    length: float
    ea: float
    ei: float
    weight: float
    clamped: bool

    def tension(self, load: float, at: float) -> float:
        """Return the horizontal tension (N) of the shallow line that carries `load` (N) at the distance `at` (m).

        Irvine, Cable Structures, 1981, section 1.5: with the shear V of a beam under the same loads, the line is by
        ∫V² dy/(2 H²) longer than its chord. Exact to the square of the sag by the span; zero for a slack weightless line.
        """
        span, w = self.span, self.weight
        shear = w**2 * span**3 / 12.0 + load * w * at * (span - at) + load**2 * at * (span - at) / span
        chord = float(np.hypot(span, self.level_difference))
        taut = self.ea * (chord / self.length - 1.0)
        if shear <= 0.0:
            return max(taut, 0.0)

        def excess(h: float) -> float:
            return self.length * (1.0 + h / self.ea) - chord - 0.5 * shear / h**2

        high = max(taut, 0.0) + (0.5 * shear * self.ea / self.length) ** (1.0 / 3.0)
        low = high
        while excess(low) > 0.0:
            low *= 0.5
        return root(excess, low, 1.001 * high, rtol=1e-9) if low < high else high

    def layer(self, load: float, at: float) -> float:
        """Return the length (m) of the bending layer under a load; infinite where nothing stretches the line."""
        tension = self.tension(load, at)
        return float(np.sqrt(self.ei / tension)) if tension > 0.0 else np.inf


@dataclass(frozen=True)
class Zone:
    """A place around which the mesh is fine: arc length and element length there, m, and how far it grows slowly, m."""

    at: float
    shortest: float
    near: float

    def size(self, s: np.ndarray) -> np.ndarray:
        """Return the element length (m) wanted at arc lengths `s`, on account of this place alone."""
        distance = np.abs(s - self.at)
        slow = np.minimum(distance, self.near)
        return self.shortest + SLOW_GROWTH * slow + FAST_GROWTH * (distance - slow)


def automatic(line: Line, wheels: np.ndarray, load: float, tolerance: float) -> np.ndarray:
    """Return the arc lengths of the nodes of a mesh that leaves an error of about `tolerance` in the motion.

    Parameters
    ----------
    wheels : (n,) arc lengths at which wheels land, m; none: it is not known where
    load : weight of what lands, N
    tolerance : error of the motion by its range

    Returns
    -------
    s : (n_elements + 1,) float, ascending from 0 to the length of the line, m
    """
    layer = line.layer(load, line.span * float(np.mean(wheels)) / line.length if wheels.size else 0.5 * line.span)
    slow = NEAR * layer
    at_support, near = (AT_CLAMP, slow) if line.clamped else (AT_PIN, 0.0)
    zones = [Zone(at, max(at_support * layer, SHORTEST), near) for at in (0.0, line.length)]
    zones += [Zone(float(at), max(AT_WHEEL * layer, SHORTEST), slow) for at in wheels]
    longest = _longest(line, load) if wheels.size else LONGEST_UNKNOWN * line.length
    fine = np.unique(np.concatenate([_clustered(line.length, zone.at) for zone in zones]))
    size = np.min([np.full(fine.size, longest), *(zone.size(fine) for zone in zones)], axis=0)
    count = _integrated(fine, (TOLERANCE / tolerance) ** 0.25 / size)
    return _placed(fine, count, min(int(np.ceil(count[-1] - 1e-9)), MOST))


def _longest(line: Line, load: float) -> float:
    """Return the length (m) of the longest element: it follows the waves that what lands makes."""
    wanted = LIGHT * load / line.weight if line.weight > 0.0 else np.inf
    return float(np.clip(wanted, 0.5 * LONGEST * line.length, LONGEST * line.length))


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
    return _placed(fine, count, n_elements)


def _placed(fine: np.ndarray, count: np.ndarray, n_elements: int) -> np.ndarray:
    """Return the nodes (n_elements + 1,) that divide `count`, the number of elements up to each of `fine`, equally."""
    s = np.interp(np.arange(n_elements + 1), count * n_elements / count[-1], fine)
    s[0], s[-1] = 0.0, fine[-1]
    return s


def _integrated(fine: np.ndarray, density: np.ndarray) -> np.ndarray:
    """Return the integral of `density` from 0 to each sample point."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])


def _clustered(length: float, at: float) -> np.ndarray:
    """Return sample points, dense near `at`, on which the element count is integrated."""
    offsets = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 2000)]) * length
    points = np.concatenate([at - offsets, at + offsets])
    return np.concatenate([points[(points >= 0.0) & (points <= length)], [0.0, length]])


def _count(fine: np.ndarray, distance: np.ndarray, longest: float, grading: float) -> np.ndarray:
    """Return the number of elements of the wanted lengths from 0 to each sample point."""
    density = 1.0 / np.minimum(longest, longest / grading + GROWTH * distance)
    return _integrated(fine, density)


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


def spread(count: int, most: int) -> np.ndarray:
    """Return which (m,) of `count` nodes are shown, ascending: all, or `most` of them, both ends included."""
    return np.unique(np.round(np.linspace(0, count - 1, min(count, most))).astype(int))
