"""Reduced interface model: contact solved implicitly against linear models of components that cannot go
back."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from orchestrator.fmu import Fmu, State
from orchestrator.graph import Graph, GraphError, Node
from orchestrator.masters.base import Between, History, Loads, Master, StepReport, step_node
from orchestrator.masters.implicit import Scale
from orchestrator.masters.least_squares import LeastSquares


class ReducedInterface(Master):
    """Non-iterative for components without rollback; the rest (the contacts) are solved implicitly against
    models of them.

    Over the next step a modelled component answers by y(x) = ŷ + J (x - x̂), with x̂, ŷ extrapolated from
    the last communication points and J its compliance over a step. x = S(ŷ + J (x - x̂)) is solved by
    rolling back and stepping the contacts alone; then every component is stepped once, with the forces
    found. J comes from twins of the component, instantiated for a first step with one input changed each,
    and freed again; it is corrected as the run goes on by what the components did (Broyden's update).

    Order: 1 to 2. Stability: what destabilises explicit coupling, the contact's stiffness, is implicit; the
    error of the model is explicit. When: an FMU cannot be rolled back (canGetAndSetFMUstate is false) but
    the contacts can. Reference: Peiret, González, Kövecses & Teichmann, J. Comput. Nonlinear Dyn. 13 (2018);
    Nonlinear Dynamics 99 (2020).

    Parameters
    ----------
    extrapolation : degree of x̂ and ŷ, 0, 1 or 2
    tolerance : relative residual of the solution with the models
    max_iterations : of that solution
    difference : input change of a twin, in its unit
    """

    NAME: ClassVar[str] = "reduced_interface"
    TITLE: ClassVar[str] = (
        "one step a macro step, contacts implicit against linear models; for FMUs without rollback"
    )

    def __init__(
        self,
        graph: Graph,
        *,
        extrapolation: int = 2,
        tolerance: float = 1e-6,
        max_iterations: int = 50,
        difference: float = 1.0,
    ):
        super().__init__(graph)
        self.tolerance, self.max_iterations, self.difference = tolerance, max_iterations, difference
        self.modelled = [node for node in graph.nodes if not node.forward.size and node.torn]
        self.rest = [node for node in graph.nodes if node not in self.modelled]
        stuck = [node.name for node in self.rest if not node.fmu.capabilities.rollback]
        if stuck or not self.modelled or not self.rest:
            which = ", ".join(stuck) or "the graph"
            raise GraphError(
                f"master {self.NAME}: {which} cannot be iterated over; choose jacobi or gauss_seidel"
            )
        loads = Loads(graph)
        self.scale = Scale(graph, loads, 1e-3)
        self.between = Between(graph, loads, torn=True)
        self.solver = LeastSquares(graph.torn.size, 8, 1e-6, 0.1)
        self.inputs, self.outputs = History(extrapolation), History(extrapolation)

    def start(self, t: float) -> None:
        """Prepare for the first step."""
        self.inputs.clear()
        self.outputs.clear()
        self.solver.reset()
        self.scale.reset()
        self.x = self.graph.u[self.graph.torn]
        self.jacobians: dict[str, np.ndarray] = {}

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        graph, report = self.graph, StepReport(t + H)
        graph.exchange_discrete()
        if not self.jacobians:
            self.jacobians = {node.name: self._compliance(node, t, H) for node in self.modelled}
        self.between.begin()
        # the unknowns are means over steps, the outputs belong to their ends
        self.inputs.append(t - H / 2, self.x)
        self.outputs.append(t, graph.y)
        x_hat, y_hat = (_at(h, t, H, s) for h, s in ((self.inputs, 0.5), (self.outputs, 1.0)))
        self.x = self._solve(t, H, x_hat, y_hat, report)
        self._advance(t, H, x_hat, y_hat)
        report.columns = self.solver.columns
        report.converged = report.residual <= self.tolerance
        return report

    def _advance(self, t: float, H: float, x_hat: np.ndarray, y_hat: np.ndarray) -> None:
        graph = self.graph
        graph.u[graph.torn] = self.x
        for node in graph.nodes:
            node.receive(graph.y)
            step_node(self.between, node, t, H)
        for node in self.modelled:
            self._learn(node, x_hat, y_hat)
        if graph.observers:
            graph.accepted(t, H)
        graph.gather()

    def _solve(self, t: float, H: float, x: np.ndarray, y_hat: np.ndarray, report: StepReport) -> np.ndarray:
        states = [node.fmu.save() for node in self.rest]
        x_hat, best = x, (np.inf, x)
        try:
            self.solver.begin(H, self.scale.update(x, H).copy())
            for _ in range(self.max_iterations):
                r = self._residual(t, H, x, x_hat, y_hat, states)
                residual = self.scale.norm(r, x + r, H)
                if residual < best[0]:
                    best = (residual, x)
                if residual <= self.tolerance:
                    self.solver.accept()
                    break
                x = self.solver.propose(x, r)
        finally:
            for node, state in zip(self.rest, states, strict=True):
                node.fmu.restore(state)
                node.fmu.release(state)
        report.residual = best[0]
        return best[1]

    def _residual(
        self, t: float, H: float, x: np.ndarray, x_hat: np.ndarray, y_hat: np.ndarray, states: list[State]
    ) -> np.ndarray:
        graph = self.graph
        graph.u[graph.torn] = x
        for node in self.modelled:
            first, last, inputs = _places(graph, node)
            graph.y[first:last] = y_hat[first:last] + self.jacobians[node.name] @ (x - x_hat)[inputs]
        for node, state in zip(self.rest, states, strict=True):
            node.fmu.restore(state)
            node.receive(graph.y)
            step_node(self.between, node, t, H)
        return graph.gathered(graph.torn) - x

    def _learn(self, node: Node, x_hat: np.ndarray, y_hat: np.ndarray) -> None:
        """Correct the compliance by half of what the last step contradicts it (Broyden, damped against
        noise)."""
        first, last, inputs = _places(self.graph, node)
        dx, dy = (self.x - x_hat)[inputs], self.graph.y[first:last] - y_hat[first:last]
        weights = dx / self.scale.values[inputs] ** 2
        square = weights @ dx
        if square > 1e-4:
            jacobian = self.jacobians[node.name]
            jacobian += DAMPING * np.outer(dy - jacobian @ dx, weights / square)

    def _compliance(self, node: Node, t: float, H: float) -> np.ndarray:
        """Return d(outputs)/d(inputs) over the first step, from twins of the component."""
        base = self._twin(node, t, H, -1)
        columns = [self._twin(node, t, H, j) - base for j in range(len(node.inputs.names))]
        jacobian = np.array(columns).T / self.difference
        # what is interpolated is held at the mean of both ends: only half of a change at the end arrives
        jacobian[:, self.between.places[node.name] - node.first] *= 0.5
        return jacobian

    def _twin(self, node: Node, t: float, H: float, changed: int) -> np.ndarray:
        twin: Fmu = node.fmu.twin()
        try:
            inputs, outputs = twin.group(node.inputs.names), twin.group(node.outputs.names)
            inputs.values[:] = node.inputs.values
            twin.enter_initialization(t)
            inputs.set()
            twin.exit_initialization()
            if changed >= 0:
                inputs.values[changed] += self.difference
            inputs.set()
            twin.step(t, H)
            outputs.get_finite()
            return outputs.values.copy()
        finally:
            twin.close()


DAMPING = 0.2  # share of Broyden's correction: extrapolation errors contradict the model too


def _places(graph: Graph, node: Node) -> tuple[int, int, slice]:
    """Return where the outputs of a node are in y, and its inputs among the unknowns."""
    first = (node.outputs.values.ctypes.data - graph.y.ctypes.data) // graph.y.itemsize
    start = int(np.searchsorted(graph.torn, node.first))
    return first, first + len(node.outputs.names), slice(start, start + node.torn)


def _at(history: History, t: float, H: float, s: float) -> np.ndarray:
    c, a, b = history.coefficients(t, H)
    return c + a * s + b * s * s
