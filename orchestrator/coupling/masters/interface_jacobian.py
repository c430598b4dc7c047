"""Interface-Jacobian Newton: the expensive components as linear maps over the step, the cheap ones as they
are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.bounds import Count, NonNegative, Positive, PositiveCount
from orchestrator.coupling.stepping.free_response import FreeResponse, Past
from orchestrator.coupling.stepping.implicit import Implicit, Iterate
from orchestrator.coupling.stepping.interpolation import Between, step_node
from orchestrator.coupling.stepping.jacobian import OwnDerivatives
from orchestrator.coupling.stepping.least_squares import LeastSquares
from orchestrator.coupling.stepping.record import Record
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.step_control import joined

WORST = 1e-2  # contraction of the outer iteration that the exactness of the inner one reckons with at most
WILD = 10.0  # loads, over their scale, that no prediction is worth asking the contacts about
PREDICTIONS = ("model", "polynomial")
SMALLEST = 1e-5  # relative difference of the unknowns below which it says nothing about the Jacobian


class InterfaceJacobian(Implicit):
    """Implicit; a linear model of the first components of the order, the others stepped inside an inner loop.

    The components whose inputs are all torn (the *modelled* ones: for a landing cable and robot) answer to
    their inputs x over a macro step by y(x), nearly linear with a Jacobian that hardly changes: y(x) ≈
    y(x_k) + J (x - x_k). The rest (the contacts: stiff, nonlinear, cheap) are not approximated. Each outer
    iteration steps the modelled components once and then solves x = S(y(x_k) + J (x - x_k)) for x, rolling
    back and stepping the rest alone, by a quasi-Newton iteration whose columns are reused. J comes from
    the FMU's directional derivatives where they foretell a step (`OwnDerivatives`), else from differences with
    rollback, once for each length of step, and is corrected after every outer iteration (Broyden's update,
    which meets the last difference); it is made anew only when convergence slows, once a step.

    Order and stability: those of the exchange. When: the default for contact. Cost: about two steps of the
    modelled components a macro step. Reference: Sicklinger et al., Int. J. Numer. Methods Eng. 98 (2014)
    418-444 (IJCSA); Vierendeels et al., Computers & Structures 85 (2007) 970-976 (models of both sides).

    Parameters
    ----------
    reuse : macro steps whose columns the inner iteration keeps, those of all its solves in a step
    difference : step of the differences, relative to the magnitude of the unknown (at least 1 in its unit)
    slow : outer iterations after which J is made anew, unless the last one shows that the tolerance is near
    inner_tolerance : residual of the inner iteration, relative to `tolerance`
    inner_iterations : at most
    max_iterations : outer ones before the step is sub-divided; where the linear models fail, halves cost less, and an
        iteration that wanders finds solutions far from where the motion comes from
    prediction : where iterations begin. ``model``: the interface is solved with the models' free responses, the contacts as
        they are, before the first step of the expensive components (`FreeResponse`); where the record of that is poorer than
        the polynomial's, and with ``polynomial`` always, at the loads extrapolated
    memory : s, how long a load is remembered in a free response; each step of it costs a solve for every unknown, once
    tolerance : largest relative residual of a converged step; where iterations begin so near to their end, the error that it
        leaves is that of the exchange or less
    options : those of `Implicit`
    """

    TITLE: ClassVar[str] = (
        "implicit, Newton with a linear model of the expensive components, inner loop over the cheap ones"
    )
    NAME: ClassVar[str] = "interface_jacobian"

    def __init__(
        self,
        graph: Graph,
        *,
        reuse: Count = 8,
        threshold: NonNegative = 1e-6,
        relaxation: Positive = 0.1,
        difference: Positive = 1e-2,
        slow: PositiveCount = 6,
        inner_tolerance: Positive = 0.1,
        inner_iterations: PositiveCount = 30,
        max_iterations: PositiveCount = 10,
        prediction: str = "model",
        memory: NonNegative = 0.02,
        tolerance: Positive = 3e-6,
        **options: Any,
    ):
        self.inner = LeastSquares(graph.torn.size, reuse, threshold, relaxation)
        super().__init__(graph, self.inner, max_iterations=max_iterations, tolerance=tolerance, **options)
        self.difference, self.slow = difference, slow
        self.inner_tolerance, self.inner_iterations = inner_tolerance, inner_iterations
        if prediction not in PREDICTIONS:
            raise ValueError(f"prediction {prediction!r}: choose {', '.join(PREDICTIONS)}")
        self.foresees = prediction == "model"
        nodes = [node for node in graph.nodes if not node.forward.size and node.torn]
        self.models = [Model(graph, node, self.between, FreeResponse(node, memory)) for node in nodes]
        modelled = {model.node.name for model in self.models}
        self.rest = [(i, node) for i, node in enumerate(graph.nodes) if node.name not in modelled]
        if not self.models or not self.rest:
            raise GraphError(
                f"master {self.NAME}: the graph has nothing to model or nothing to iterate over; use iqn_ils"
            )

    def start(self, t: float) -> None:
        """Prepare for the first step."""
        super().start(t)
        for model in self.models:
            model.jacobians.clear()
            model.free.reset()
        self.contraction = 0.0
        self.records: dict[float, Record] = {}

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        self.pieces = [_Piece(t, 0.0, self.x, [])]
        return super().step(t, H)

    def _predicted(self, t: float, H: float, states: list[SavedState], report: StepReport) -> np.ndarray:
        """Return the better of two beginnings: the polynomial through the loads, or the models' free responses."""
        polynomial = super()._predicted(t, H, states, report)
        foreseen, record = None, self.records.setdefault(H, Record())
        if self.foresees:
            for model in self.models:
                model.free.begin()
            foreseen = self._foreseen(t, H, polynomial, states) if record.asks_models else None
        report.by_model = foreseen is not None
        return polynomial if foreseen is None else foreseen

    def _iterate(
        self,
        t: float,
        H: float,
        x: np.ndarray,
        states: list[SavedState],
        tolerance: float,
        report: StepReport,
        least: int = 1,
    ) -> Iterate:
        """Iterate, and remember how good the beginning was."""
        before = report.iterations
        found = super()._iterate(t, H, x, states, tolerance, report, least)
        made = report.iterations - before
        self.records[H].note(by_model=report.by_model, residual=self.first_residual, iterations=made)
        return found

    def _foreseen(self, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> np.ndarray | None:
        """Return the unknowns that meet the interface equation with the models' free responses; the rest alone is stepped.

        None where no step of this length is known yet, or no solution is found.
        """
        if not all(H in model.jacobians and model.free.known(H) for model in self.models):
            return None
        u = self.graph.u.copy()
        self.between.begin()
        self._begin(t, H, x, states)
        for model in self.models:
            self._measure(model, t, H, x, states)
            J, own = model.jacobians[H], x[model.unknowns].copy()
            model.last = own, model.free.foretold(H, J) + J @ own
        try:
            r = self._rest_residual(t, H, x, states)
            found, solved = self._solve_interface(t, H, x, r, self.tolerance, states, most=WILD)
        except FmuError as error:
            if not error.recoverable:
                raise
            found, solved = x, False
        for i, node in self.rest:
            node.fmu.restore(states[i])
        self.graph.u[:] = u
        return found if solved else None

    def _measure(self, model: Model, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> None:
        """Measure how a component remembers its loads, once for each length of step, where that will pay."""
        free, node = model.free, model.node
        lags, stop = free.lags(H), node.fmu.stop
        if H in free.pulses or not lags or free.known(H) <= lags or t + (lags + 1) * H > stop:
            return
        if self.records[H].pays((lags + 1) * (node.torn + 1), (stop - t) / H):
            state, values, steps = self._differences(model, x, states)
            model.jacobians[H] = free.measure(t, H, values, steps, state, self.between)

    def _accept(self, t: float, H: float) -> None:
        super()._accept(t, H)
        if self.foresees:
            past = [
                m.free.seen(H, m.free.start, m.node.outputs.values.copy(), self.x[m.unknowns].copy())
                for m in self.models
            ]
            self._remember(_Piece(t, H, self.x, past))

    def _remember(self, piece: _Piece) -> None:
        """Remember a step; two halves of a longer one are remembered as that, too."""
        for model, past in zip(self.models, piece.past, strict=True):
            model.free.append(piece.H, past)
        before = self.pieces[-1]
        if before.H != piece.H or round((piece.t - self.pieces[0].t) / piece.H) % 2 == 0:
            self.pieces.append(piece)
            return
        self.pieces.pop()
        x = joined(self.scale, before.x, piece.x, piece.H)
        past = [
            m.free.joined(2.0 * piece.H, first, second, x[m.unknowns])
            for m, first, second in zip(self.models, before.past, piece.past, strict=True)
        ]
        self._remember(_Piece(before.t, 2.0 * piece.H, x, past))

    def snapshot(self) -> tuple[Any, ...]:
        """Return all that a step changes, the states of the components first (to be released)."""
        return (*super().snapshot(), [dict(model.free.past) for model in self.models], list(self.pieces))

    def revert(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        super().revert(snapshot[:-2])
        for model, past in zip(self.models, snapshot[-2], strict=True):
            model.free.past = dict(past)
        self.pieces = list(snapshot[-1])

    def _begin(self, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> None:
        super()._begin(t, H, x, states)
        for model in self.models:
            model.last = None
            if H not in model.jacobians:
                self._differentiate(model, t, H, x, states)
        self.outer, self.last, self.anew = 0, np.inf, False

    def _differentiate(self, model: Model, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> None:
        """Make the Jacobian of one component anew, and leave the component where it was."""
        node, (state, values, steps) = model.node, self._differences(model, x, states)

        def respond(change: np.ndarray) -> np.ndarray:
            return self._response(node, state, t, H, values + change)

        base = respond(np.zeros_like(values))
        # wrong by this much, J shrinks the error to `tolerance` within the `slow` iterations that it is given
        jacobian = model.derivatives.jacobian(H, steps, respond, self.tolerance ** (1.0 / max(self.slow, 1)))
        if jacobian is None:
            jacobian = np.stack([(respond(e) - base) for e in np.diag(steps)], axis=1) / steps
        node.fmu.restore(state)
        model.jacobians[H] = jacobian

    def _differences(
        self, model: Model, x: np.ndarray, states: list[SavedState]
    ) -> tuple[SavedState, np.ndarray, np.ndarray]:
        """Return what a component's answers are taken from: its state, its unknowns (m,), by how much each is changed (m,)."""
        values = x[model.unknowns]
        return states[self.graph.nodes.index(model.node)], values, self.difference * np.maximum(np.abs(values), 1.0)

    def _response(self, node: Node, state: SavedState, t: float, H: float, values: np.ndarray) -> np.ndarray:
        node.fmu.restore(state)
        node.inputs.values[:] = values
        step_node(self.between, node, t, H)
        return node.outputs.values.copy()

    def _correct(self, t: float, H: float, x: np.ndarray, r: np.ndarray, states: list[SavedState]) -> np.ndarray:
        """Update the models with what has just been seen, then solve the interface equation with them."""
        for model in self.models:
            model.learn(H, x, self.scale.values)
        self.outer += 1
        residual = self.scale.norm(r, x, H)
        shrunk, self.last = residual / self.last, residual
        if shrunk > 0.0:
            self.contraction = 0.5 * (self.contraction + min(shrunk, WORST))
        if self.outer >= self.slow and not self.anew and not self._ends_soon(residual, shrunk):
            self.anew = True
            for model in self.models:
                self._differentiate(model, t, H, x, states)
        return self._solve_interface(t, H, x, r, self._left(residual), states)[0]

    def _left(self, residual: float) -> float:
        """Return the residual that the models leave of a `residual`; less than the tolerance is of use for the energy alone."""
        return max(min(self.tolerance, residual), self.contraction * residual)

    def _ends_soon(self, residual: float, shrunk: float) -> bool:
        """Return whether the iteration will be below the tolerance in time if it goes on as it has last `shrunk`."""
        return residual * min(shrunk, 1.0) ** (self.max_iterations - self.outer) <= self.tolerance

    def trial(
        self, t: float, H: float, x: np.ndarray, tolerance: float, enough: Callable[[], bool], report: StepReport
    ) -> bool:
        """Make one step from the unknowns `x` (n,) on, for its outputs alone: one solve and the rest by the models; a
        second solve, from which they learn, if that is not `enough`."""
        self.graph.exchange_discrete()
        states = self.graph.save()
        self.between.begin()
        self._begin(t, H, x, states)
        try:
            solved = False
            for again in (False, True):
                r = self._residual(t, H, x, states if again else None, report)
                if r is None:
                    return False
                for model in self.models:
                    model.learn(H, x, self.scale.values)
                x, solved = self._solve_interface(t, H, x, r, self._left(self.scale.norm(r, x, H)), states)
                if solved and enough():
                    break
            self.inner.accept()
            return solved
        finally:
            self.graph.release(states)

    def _solve_interface(
        self,
        t: float,
        H: float,
        x: np.ndarray,
        r: np.ndarray,
        left: float,
        states: list[SavedState],
        most: float = np.inf,
    ) -> tuple[np.ndarray, bool]:
        """Return the unknowns that meet the equation with the models, the best that were found, and whether they do.

        `r` is the residual of `x`; the models are exact to about `left`, and to solve more exactly is of no use. It is given up
        where an unknown is `most` times its scale.
        """
        inner, best, limit = self.inner, (np.inf, x), most * self.scale.values if most < np.inf else None
        residual, target = self.scale.norm(r, x, H), self.inner_tolerance * left
        inner.begin(H, self.scale.values)
        for _ in range(self.inner_iterations):
            if residual < best[0]:
                best = (residual, x + r)
            if residual <= target:
                inner.conclude()
                return x, True
            x = inner.propose(x, r)
            if limit is not None and np.any(np.abs(x) > limit):
                break
            try:
                r = self._rest_residual(t, H, x, states)
            except FmuError as error:
                if not error.recoverable:
                    raise
                break
            residual = self.scale.norm(r, x, H)
        inner.reject()
        return best[1], False

    def _rest_residual(self, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> np.ndarray:
        """Return S(x) - x with the modelled components replaced by their models."""
        graph = self.graph
        graph.u[self.places] = x
        for model in self.models:
            model.predict(H, x)
        for i, node in self.rest:
            node.fmu.restore(states[i])
            node.receive(graph.y)
            step_node(self.between, node, t, H)
        return graph.gathered(self.places) - x


@dataclass(frozen=True)
class _Piece:
    """A step of length `H` (s) from `t` on, made within the macro step: its unknowns (n,), and what each model keeps of it."""

    t: float
    H: float
    x: np.ndarray
    past: list[Past]


class Model:
    """Linear model y(x) of one component over a step, about the last point where it was stepped.

    Attributes
    ----------
    unknowns : (m,) places of the component's inputs among the unknowns
    derivatives : what the FMU says of its Jacobian
    jacobians : length of step → (n_outputs, m)
    last : unknowns (m,) and outputs (n_outputs,) of the last step made, or foretold
    free : what foretells them
    """

    def __init__(self, graph: Graph, node: Node, between: Between, free: FreeResponse):
        self.node, self.free = node, free
        self.derivatives = OwnDerivatives(graph, between, node)
        first = int(np.searchsorted(graph.torn, node.first))
        self.unknowns = slice(first, first + node.torn)
        self.jacobians: dict[float, np.ndarray] = {}
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    def learn(self, H: float, x: np.ndarray, scale: np.ndarray) -> None:
        """Take over the step just made, at the unknowns `x` (n,): Broyden's update with the difference to
        the last."""
        values, outputs = x[self.unknowns].copy(), self.node.outputs.values.copy()
        if self.last is not None:
            dx, dy = values - self.last[0], outputs - self.last[1]
            weights = dx / scale[self.unknowns] ** 2
            square = weights @ dx
            if square > SMALLEST**2:
                self.jacobians[H] += np.outer(dy - self.jacobians[H] @ dx, weights / square)
        self.last = values, outputs

    def predict(self, H: float, x: np.ndarray) -> None:
        """Write the outputs that the model expects at the unknowns `x` (n,) into the graph."""
        assert self.last is not None
        self.node.outputs.values[:] = self.last[1] + self.jacobians[H] @ (x[self.unknowns] - self.last[0])
