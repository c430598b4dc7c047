"""The Jacobian of a component's step from the derivatives that its FMU gives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestrator.coupling.exchange import vectors
from orchestrator.coupling.fmu.derivatives import Partials, states
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.stepping.interpolation import Between

MOST_STATES = 200  # beyond that the matrix exponential costs more than the steps it saves
ROUND_OFF = 1e-12  # relative difference of outputs that says nothing
TINY = np.finfo(float).tiny  # so that nothing may be foretold where there is nothing


class OwnDerivatives:
    """d(outputs at the end of a step)/d(inputs) of one component, asked from its FMU after the step.

    Two readings of the standard are tried. FMI 2.0 (4.1.2) lists the call among the functions of f_doStep, so some FMUs
    may answer with the response over the step just made: J = P M, with P = dy/du as it comes, M how the inputs of the step
    follow the unknowns. By the description of the model structure (and in FMI 3.0) the derivatives are those of
    y = g(x, u), x' = f(x, u) at the communication point, zero where there is no feedthrough; if the FMU shows its
    states, the response to inputs that are held follows from the linear system,

        J = C Φ B M + D N,   Φ = ∫₀ᴴ exp(A s) ds,   A = ∂f/∂x, B = ∂f/∂u, C = ∂g/∂x, D = ∂g/∂u,

    with N the inputs at the end of the step. Which of the two it is, a single step with all unknowns changed at once (up or
    down by chance) tells: the better one is taken. If neither foretells it, the FMU is not asked again.

    Parameters
    ----------
    between : how the master interpolates inputs inside a step
    """

    def __init__(self, graph: Graph, between: Between, node: Node):
        self.graph, self.between, self.node = graph, between, node
        self.usable = node.fmu.capabilities.directional_derivatives
        self.vector = vectors(list(node.outputs.names))
        self.chance = np.random.default_rng(0)
        if not self.usable:
            return
        x, rates = states(node.fmu)
        if not len(x) == len(rates) <= MOST_STATES:
            x, rates = [], []
        inputs = [*node.inputs.names, *node.rates.names]
        self.partials = Partials(node.fmu, [*node.outputs.names, *rates], [*inputs, *x])
        self.n_y, self.n_u = len(node.outputs.names), len(inputs)

    def jacobian(
        self, H: float, steps: np.ndarray, respond: Callable[[np.ndarray], np.ndarray], accuracy: float
    ) -> np.ndarray | None:
        """Return the Jacobian (n_outputs, m) at the step of length `H` that has just been made, or None.

        Parameters
        ----------
        steps : (m,) changes of the unknowns that are small, but not lost in round-off
        respond : makes the step anew with the unknowns changed; returns the outputs, (n_outputs,)
        accuracy : largest error of the foretold change, relative to the change (x, y, z of a vector together)
        """
        if not self.usable:
            return None
        base = self.node.outputs.values.copy()
        candidates = self._candidates(H)
        change = steps * self.chance.choice([-1.0, 1.0], steps.size)
        seen = respond(change) - base if candidates else base
        misses = [self._miss(J @ change, seen, base, accuracy) for J in candidates]
        self.usable = min(misses, default=np.inf) <= 1.0
        return candidates[int(np.argmin(misses))] if self.usable else None

    def _candidates(self, H: float) -> list[np.ndarray]:
        """Return what the Jacobian may be, each (n_outputs, m)."""
        matrix = self.partials()
        if matrix is None:
            return []
        from scipy.linalg import expm  # few FMUs come to here, and the import takes as long as a short run

        held, ends = self._inputs_of(H)
        C, D = matrix[: self.n_y, self.n_u :], matrix[: self.n_y, : self.n_u]
        A, B = matrix[self.n_y :, self.n_u :], matrix[self.n_y :, : self.n_u]
        response = expm(H * np.block([[A, B], [np.zeros((self.n_u, A.shape[0] + self.n_u))]]))
        linear = C @ response[: A.shape[0], A.shape[0] :] @ held + D @ ends
        return [J for J in (D @ held, linear) if np.all(np.isfinite(J))]

    def _inputs_of(self, H: float) -> tuple[np.ndarray, np.ndarray]:
        """Return M and N: how the FMU's inputs (then rates) in the step, and at its end, follow the unknowns."""
        node, m = self.node, len(self.node.inputs.names)
        held = np.eye(self.n_u, m)
        places = self.between.places[node.name] - node.first
        held[places, places] = 0.5
        mine = [i for i, (component, _) in enumerate(self.graph.free_rates) if component == node.name]
        for row, rate in enumerate(mine, start=m):
            if rate in self.between.rates[node.name]:
                held[row, self.graph.rate_of[rate] - node.first] = 1.0 / H
        ends = held.copy()
        if node.feedthrough:
            ends[:m] = np.eye(m)
        return held, ends

    def _miss(self, foretold: np.ndarray, seen: np.ndarray, base: np.ndarray, accuracy: float) -> float:
        """Return how far a change (n_outputs,) was foretold wrongly, by what is allowed; the worst vector of outputs."""
        error, change, size = (self._norms(values) for values in (foretold - seen, seen, base))
        return float(np.max(error / (accuracy * change + ROUND_OFF * size + TINY), initial=0.0))

    def _norms(self, values: np.ndarray) -> np.ndarray:
        """Return the largest magnitude in each vector of outputs."""
        largest = np.zeros(int(self.vector.max(initial=-1)) + 1)
        np.maximum.at(largest, self.vector, np.abs(values))
        return largest
