"""Algebraic loops at the start: inputs that depend on themselves without a step, solved by Newton's method."""

from __future__ import annotations

import contextlib

import numpy as np

from orchestrator.coupling.fmu.derivatives import Partials
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.graph.arrays import Arrays, Node

ITERATIONS, TOLERANCE, DIFFERENCE = 20, 1e-11, 1e-6


class AlgebraicLoop:
    """The inputs in algebraic loops of a graph whose FMUs are being initialised.

    Parameters
    ----------
    places : (m,) int, those inputs in `Graph.u`
    """

    def __init__(self, arrays: Arrays, places: np.ndarray):
        self.arrays, self.places = arrays, places

    def solve(self, start: float) -> None:
        """Solve for the inputs, with derivatives where FMUs give them; `FmuError` if there is no solution."""
        arrays = self.arrays
        z, y = arrays.gathered(self.places), arrays.y.copy()
        own = [node for node in arrays.nodes if node.fmu.capabilities.directional_derivatives]
        # derivatives that are wrong only cost iterations; if too many, differences have the last word
        with contextlib.suppress(FmuError, np.linalg.LinAlgError):
            if own and self._newton(z, own):
                return
        arrays.y[:] = y
        if self._newton(z, []):
            return
        names = ", ".join(arrays.input_names[i] for i in self.places[:3])
        message = f"the algebraic loop through {names} … has no solution near the start values; change them"
        raise FmuError(arrays.nodes[0].name, start, 2, message)

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Set the inputs to `z` (m,); return how far the outputs contradict them."""
        arrays = self.arrays
        arrays.gather()
        arrays.u[self.places] = z
        for node in arrays.nodes:
            node.inputs.set()
        for node in arrays.nodes:
            node.outputs.get_finite()
        return arrays.gathered(self.places) - z

    def _newton(self, z: np.ndarray, own: list[Node]) -> bool:
        """Newton's method from `z` with the derivatives of `own`, else differences; return whether it converged."""
        for _ in range(ITERATIONS):
            r = self.residual(z)
            if np.max(np.abs(r) / (np.abs(z) + 1.0)) <= TOLERANCE:
                self.arrays.gather()
                return True
            z = z - np.linalg.lstsq(self._jacobian(z, r, own), r, rcond=None)[0]
        return False

    def _jacobian(self, z: np.ndarray, r: np.ndarray, own: list[Node]) -> np.ndarray:
        """Return d(residual)/dz, (m, m), at `z` with residual `r`."""
        jacobian = np.full((z.size, z.size), np.nan)
        for node in own:
            self._write_own(node, jacobian)
        for j in np.flatnonzero(np.isnan(jacobian[0])):
            shifted = z.copy()
            shifted[j] += DIFFERENCE * (1.0 + abs(z[j]))
            jacobian[:, j] = (self.residual(shifted) - r) / (shifted[j] - z[j])
        return jacobian

    def _write_own(self, node: Node, jacobian: np.ndarray) -> None:
        """Write the columns of the Jacobian that belong to inputs of `node`, if its FMU knows them."""
        links = [self.arrays.links[place] for place in self.places]
        mine = [j for j, link in enumerate(links) if link.target[0] == node.name]
        rows = [i for i, link in enumerate(links) if link.source[0] == node.name]
        knowns, unknowns = [links[j].target[1] for j in mine], [links[i].source[1] for i in rows]
        matrix = Partials(node.fmu, unknowns, knowns)() if mine else None
        if matrix is None:
            return
        jacobian[:, mine] = -np.eye(len(links))[:, mine]
        jacobian[np.ix_(rows, mine)] += np.array([[links[i].gain] for i in rows]) * matrix
