"""What a landing's margins hang on: indices of Sobol' of every parameter that is drawn, with an interval.

The *first* index of a parameter is the share of the variance of a quantity that would vanish if that parameter were known;
the *total* one the share that would remain if all others were. They differ where parameters act together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import sobol_indices

from orchestrator.studies.sweep.design import A, B, bare, groups
from orchestrator.studies.sweep.outcome import Outcome, measured
from orchestrator.studies.sweep.study import Study

RESAMPLES = 999
SEED = 1
"""Of the resampling, so that the same runs give the same intervals."""
CONFIDENCE = 0.95
MOST_VALUES = 2_000_000
"""At a time, for the sake of memory."""
LEAST_SPREAD = 1e-9
"""Of a quantity, by its size: what varies less does not vary, it is rounded."""


@dataclass(frozen=True)
class Index:
    """A share of the variance, and the interval that covers it with a confidence of 95 %."""

    estimate: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Indices:
    """Of one parameter."""

    first: Index
    total: Index


@dataclass(frozen=True)
class Sensitivity:
    """What quantities hang on, for one combination of what varies.

    Attributes
    ----------
    of : quantity (a column of the table) → parameter → indices
    unknown : quantity → why there are none
    """

    where: Mapping[str, Any]
    of: Mapping[str, Mapping[str, Indices]]
    unknown: Mapping[str, str]

    def content(self) -> dict[str, Any]:
        """Return what ``study.json`` says."""
        return asdict(self)


def sensitivities(study: Study, outcomes: Sequence[Outcome]) -> list[Sensitivity]:
    """Return what margins and extremes hang on, for each combination whose runs are all there."""
    if study.sensitivity is None or study.sample is None:
        return []
    names, found = list(study.sample.distributions), list[Sensitivity]()
    for i, where in enumerate(groups(study)):
        mine = [outcome for outcome in outcomes if outcome.row.group == i and outcome.row.part]
        if len(mine) == study.sensitivity.count * (len(names) + 2):
            found.append(_sensitivity(study, {key: bare(value) for key, value in where.items()}, names, mine))
    return found


def _sensitivity(
    study: Study, where: Mapping[str, Any], names: Sequence[str], outcomes: Sequence[Outcome]
) -> Sensitivity:
    parts: dict[str, list[dict[str, Any]]] = {}
    for outcome in sorted(outcomes, key=lambda outcome: outcome.row.number):
        parts.setdefault(outcome.row.part, []).append(measured(study, outcome))
    values, unknown = dict[str, dict[str, np.ndarray]](), dict[str, str]()
    for quantity in _quantities(parts):
        mine = {part: _numbers(rows, quantity) for part, rows in parts.items()}
        if reason := _not_known(np.concatenate(list(mine.values()))):
            unknown[quantity] = reason
        else:
            values[quantity] = mine
    found = indices(values, names)
    return Sensitivity(where, found, unknown)


def _quantities(parts: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """Return the columns that say how a landing went and have a value somewhere: margins, then extremes of signals."""
    rows = [row for some in parts.values() for row in some]
    known = dict.fromkeys(name for row in rows for name, value in row.items() if value is not None)
    margins = [name for name in known if name == "least_margin" or name.startswith("margin.")]
    return margins + [name for name in known if name.endswith((".min", ".max"))]


def _numbers(rows: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], float)


def _not_known(values: np.ndarray) -> str:
    """Return why a quantity has no indices; nothing where it has."""
    missing = int(np.sum(~np.isfinite(values)))
    if missing:
        return f"not known in {missing} of {len(values)} runs"
    return "does not vary" if np.ptp(values) <= LEAST_SPREAD * np.max(np.abs(values)) else ""


def indices(values: Mapping[str, Mapping[str, np.ndarray]], names: Sequence[str]) -> dict[str, dict[str, Indices]]:
    """Return the indices of every parameter in `names` by quantity.

    Parameters
    ----------
    values : quantity → part of the points → its values (n,)
    """
    if not values:
        return {}
    f_a, f_b = (np.array([one[part] for one in values.values()]) for part in (A, B))
    points = Points(f_a, f_b, np.array([[one[name] for one in values.values()] for name in names]))
    estimate = points.indices(np.arange(f_a.shape[1])[None])[0]
    low, high = points.interval()
    low, high = np.minimum(low, estimate), np.maximum(high, estimate)
    return {
        quantity: {
            name: Indices(
                *(Index(float(estimate[k, i, j]), (float(low[k, i, j]), float(high[k, i, j]))) for k in (0, 1))
            )
            for j, name in enumerate(names)
        }
        for i, quantity in enumerate(values)
    }


@dataclass(frozen=True)
class Points:
    """Values of s quantities at the points.

    Attributes
    ----------
    f_a, f_b : (s, n) in the parts A and B
    f_ab : (d, s, n) in A with one parameter as in B
    """

    f_a: np.ndarray
    f_b: np.ndarray
    f_ab: np.ndarray

    def indices(self, chosen: np.ndarray) -> np.ndarray:
        """Return first and total indices (r, 2, s, d) of r choices (r, n) of the points, each as quantities of its own."""
        r, n = chosen.shape
        d, s, _ = self.f_ab.shape
        one, other, mixed = (np.moveaxis(f[..., chosen], -2, -3) for f in (self.f_a, self.f_b, self.f_ab))
        parts = {"f_A": one.reshape(r * s, n), "f_B": other.reshape(r * s, n), "f_AB": mixed.reshape(d, r * s, n)}
        found = sobol_indices(func=parts, n=n)
        both = np.reshape([found.first_order, found.total_order], (2, r, s, d))
        return np.moveaxis(both, 1, 0)

    def interval(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends (2, s, d) of the interval: percentiles over points drawn with repetition (bootstrap)."""
        n, generator = self.f_a.shape[1], np.random.default_rng(SEED)
        drawn = generator.integers(n, size=(RESAMPLES, n))
        size = max(1, MOST_VALUES // self.f_ab.size)
        found = np.concatenate([self.indices(drawn[i : i + size]) for i in range(0, RESAMPLES, size)])
        tail = 0.5 * (1.0 - CONFIDENCE)
        return np.quantile(found, tail, axis=0), np.quantile(found, 1.0 - tail, axis=0)
