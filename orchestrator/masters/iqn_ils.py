"""IQN-ILS: interface quasi-Newton with an inverse Jacobian from least squares."""

from __future__ import annotations

from collections import deque
from typing import Any, ClassVar

import numpy as np

from orchestrator.graph import Graph
from orchestrator.masters.implicit import Accelerator, Implicit


class IqnIls(Implicit):
    r"""Implicit; the inverse interface Jacobian is built by least squares from the iterations, also of
    earlier steps.

    With differences to the iteration before, V = [Δr …], W = [ΔS …], newest first:
    x ← x + W c + r, c = argmin ‖V c + r‖, solved by QR; a column whose diagonal entry is below `filter` of
    its norm is dropped, older ones first.

    Order: that of the exchange (2 with values held at the mean of both ends, 4 with `waveform`). Stability:
    that of the exchange. When: the default for stiff interfaces between FMUs that can be rolled back, as
    many unknowns as may be. Reference: Degroote, Bathe & Vierendeels, Computers & Structures 87 (2009)
    793-801; filtering: Haelterman et al., Computers & Structures 171 (2016) 9-17.

    Parameters
    ----------
    reuse : macro steps whose columns are kept
    filter : relative size of the diagonal of R below which a column is dropped
    relaxation : of the very first iteration, when no column is known
    options : those of `Implicit`
    """

    TITLE: ClassVar[str] = "implicit, interface quasi-Newton (least squares), columns reused"
    NAME: ClassVar[str] = "iqn_ils"

    def __init__(
        self, graph: Graph, *, reuse: int = 8, filter: float = 1e-6, relaxation: float = 0.1, **options: Any
    ):
        super().__init__(graph, LeastSquares(reuse, filter, relaxation), **options)


class LeastSquares(Accelerator):
    """The quasi-Newton model of `IqnIls`."""

    def __init__(self, reuse: int, filter: float, relaxation: float):
        self.filter, self.relaxation = filter, relaxation
        self.past: deque[tuple[float, list[tuple[np.ndarray, np.ndarray]]]] = deque(maxlen=max(reuse, 1))
        self.reuse = reuse
        self.reset()

    def reset(self) -> None:
        """Forget all columns."""
        self.past.clear()
        self.new: list[tuple[np.ndarray, np.ndarray]] = []

    def begin(self, H: float, scale: np.ndarray) -> None:
        """Start a step; columns of steps of other length are of no use."""
        self.H, self.scale = H, scale
        self.new, self.last = [], None
        self.columns = 0

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the quasi-Newton iterate."""
        s = x + r
        x_, r_, s_ = x * self.scale, r * self.scale, s * self.scale
        if self.last is not None:
            self.new.insert(0, (r_ - self.last[0], s_ - self.last[1]))
        self.last = (r_, s_)
        old = [pair for H, pairs in self.past if H == self.H for pair in pairs]
        pairs = (self.new + old)[: x.size]
        if not pairs:
            return x + self.relaxation * r
        V = np.array([p[0] for p in pairs]).T / self.scale[:, None]
        W = np.array([p[1] for p in pairs]).T / self.scale[:, None]
        c, kept = solve_filtered(V, -r, self.filter)
        self.columns = kept.size
        del x_
        return s + W[:, kept] @ c

    def accept(self) -> None:
        """Keep the columns of the step."""
        if self.reuse and self.new:
            self.past.appendleft((self.H, self.new))

    def reject(self) -> None:
        """Forget everything: what did not converge was misled by it."""
        self.past.clear()


def solve_filtered(V: np.ndarray, b: np.ndarray, filter: float) -> tuple[np.ndarray, np.ndarray]:
    """Solve min ‖V[:, kept] c - b‖; columns that depend on those before them are dropped.

    Parameters
    ----------
    V : (n, m), newest column first
    b : (n,)
    filter : relative size of what a column adds, below which it is dropped

    Returns
    -------
    c : (k,)
    kept : (k,) int
    """
    Q, R, kept = np.empty_like(V), np.zeros((V.shape[1],) * 2), []
    for j in range(V.shape[1]):
        v, n = V[:, j].copy(), len(kept)
        norm = np.sqrt(v @ v)
        for _ in range(2):  # twice is enough to be orthogonal to round-off
            h = Q[:, :n].T @ v
            v -= Q[:, :n] @ h
            R[:n, n] += h
        rest = np.sqrt(v @ v)
        if rest > filter * norm and norm > 0.0 and n < V.shape[0]:
            Q[:, n], R[n, n] = v / rest, rest
            kept.append(j)
        else:
            R[:n, n] = 0.0
    n = len(kept)
    c = np.linalg.solve(R[:n, :n], Q[:, :n].T @ b) if n else np.zeros(0)
    return c, np.array(kept, dtype=np.intp)
