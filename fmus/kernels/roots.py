"""The root of a function of one variable, by Brent's method.

SciPy has it too (the tests hold one against the other). But to import `scipy.optimize` takes as
long as all else that a short run imports, and an FMU that needs NumPy and Numba alone has more hosts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan

EPS = 2.0**-52
MOST_ITERATIONS = 100


@dataclass
class _Points:
    """Three points of the search: the best so far, the one before, and one on the other side of the root.

    Attributes
    ----------
    x, f : the best point, and the function there
    x_old, f_old : the point before
    x_far, f_far : the end of the bracket beyond the root
    step, step_old : the last step, and the one before
    """

    x: float
    f: float
    x_old: float
    f_old: float
    x_far: float = 0.0
    f_far: float = 0.0
    step: float = 0.0
    step_old: float = 0.0

    def enclose(self) -> None:
        """Let the far point be across the root, and the best one be the best of both."""
        if self.f_old != 0.0 and self.f != 0.0 and (self.f_old < 0.0) != (self.f < 0.0):
            self.x_far, self.f_far = self.x_old, self.f_old
            self.step = self.step_old = self.x - self.x_old
        if abs(self.f_far) < abs(self.f):
            self.x_old, self.x, self.x_far = self.x, self.x_far, self.x
            self.f_old, self.f, self.f_far = self.f, self.f_far, self.f

    def interpolated(self) -> float:
        """Return the step to the root of the line or the inverse parabola through the points."""
        if self.x_old == self.x_far:
            return -self.f * (self.x - self.x_old) / (self.f - self.f_old)
        old = (self.f_old - self.f) / (self.x_old - self.x)
        far = (self.f_far - self.f) / (self.x_far - self.x)
        return -self.f * (self.f_far * far - self.f_old * old) / (far * old * (self.f_far - self.f_old))

    def choose(self, half: float, delta: float) -> None:
        """Choose the next step: the interpolated one if it is short enough, else half the bracket, `half`."""
        if abs(self.step_old) > delta and abs(self.f) < abs(self.f_old):
            wanted = self.interpolated()
            if 2.0 * abs(wanted) < min(abs(self.step_old), 3.0 * abs(half) - delta):
                self.step_old, self.step = self.step, wanted
                return
        self.step_old = self.step = half


def root(
    function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12, rtol: float = 4.0 * EPS
) -> float:
    """Return a root of `function` between `low` and `high`, to `xtol` + `rtol` times its magnitude.

    Brent, Algorithms for Minimization Without Derivatives (1973), chapter 4.

    Raises
    ------
    ValueError : `function` has the same sign at both ends or is not a number, or the iterations do not end
    """
    at = _Points(high, float(function(high)), low, float(function(low)))
    if at.f_old == 0.0:
        return low
    if at.f == 0.0:
        return high
    if (at.f_old < 0.0) == (at.f < 0.0):
        raise ValueError(f"f({low:g}) and f({high:g}) must have different signs")
    for _ in range(MOST_ITERATIONS):
        at.enclose()
        delta, half = (xtol + rtol * abs(at.x)) / 2.0, (at.x_far - at.x) / 2.0
        if at.f == 0.0 or abs(half) < delta:
            return at.x
        at.choose(half, delta)
        at.x_old, at.f_old = at.x, at.f
        at.x += at.step if abs(at.step) > delta else (delta if half > 0.0 else -delta)
        at.f = float(function(at.x))
        if isnan(at.f):
            raise ValueError(f"f({at.x:g}) is not a number")
    raise ValueError(f"no root between {low:g} and {high:g} after {MOST_ITERATIONS} iterations")
