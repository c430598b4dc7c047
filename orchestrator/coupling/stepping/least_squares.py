"""Least squares with filtering, and the quasi-Newton model built on it."""

from __future__ import annotations

from collections import deque

import numpy as np

from orchestrator.coupling.kernel import kernel
from orchestrator.coupling.stepping.accelerator import Accelerator


@kernel
def quasi_newton(V, W, first, end, weights, r, threshold, Q, R, kept, c, x):
    """Add W c to `x`, with c from min |V c + r|; a column that adds less than `threshold` of its norm is dropped.

    Gram-Schmidt, twice (which is enough to be orthogonal to round-off), then back substitution.

    Parameters
    ----------
    V, W : (m, n), one column a row, the most trusted first; those from `first` to `end` are used
    weights : (n,) of the components in the norm
    r : (n,)
    Q, R : (m, n), (m, m) workspaces
    kept, c : (m,) out, numbers of the columns kept and their coefficients
    x : (n,) changed

    Returns
    -------
    int
        number of columns kept
    """
    n = r.size
    k = 0
    for j in range(first, end):
        if k == n:
            break
        norm = 0.0
        for i in range(n):
            Q[k, i] = V[j, i] * weights[i]
            norm += Q[k, i] * Q[k, i]
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
            c[l] -= Q[l, i] * r[i] * weights[i]
        for j in range(l + 1, k):
            c[l] -= R[l, j] * c[j]
        c[l] /= R[l, l]
        for i in range(n):
            x[i] += c[l] * W[kept[l], i]
    return k


class LeastSquares(Accelerator):
    """Quasi-Newton with an inverse Jacobian from least squares, columns of earlier steps reused (IQN-ILS).

    Parameters
    ----------
    n : number of unknowns
    reuse : steps whose columns are kept
    threshold : relative size of what a column must add
    relaxation : as long as no column is known
    mixing : beta of Anderson's method; 1: IQN-ILS
    depth : columns of the present step that are used at most
    """

    def __init__(
        self,
        n: int,
        reuse: int,
        threshold: float,
        relaxation: float,
        *,
        mixing: float = 1.0,
        depth: int = 50,
    ):
        self.reuse, self.threshold, self.relaxation = reuse, threshold, relaxation
        self.mixing, self.depth = mixing, depth
        self.past: deque[tuple[float, np.ndarray, np.ndarray]] = deque(maxlen=max(reuse, 1))
        self.solved: list[
            tuple[np.ndarray, np.ndarray]
        ] = []  # columns of earlier solves of this step, the newest first
        self.n, self.H = n, 0.0
        self._allocate(2 * depth)
        self.begin(0.0, np.ones(n))

    def _allocate(self, m: int) -> None:
        self.V, self.W, self.Q = (np.zeros((m, self.n)) for _ in range(3))
        self.R, self.kept, self.c = np.zeros((m, m)), np.zeros(m, dtype=np.int64), np.zeros(m)

    def reset(self) -> None:
        """Forget all columns."""
        self.past.clear()
        self.solved.clear()

    def begin(self, H: float, scale: np.ndarray) -> None:
        """Start a step, or another solve of it: columns of earlier ones, of the same length, come after its own."""
        self.H, self.weights = H, 1.0 / scale
        self.new, self.last, self.columns, self.end = 0, None, 0, -1

    def _gather(self) -> None:
        """Put the columns of earlier solves where they are used: rows depth - new … depth are those of this one, newest first;
        the old ones follow."""
        old = [*self.solved, *((V, W) for length, V, W in self.past if length == self.H)]
        self.end = self.depth + sum(len(V) for V, _ in old)
        if self.end > len(self.V):
            self._allocate(2 * self.end)
        if old:
            rows = slice(self.depth, self.end)
            np.concatenate([V for V, _ in old], out=self.V[rows])
            np.concatenate([W for _, W in old], out=self.W[rows])

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the next iterate from x (n,) and its residual r (n,)."""
        mixed = x + self.mixing * r
        if self.end < 0:  # a solve that ends at once needs none
            self._gather()
        if self.last is not None and self.new < self.depth:
            self.new += 1
            row = self.depth - self.new
            self.V[row] = r - self.last[0]
            self.W[row] = mixed - self.last[1]
        self.last = (r, mixed)
        first = self.depth - self.new
        if first == self.end:
            return x + self.relaxation * r
        proposed = mixed.copy()
        self.columns = quasi_newton(
            self.V,
            self.W,
            first,
            self.end,
            self.weights,
            r,
            self.threshold,
            self.Q,
            self.R,
            self.kept,
            self.c,
            proposed,
        )
        return proposed

    def accept(self) -> None:
        """Keep the columns of the step, those of all its solves; they count as one step."""
        self.conclude()
        if self.reuse and self.solved:
            V, W = (np.concatenate(parts) for parts in zip(*self.solved, strict=True))
            self.past.appendleft((self.H, V, W))
        self.solved.clear()

    def conclude(self) -> None:
        """End one of several solves that the step takes: its columns serve the next one."""
        if self.new:
            rows = slice(self.depth - self.new, self.depth)
            self.solved.insert(0, (self.V[rows].copy(), self.W[rows].copy()))
            self.new = 0

    def reject(self) -> None:
        """Forget everything: what did not converge was misled by it."""
        self.reset()
