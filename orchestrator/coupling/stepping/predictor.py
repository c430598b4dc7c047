"""Prediction of the interface unknowns of the next step from those of the last ones."""

from __future__ import annotations

from collections import deque
from math import prod

import numpy as np

HIGHEST = 3
FORGET = 0.8  # weight of the past in the record of how well each order did


class Predictor:
    """Polynomial extrapolation through the last converged unknowns, of a fixed order or the order that did
    best lately.

    Parameters
    ----------
    order : 0 … 3, or -1: chosen in every step by the errors each order would have made
    """

    def __init__(self, order: int = -1):
        if not -1 <= order <= HIGHEST:
            raise ValueError(f"predictor {order}: choose 0 … {HIGHEST}, or -1 for the best")
        self.order = order
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.points: deque[tuple[float, np.ndarray]] = deque(maxlen=HIGHEST + 1)
        self.predictions = np.zeros((0, 0))  # (orders, n), of the step that is being made
        self.errors = np.zeros(HIGHEST + 1)

    def save(self) -> tuple[list, np.ndarray, np.ndarray]:
        """Return what `restore` needs."""
        return list(self.points), self.predictions, self.errors.copy()

    def restore(self, saved: tuple[list, np.ndarray, np.ndarray]) -> None:
        """Go back."""
        points, self.predictions, errors = saved
        self.points = deque(points, maxlen=HIGHEST + 1)
        self.errors = errors.copy()

    def append(self, time: float, x: np.ndarray, scale: np.ndarray) -> None:
        """Remember the converged unknowns `x` (n,), of magnitudes `scale` (n,), of the step around `time`."""
        if len(self.predictions):
            missed = (self.predictions - x) / scale
            k = len(missed)
            self.errors[:k] = FORGET * self.errors[:k] + np.sqrt(np.sum(missed * missed, axis=1))
        self.points.appendleft((time, x.copy()))

    def predict(self, time: float, fallback: np.ndarray) -> np.ndarray:
        """Return the unknowns expected in the step around `time`; `fallback` while nothing is known."""
        if not self.points:
            return fallback.copy()
        weights = _weights([t - time for t, _ in self.points])
        self.predictions = weights @ np.array([x for _, x in self.points])
        if self.order >= 0:
            return self.predictions[min(self.order, len(weights) - 1)]
        return self.predictions[int(np.argmin(self.errors[: max(1, len(weights) - 1)]))]


def _weights(nodes: list[float]) -> np.ndarray:
    """Return what the values at the `nodes` (k,) weigh in the value at 0 of the polynomial through the first 1 … k (Lagrange),
    a row each, (k, k)."""
    weights = np.zeros((len(nodes), len(nodes)))
    for order in range(len(nodes)):
        for i, s in enumerate(nodes[: order + 1]):
            others = [other for j, other in enumerate(nodes[: order + 1]) if j != i]
            weights[order, i] = prod(other / (other - s) for other in others)
    return weights
