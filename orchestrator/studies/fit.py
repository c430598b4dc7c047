"""Parameters from data: a global search, a local refinement, and how well the data determine what is found.

The sum of squares chi2(p) = sum r_i(p)^2 of residuals, each divided by its own uncertainty, is made small between
bounds: first by differential evolution (Storn & Price 1997), which needs no start and no slopes, then by least squares
from its best member. Residuals are asked for many points at once, so that they can be calculated side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, least_squares

STEP = 1e-3
"""Step of the central differences, as a share of the range between the bounds."""
JUMP = 3.0
"""Ratio of the differences to either side beyond which one of them holds a jump."""
FAILED = 1e6
"""Residual of what cannot be calculated: far worse than any landing, and still a number that a search can compare."""
AT_BOUND = 1e-3
"""Share of the range within which a value counts as lying at its bound."""
UNDETERMINED = 1e-4
"""Singular values of the sensitivity, by the largest, below which a direction is not determined by the data."""
PROFILE_ROUNDS, NEAR_END = 6, 0.1
"""Points of a profile at most, and how near, by its distance, the end is foretold well enough."""

Residuals = Callable[[np.ndarray], np.ndarray]
"""From points (m, n), in parameters' own units, to residuals (m, k); not finite where there are none."""
Told = Callable[[str, float], None]
"""Told the stage and the least sum of squares so far."""


@dataclass(frozen=True)
class Parameter:
    """What is looked for, between `low` and `high`; on a logarithmic scale if `log`."""

    name: str
    low: float
    high: float
    log: bool = False

    def value(self, share: np.ndarray) -> np.ndarray:
        """Return the values at `share` (0 to 1) of the range."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share

    def share(self, value: float) -> float:
        """Return where in the range a value lies."""
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    def slope(self, share: float) -> float:
        """Return d value / d share."""
        span = np.log(self.high / self.low) * self.value(np.asarray(share)) if self.log else self.high - self.low
        return float(span)


@dataclass(frozen=True)
class Estimate:
    """One parameter found.

    Attributes
    ----------
    value, deviation : in the parameter's unit; `deviation` is one standard deviation, infinite where the data leave it open
    interval : where the sum of squares, minimised over all others, has risen by one unit of its scale; None if not asked for
    at_bound : ``low``, ``high`` or empty
    determined : whether the data say anything of it
    """

    name: str
    value: float
    deviation: float
    interval: tuple[float, float] | None
    at_bound: str
    determined: bool


@dataclass(frozen=True)
class Fit:
    """What was found.

    Attributes
    ----------
    estimates : a parameter each
    correlation : (n, n), NaN where a parameter is not determined
    residual : (k,) at the best point, in units of each datum's uncertainty
    chi2 : the sum of their squares
    scale : what variances were multiplied by, max(1, chi2/(k - n)): data that are missed by more than their uncertainty
        determine nothing as well as they promise
    evaluations : points at which residuals were asked for
    """

    estimates: list[Estimate]
    correlation: np.ndarray
    residual: np.ndarray
    chi2: float
    scale: float
    evaluations: int

    @property
    def values(self) -> dict[str, float]:
        """The values found, by name."""
        return {one.name: one.value for one in self.estimates}


@dataclass(frozen=True)
class Effort:
    """How hard to search: members of the population a parameter, generations, and whether intervals are profiled."""

    population: int = 8
    generations: int = 25
    seed: int = 1
    profile: bool = True


class _Space:
    """The residuals in shares of the ranges, with what is learnt on the way."""

    def __init__(self, parameters: Sequence[Parameter], residuals: Residuals, told: Told):
        self.parameters, self._residuals, self._told = list(parameters), residuals, told
        self.evaluations, self.stage, self._least = 0, "", np.inf

    def __call__(self, shares: np.ndarray) -> np.ndarray:
        """Return residuals (m, k) at `shares` (m, n)."""
        points = np.column_stack([p.value(shares[:, i]) for i, p in enumerate(self.parameters)])
        found = self._residuals(points)
        self.evaluations += len(points)
        found = np.where(np.isfinite(found), found, FAILED)
        self._least = min(self._least, float(np.min(np.sum(found**2, axis=1))))
        self._told(self.stage, self._least)
        return found

    def one(self, share: np.ndarray) -> np.ndarray:
        """Return residuals (k,) at one point."""
        return self(share[None, :])[0]

    def slopes(self, share: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Return d residual / d share (k, m) of the parameters `free`, by differences within the bounds.

        Central ones; but a residual may jump, as the time of the highest of several peaks does. Where the differences to
        either side are far apart, the smaller one is the slope, and the other holds a jump.
        """
        low = np.tile(share, (free.size, 1))
        high = low.copy()
        rows = np.arange(free.size)
        low[rows, free] = np.maximum(share[free] - STEP, 0.0)
        high[rows, free] = np.minimum(share[free] + STEP, 1.0)
        found = self(np.vstack([share[None, :], low, high]))
        here, before, after = found[0], found[1 : free.size + 1], found[free.size + 1 :]
        left, right = (share - low)[rows, free][:, None], (high - share)[rows, free][:, None]
        back = np.divide(here - before, left, out=np.full_like(before, np.inf), where=left > 0.0)
        ahead = np.divide(after - here, right, out=np.full_like(after, np.inf), where=right > 0.0)
        smaller = np.where(np.abs(back) < np.abs(ahead), back, ahead)
        apart = np.maximum(np.abs(back), np.abs(ahead)) > JUMP * np.abs(smaller)
        return np.where(apart, smaller, (after - before) / (left + right)).T


