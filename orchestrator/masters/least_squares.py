"""Least squares with filtering, and the quasi-Newton model built on it."""

from __future__ import annotations

from collections import deque

import numpy as np

from fmus.jit import kernel
from orchestrator.masters.implicit import Accelerator


@kernel
def solve_filtered(V, b, threshold, Q, R, kept, c):
    """Solve min |V[:, kept] c - b|; a column that adds less than `threshold` of its norm to those before it is dropped.

    Gram-Schmidt, twice (which is enough to be orthogonal to round-off), then back substitution.

    Parameters
    ----------
    V : (m, n), one column a row, the most trusted first
    b : (n,)
    Q, R : (m, n), (m, m) workspaces
    kept : (m,) out, numbers of the columns kept
    c : (m,) out, their coefficients

    Returns
    -------
    int
        number of columns kept
    """
    m, n = V.shape
    k = 0
    for j in range(m):
        if k == n:
            break
        norm = 0.0
        for i in range(n):
            Q[k, i] = V[j, i]
            norm += V[j, i] * V[j, i]
        for i in range(k):
            R[i, k] = 0.0
        for _ in range(2):
            for l in range(k):
                h = 0.0
                for i in range(n):
                    h += Q[l, i] * Q[k, i]
                R[l, k] += h
                for i in range(n):
                    Q[k, i] -= h * Q[l, i]
        rest = 0.0
        for i in range(n):
            rest += Q[k, i] * Q[k, i]
        if rest > threshold * threshold * norm:
            R[k, k] = np.sqrt(rest)
            for i in range(n):
                Q[k, i] /= R[k, k]
            kept[k] = j
            k += 1
    for l in range(k - 1, -1, -1):
        c[l] = 0.0
        for i in range(n):
            c[l] += Q[l, i] * b[i]
        for j in range(l + 1, k):
            c[l] -= R[l, j] * c[j]
        c[l] /= R[l, l]
    return k


class LeastSquares(Accelerator):
    """Quasi-Newton with an inverse Jacobian from least squares, columns of earlier steps reused (IQN-ILS).

    Parameters
    ----------
    n : number of unknowns
    reuse : steps whose columns are kept
    threshold : relative size of what a column must add
    relaxation : as long as no column is known
    """

    def __init__(self, n: int, reuse: int, threshold: float, relaxation: float):
        self.reuse, self.threshold, self.relaxation = reuse, threshold, relaxation
        self.past: deque[tuple[float, np.ndarray, np.ndarray]] = deque(maxlen=max(reuse, 1))
        self.Q, self.R = np.zeros((n, n)), np.zeros((n, n))
        self.kept, self.c = np.zeros(n), np.zeros(n)
        self.n, self.H = n, 0.0
        self.begin(0.0, np.ones(n))

    def reset(self) -> None:
        """Forget all columns."""
        self.past.clear()

    def begin(self, H: float, scale: np.ndarray) -> None:
        """Start a step; columns of steps of another length do not hold and rest."""
        self.H, self.scale = H, scale
        self.V, self.W = np.empty((0, self.n)), np.empty((0, self.n))
        self.old = [(V, W) for length, V, W in self.past if length == H]
        self.last: tuple[np.ndarray, np.ndarray] | None = None
        self.columns = 0

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the next iterate; x, r (n,) are not scaled."""
        s = x + r
        if self.last is not None:
            self.V = np.vstack((r - self.last[0], self.V))
            self.W = np.vstack((s - self.last[1], self.W))
        self.last = (r, s)
        V = np.vstack((self.V, *(V for V, _ in self.old)))
        if not len(V):
            return x + self.relaxation * r
        W = np.vstack((self.W, *(W for _, W in self.old)))
        k = self._solve(V / self.scale, -r / self.scale)
        return s + self.c[:k] @ W[self.kept[:k].astype(np.intp)]

    def _solve(self, V: np.ndarray, b: np.ndarray) -> int:
        m = len(V)
        if m > len(self.R):
            self.Q, self.R = np.zeros((m, self.n)), np.zeros((m, m))
            self.kept, self.c = np.zeros(m), np.zeros(m)
        self.columns = solve_filtered(V, b, self.threshold, self.Q, self.R, self.kept, self.c)
        return self.columns

    def accept(self) -> None:
        """Keep the columns of the step."""
        if self.reuse and len(self.V):
            self.past.appendleft((self.H, self.V, self.W))

    def reject(self) -> None:
        """Forget everything: what did not converge was misled by it."""
        self.past.clear()
