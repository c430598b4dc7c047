"""A beam of cable elements with supports of its own, assembled densely from the element kernels."""

from __future__ import annotations

import numpy as np

from fmus.cable import element


class FreeBeam:
    """A straight beam along y of equal elements; nothing is held.

    Parameters
    ----------
    length, ea, ei, damping : m, N, N m², s
    n_elements : their number
    """

    def __init__(self, length: float, ea: float, ei: float, n_elements: int, damping: float = 0.0):
        self.l, self.ea, self.ei, self.damping, self.n_elements = length / n_elements, ea, ei, damping, n_elements
        self.n = 6 * (n_elements + 1)

    def straight(self) -> np.ndarray:
        """Return the coordinates (n,) at rest."""
        q = np.zeros(self.n)
        q[1::6], q[4::6] = self.l * np.arange(self.n_elements + 1), 1.0
        return q

    def force(self, q: np.ndarray, v: np.ndarray | None = None) -> tuple[np.ndarray, float, float]:
        """Return the internal force (n,), the elastic energy and the dissipated power."""
        force, out = np.zeros(self.n), np.zeros(3)
        v = np.zeros(self.n) if v is None else v
        for e in range(self.n_elements):
            element.internal_force(q, v, 6 * e, self.l, self.ea, self.ei, self.damping, force, out)
        return force, float(out[0]), float(out[1])

    def tangent(self, q: np.ndarray, v: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return dQ/dq and dQ/dq' (n, n)."""
        full = np.zeros((2, self.n, self.n))
        K, C, work = np.zeros((12, 12)), np.zeros((12, 12)), np.zeros((7, 4))
        v = np.zeros(self.n) if v is None else v
        for e in range(self.n_elements):
            element.tangent(q, v, 6 * e, self.l, self.ea, self.ei, self.damping, K, C, work)
            at = slice(6 * e, 6 * e + 12)
            full[0, at, at] += K
            full[1, at, at] += C
        return full[0], full[1]

    def bend(self, tip_force: np.ndarray, tip_moment: float, steps: int = 20) -> np.ndarray:
        """Return the coordinates (n,) of a cantilever, clamped at the left with its strain free, loaded at its tip.

        The moment acts about x; its generalised force on g = r_x is M × g/|g|². Newton's method in load steps.
        """
        free = np.r_[4, 6 : self.n]
        q, axis = self.straight(), np.array([tip_moment, 0.0, 0.0])
        for share in np.arange(1, steps + 1) / steps:
            for _ in range(60):
                g = q[-3:]
                square = g @ g
                external = np.zeros(self.n)
                external[-6:-3], external[-3:] = share * tip_force, share * np.cross(axis, g) / square
                cross = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -tip_moment], [0.0, tip_moment, 0.0]])
                follower = share * (cross / square - 2.0 * np.outer(np.cross(axis, g), g) / square**2)
                matrix = self.tangent(q)[0]
                matrix[-3:, -3:] -= follower
                step = np.linalg.solve(matrix[np.ix_(free, free)], (external - self.force(q)[0])[free])
                q[free] += step
                if np.abs(step).max() < 1e-12:
                    break
            else:
                raise RuntimeError("cantilever: Newton's method does not converge; take more load steps")
        return q