def fit(
    parameters: Sequence[Parameter], residuals: Residuals, effort: Effort | None = None, told: Told = lambda *_: None
) -> Fit:
    """Return the parameters that make the sum of squares least, with what the data say of each.

    Parameters
    ----------
    parameters : what is looked for
    residuals : from points (m, n) to residuals (m, k), each divided by the uncertainty of its datum
    effort : how hard to search
    told : told of the stage and the least sum of squares so far

    Notes
    -----
    The covariance is that of the linearised problem, scale (J^T J)^-1; directions that the data leave open
    (`UNDETERMINED`) make the parameters in them undetermined, and are not inverted.
    """
    effort = effort or Effort()
    space = _Space(parameters, residuals, told)
    free = np.arange(len(space.parameters))
    best = _refined(space, _searched(space, effort), free)
    residual = space.one(best)
    chi2 = float(residual @ residual)
    scale = max(1.0, chi2 / max(residual.size - free.size, 1))
    covariance, determined = _covariance(space.slopes(best, free), scale)
    space.stage = "profiles"
    intervals = [_interval(space, best, covariance, int(i), chi2, scale) if effort.profile else None for i in free]
    estimates = [
        _estimate(p, float(best[i]), float(covariance[i, i]), bool(determined[i]), intervals[i])
        for i, p in enumerate(space.parameters)
    ]
    return Fit(estimates, _correlation(covariance, determined), residual, chi2, scale, space.evaluations)


def _searched(space: _Space, effort: Effort) -> np.ndarray:
    """Return the best point of differential evolution."""
    space.stage = "search"
    found: OptimizeResult = differential_evolution(
        lambda x: np.sum(space(x.T) ** 2, axis=1),
        [(0.0, 1.0)] * len(space.parameters),
        popsize=effort.population,
        maxiter=effort.generations,
        rng=effort.seed,
        polish=False,
        vectorized=True,
        updating="deferred",
        init="sobol",
    )
    return np.asarray(found.x)


def _refined(space: _Space, start: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the point that least squares comes to from `start`, moving the parameters `free` alone."""
    if not free.size:
        return start
    space.stage = "refinement"

    def whole(x: np.ndarray) -> np.ndarray:
        point = start.copy()
        point[free] = x
        return point

    inside = np.clip(start[free], 1e-6, 1.0 - 1e-6)
    found = least_squares(
        lambda x: space.one(whole(x)),
        inside,
        lambda x: space.slopes(whole(x), free),  # type: ignore[arg-type]
        bounds=(0.0, 1.0),
        xtol=1e-4,
        ftol=1e-4,
        max_nfev=15,
    )
    return whole(found.x)


def _covariance(slopes: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance in shares (n, n), and which parameters the data determine (n,)."""
    _, size, directions = np.linalg.svd(slopes, full_matrices=False)
    kept = size > UNDETERMINED * max(float(size[0]), np.finfo(float).tiny)
    lost = directions[~kept]
    determined = np.all(np.abs(lost) < 0.1, axis=0) & (np.linalg.norm(slopes, axis=0) > 0.0)
    inverse = directions[kept].T @ np.diag(size[kept] ** -2.0) @ directions[kept]
    return scale * inverse, determined


def _correlation(covariance: np.ndarray, determined: np.ndarray) -> np.ndarray:
    deviation = np.sqrt(np.where(determined, np.diag(covariance), np.nan))
    return covariance / np.outer(deviation, deviation)


def _interval(
    space: _Space, best: np.ndarray, covariance: np.ndarray, index: int, chi2: float, scale: float
) -> tuple[float, float]:
    """Return the ends, as values, of where chi2 minimised over the others stays within `scale` of its least."""
    others = np.delete(np.arange(best.size), index)
    first = float(np.clip(np.sqrt(covariance[index, index]), 1e-3, 0.25))
    ends = [_end(space, best, index, others, chi2, scale, sign * first) for sign in (-1.0, 1.0)]
    low, high = (float(space.parameters[index].value(np.asarray(end))) for end in ends)
    return low, high


def _end(
    space: _Space, best: np.ndarray, index: int, others: np.ndarray, chi2: float, scale: float, step: float
) -> float:
    """Return the share at which the profile rises by `scale`, going in the direction of `step`, or the bound.

    The profile is about a parabola, so that each point foretells where the end is.
    """
    point, at = best, float(best[index])
    for _ in range(PROFILE_ROUNDS):
        at = float(np.clip(best[index] + step, 0.0, 1.0))
        point = point.copy()
        point[index] = at
        point = _refined(space, point, others)
        residual = space.one(point)
        by = float(np.sqrt(scale / max(float(residual @ residual) - chi2, 1e-3 * scale)))
        if at in (0.0, 1.0) and by >= 1.0:
            return at
        step = (at - best[index]) * float(np.clip(by, 0.25, 4.0))
        if abs(by - 1.0) < NEAR_END:
            break
    return float(np.clip(best[index] + step, 0.0, 1.0))


def _estimate(
    parameter: Parameter, share: float, variance: float, determined: bool, interval: tuple[float, float] | None
) -> Estimate:
    value = float(parameter.value(np.asarray(share)))
    deviation = parameter.slope(share) * float(np.sqrt(variance)) if determined else float("inf")
    bound = "low" if share < AT_BOUND else "high" if share > 1.0 - AT_BOUND else ""
    return Estimate(parameter.name, value, deviation, interval, bound, determined)
