"""Reduced interface model: contact solved implicitly against linear models of components that cannot go
back."""

from __future__ import annotations

from collections import deque
from typing import ClassVar

import numpy as np

from orchestrator.coupling.errors import FORWARD
from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.bounds import Positive, PositiveCount
from orchestrator.coupling.stepping.interpolation import Between, Loads, step_node
from orchestrator.coupling.stepping.least_squares import LeastSquares
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.replay import check_replay
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.scale import Scale


class ReducedInterface(Master):
    """Non-iterative for components without rollback; the rest (the contacts) are solved implicitly against
    models.

    A modelled component is taken as a linear one that coasts with constant acceleration: with h_j its outputs j steps
    after a unit pulse of an input, and D³ the third difference in time, D³ y = Σ_j (D³ h)_j x_{n+1-j}, j = 0 … 3, which
    is exact for a free body. So y_{n+1} = ŷ + h_0 x_{n+1} with ŷ known; x = S(ŷ + h_0 x) is solved by rolling back
    and stepping the contacts alone; then every component is stepped once, with the forces found. The h_j come from
    twins of the component: instances of the same FMU, stepped with one input pulsed each, and freed again.

    Order: 1 (contact) to 2 (springs). Stability: the contact's stiffness is implicit, the vibration of the
    modelled components explicit. When: an FMU cannot be rolled back (canGetAndSetFMUstate is false) but the
    contacts can, and its motion is resolved by the macro step, 0.25 ms in a landing; above that `gauss_seidel` is nearer
    and cheaper. Reference: Peiret, González, Kövecses &
    Teichmann, J. Comput. Nonlinear Dyn. 13 (2018); Nonlinear Dynamics 99 (2020).

    Parameters
    ----------
    tolerance : relative residual of the solution with the models
    max_iterations : of that solution
    difference : height of a twin's pulse, in the input's unit
    """

    NAME: ClassVar[str] = "reduced_interface"
    TITLE: ClassVar[str] = "explicit, contacts implicit against linear models; for FMUs without rollback"

    def __init__(
        self,
        graph: Graph,
        *,
        tolerance: Positive = 1e-6,
        max_iterations: PositiveCount = 50,
        difference: Positive = 1.0,
    ):
        super().__init__(graph)
        self.tolerance, self.max_iterations, self.difference = tolerance, max_iterations, difference
        self.modelled = [node for node in graph.nodes if not node.forward.size and node.torn]
        self.rest = [node for node in graph.nodes if node not in self.modelled]
        stuck = [node.name for node in self.rest if not node.fmu.capabilities.rollback]
        if stuck or not self.modelled or not self.rest:
            which = ", ".join(stuck) or "the graph"
            raise GraphError(f"master {self.NAME}: {which} cannot be iterated over; {FORWARD}")
        loads = Loads(graph)
        self.scale = Scale(graph, loads, absolute=1e-3, lever=0.01)
        self.between = Between(graph, loads, torn=True)
        self.solver = LeastSquares(graph.torn.size, 8, 1e-6, 0.1)

    def start(self, t: float) -> None:
        """Prepare for the first step."""
        self.inputs: deque[np.ndarray] = deque(maxlen=3)
        self.outputs: deque[np.ndarray] = deque(maxlen=3)
        self.solver.reset()
        self.scale.reset()
        self.x = self.graph.u[self.graph.torn]
        self.responses: dict[str, np.ndarray] = {}

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        graph, report = self.graph, StepReport(t + H)
        graph.exchange_discrete()
        if not self.responses:
            check_replay(self.rest, t, H)
            self.responses = {node.name: self._response(node, t, H) for node in self.modelled}
            self.inputs.extend([self.x] * 3)
            self.outputs.extend([graph.y.copy()] * 3)
        self.between.begin()
        self.outputs.appendleft(graph.y.copy())
        self.x = self._solve(t, H, self.x, self._coasting(), report)
        self.inputs.appendleft(self.x)
        self._advance(t, H)
        report.columns = self.solver.columns
        report.converged = report.residual <= self.tolerance
        return report

    def _coasting(self) -> np.ndarray:
        """Return the outputs of the next step without the input of that step, (n_y,)."""
        y0, y1, y2 = self.outputs
        y = 3 * y0 - 3 * y1 + y2
        for node in self.modelled:
            first, last, inputs = _places(self.graph, node)
            for response, x in zip(self.responses[node.name][1:], self.inputs, strict=True):
                y[first:last] += response @ x[inputs]
        return y

    def _advance(self, t: float, H: float) -> None:
        graph = self.graph
        self.scale.accept(self.x)
        graph.u[graph.torn] = self.x
        for node in graph.nodes:
            node.receive(graph.y)
            step_node(self.between, node, t, H)
        if graph.observers:
            graph.accepted(t, H)
        graph.gather()

    def _solve(self, t: float, H: float, x: np.ndarray, y_hat: np.ndarray, report: StepReport) -> np.ndarray:
        states = [node.fmu.save() for node in self.rest]
        best = (np.inf, x)
        try:
            self.solver.begin(H, self.scale.update(x, H).copy())
            for _ in range(self.max_iterations):
                r = self._residual(t, H, x, y_hat, states)
                residual = self.scale.norm(r, x, H)
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

    def _residual(self, t: float, H: float, x: np.ndarray, y_hat: np.ndarray, states: list[SavedState]) -> np.ndarray:
        graph = self.graph
        graph.u[graph.torn] = x
        for node in self.modelled:
            first, last, inputs = _places(graph, node)
            graph.y[first:last] = y_hat[first:last] + self.responses[node.name][0] @ x[inputs]
        for node, state in zip(self.rest, states, strict=True):
            node.fmu.restore(state)
            node.receive(graph.y)
            step_node(self.between, node, t, H)
        return graph.gathered(graph.torn) - x

    def _response(self, node: Node, t: float, H: float) -> np.ndarray:
        """Return the third differences of the pulse responses, (4, n_outputs, n_inputs)."""
        base = self._twin(node, t, H, -1)
        h = np.array([self._twin(node, t, H, j) - base for j in range(len(node.inputs.names))]) / self.difference
        h = np.moveaxis(h, 0, 2)
        # what is interpolated is held at the mean of both ends: a change at one end makes half a pulse now,
        # half later
        places = self.between.places[node.name] - node.first
        later = np.concatenate([np.zeros_like(h[:1]), h[:-1]])
        h[:, :, places] = 0.5 * (h + later)[:, :, places]
        return np.array([h[0], h[1] - 3 * h[0], h[2] - 3 * h[1] + 3 * h[0], h[3] - 3 * h[2] + 3 * h[1] - h[0]])

    def _twin(self, node: Node, t: float, H: float, pulsed: int) -> np.ndarray:
        """Return the outputs of a twin after 1 … 4 steps, (4, n_outputs), one input pulsed in the first of
        them."""
        twin: Fmu = node.fmu.twin()
        inputs, outputs = twin.group(node.inputs.names), twin.group(node.outputs.names)
        rows = []
        try:
            inputs.values[:] = node.inputs.values
            twin.enter_initialization(t)
            inputs.set()
            twin.exit_initialization()
            for j in range(4):
                inputs.values[:] = node.inputs.values
                if pulsed >= 0 and j == 0:
                    inputs.values[pulsed] += self.difference
                inputs.set()
                twin.step(t + j * H, H)
                outputs.get_finite()
                rows.append(outputs.values.copy())
        finally:
            twin.close()
        return np.array(rows)


def _places(graph: Graph, node: Node) -> tuple[int, int, slice]:
    """Return where the outputs of a node are in y, and its inputs among the unknowns."""
    first = (node.outputs.values.ctypes.data - graph.y.ctypes.data) // graph.y.itemsize
    start = int(np.searchsorted(graph.torn, node.first))
    return first, first + len(node.outputs.names), slice(start, start + node.torn)
