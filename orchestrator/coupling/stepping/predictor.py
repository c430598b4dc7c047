"""Prediction of the interface unknowns of the next step from those of the last ones."""

from __future__ import annotations

from collections import deque

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
        self.predictions: list[np.ndarray] = []
        self.errors = np.zeros(HIGHEST + 1)

    def save(self) -> tuple[list, list, np.ndarray]:
        """Return what `restore` needs."""
        return list(self.points), self.predictions, self.errors.copy()

    def restore(self, saved: tuple[list, list, np.ndarray]) -> None:
        """Go back."""
        points, self.predictions, errors = saved
        self.points = deque(points, maxlen=HIGHEST + 1)
        self.errors = errors.copy()

    def append(self, time: float, x: np.ndarray, scale: np.ndarray) -> None:
        """Remember the converged unknowns `x` (n,), of magnitudes `scale` (n,), of the step around `time`."""
        for k, guess in enumerate(self.predictions):
            error = (guess - x) / scale
            self.errors[k] = FORGET * self.errors[k] + np.sqrt(error @ error)
        self.points.appendleft((time, x.copy()))

    def predict(self, time: float, fallback: np.ndarray) -> np.ndarray:
        """Return the unknowns expected in the step around `time`; `fallback` while nothing is known."""
        if not self.points:
            return fallback.copy()
        nodes = [(t - time, x) for t, x in self.points]
        self.predictions = [_extrapolate(nodes[: k + 1]) for k in range(len(nodes))]
        if self.order >= 0:
            return self.predictions[min(self.order, len(nodes) - 1)]
        return self.predictions[int(np.argmin(self.errors[: max(1, len(nodes) - 1)]))]


def _extrapolate(nodes: list[tuple[float, np.ndarray]]) -> np.ndarray:
    """Return the value at 0 of the polynomial through `nodes` (Lagrange)."""
    total = np.zeros_like(nodes[0][1])
    for i, (s, x) in enumerate(nodes):
        weight = 1.0
        for j, (other, _) in enumerate(nodes):
            if j != i:
                weight *= other / (other - s)
        total += weight * x
    return total
