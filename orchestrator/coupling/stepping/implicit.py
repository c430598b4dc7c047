"""The implicit coupling loop: predict, step all components, compare, correct, roll back, again.

The unknowns x are the inputs that are fed by a component later in the execution order (the *torn* ones);
stepping the components in order with x gives S(x), what those inputs should have been. The residual is r =
S(x) - x. How x is corrected from one iteration to the next is the business of an `Accelerator`, one file
each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orchestrator.coupling.errors import digits
from orchestrator.coupling.fmu.binding import ERROR, SavedState
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.accelerator import Accelerator
from orchestrator.coupling.stepping.bounds import Count, NonNegative, Positive, PositiveCount
from orchestrator.coupling.stepping.energy import EnergyAccount
from orchestrator.coupling.stepping.interpolation import Between, Loads, begin_node, finish_node
from orchestrator.coupling.stepping.master import Master, require_rollback
from orchestrator.coupling.stepping.predictor import Predictor
from orchestrator.coupling.stepping.replay import check_replay
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.scale import Scale
from orchestrator.coupling.stepping.step_control import StepControl

ROUND_OFF = 1e-12
"""Relative correction of the unknowns below which they are as exact as the arithmetic allows, whatever tolerance is
asked for: across a stiff coupling the residual itself is only known to its gain times round-off."""
NOISE = 1e-3
"""Largest relative residual that may be round-off. A larger one without a correction is an iteration that is stuck: at an
iterate so wild that nothing near it is an answer."""
DIVERGED = 1e2  # growth of the unknowns, over accepted ones, prediction and its answer, that ends an iteration


@dataclass(frozen=True)
class Iterate:
    """The unknowns `x` (n,) that an iteration has come to, and their relative residual.

    `near`: whether that is small enough, and only the energy that the step makes is not.
    """

    x: np.ndarray
    residual: float = np.inf
    converged: bool = False
    near: bool = False


class Implicit(Master):
    """Base of the implicit masters.

    Parameters
    ----------
    tolerance : largest relative residual of a converged step
    absolute : magnitude of an unknown (in its unit) below which the residual counts as absolute
    lever : m, a moment is measured by this times the force at the same place as well (see `Scale`)
    max_iterations : iterations of one step before it is sub-divided
    max_depth : the macro step is halved at most so often
    predictor : order of the prediction of the unknowns, or -1: the one that did best lately
    local_tolerance : if positive, sub-steps are made as short as this local error asks for (see `StepControl`)
    energy_budget : energy that the coupling may make: ``dissipated``, what the components that give the loads have dissipated
        by then (nothing, where they do not show it); a number of joules, ``0`` for nothing; ``none``, as much as the
        tolerance lets pass (`EnergyAccount`). Where no iteration keeps to it the step is divided as if it did not converge
    parallel : components that need nothing of one another in threads: ``auto`` (where it pays), ``always`` or ``never``
    """

    IMPLICIT: ClassVar[bool] = True

    def __init__(
        self,
        graph: Graph,
        accelerator: Accelerator,
        *,
        tolerance: Positive = 1e-6,
        absolute: Positive = 1e-3,
        lever: float = 0.01,
        max_iterations: PositiveCount = 25,
        max_depth: Count = 6,
        predictor: int = -1,
        local_tolerance: NonNegative = 0.0,
        energy_budget: str | float = "dissipated",
        parallel: str = "auto",
    ):
        super().__init__(graph, parallel=parallel)
        require_rollback(graph, self.NAME)
        self.accelerator = accelerator
        self.tolerance, self.max_iterations, self.max_depth = tolerance, max_iterations, max_depth
        self.loads = Loads(graph)
        self.between = Between(graph, self.loads, torn=True)
        self.predictor = Predictor(predictor)
        self.scale = Scale(graph, self.loads, absolute, lever)
        self.account = EnergyAccount(graph, self.work, energy_budget)
        self.places = graph.torn
        if local_tolerance > 0.0:
            self._require_variable_steps()
        self.control = StepControl(self, local_tolerance, absolute, max_depth) if local_tolerance > 0.0 else None

    def start(self, t: float) -> None:
        """Prepare for the first step."""
        self.keep_books()  # the budget of energy needs them
        self.accelerator.reset()
        self.predictor.reset()
        self.scale.reset()
        self.x = self.graph.u[self.places]
        self.checked = False
        self.failure: FmuError | None = None
        if self.control is not None:
            self.control.start()

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`; never leaves an unconverged step unsaid."""
        if not self.checked:
            self.checked = True
            check_replay(self.graph.nodes, t, H)
        report = StepReport(t + H, iterations=0)
        if self.control is not None:
            self.control.advance(t, H, report)
        else:
            self.advance(t, H, 0, report)
        report.columns = self.accelerator.columns
        return report

    def advance(self, t: float, H: float, depth: int, report: StepReport) -> None:
        """Advance by `H`, by halves if the iteration does not converge."""
        if self.attempt(t, H, report, last=depth == self.max_depth):
            return
        self._require_halves(t, H, depth)
        report.subdivisions, report.rejected = report.subdivisions + 1, report.rejected + 1
        self.advance(t, H / 2, depth + 1, report)
        self.advance(t + H / 2, H / 2, depth + 1, report)

    def attempt(self, t: float, H: float, report: StepReport, *, last: bool) -> bool:
        """Make one step; return whether it was made. If it does not converge all is as before, unless it is the `last`
        resort: then loads are held."""
        self.graph.exchange_discrete()
        self.failure = None
        states = self.graph.save()
        try:
            start_values = self.graph.u.copy()
            converged, residual = self._solve(t, H, states, report, keep_best=last)
            if converged or last:
                report.converged &= converged
                report.residual = max(report.residual, residual)
                self._accept(t, H)
                return True
            self.graph.restore(states)
            self.graph.u[:] = start_values
            return False
        finally:
            self.graph.release(states)

    def _require_variable_steps(self) -> None:
        """Raise `GraphError` if steps cannot be adaptive."""
        fixed = [
            n.name for n in self.graph.nodes if not n.fmu.capabilities.variable_step or n.fmu.capabilities.internal_step
        ]
        if fixed:
            raise GraphError(
                f"master {self.NAME}: local_tolerance varies the step, which {', '.join(fixed)} cannot "
                "(canHandleVariableCommunicationStepSize is false, or fixedInternalStepSize is given); leave it out"
            )

    def _require_halves(self, t: float, H: float, depth: int) -> None:
        """Raise `FmuError` if a component cannot be stepped by half of `H`, the macro step halved `depth` times."""
        for node in self.graph.nodes:
            if not node.fmu.allows(H / 2, H * 2**depth):
                cause = self.failure.message if self.failure is not None else "it does not converge"
                raise FmuError(
                    node.name,
                    t,
                    ERROR,
                    f"the step of {digits(H)} s would have to be halved ({cause}), but {node.name} cannot vary its step; "
                    "choose a smaller macro step, or max_depth = 0 to go on with the best iterate",
                )

    def snapshot(self) -> tuple[Any, ...]:
        """Return all that a step changes, the states of the components first (to be released)."""
        graph = self.graph
        observers = [observer.save() for observer in graph.observers]
        return graph.save(), graph.u.copy(), graph.y.copy(), self.x, self.predictor.save(), observers

    def revert(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        states, u, y, self.x, predictor, observers = snapshot
        self.graph.restore(states)
        self.graph.u[:], self.graph.y[:] = u, y
        self.predictor.restore(predictor)
        for observer, saved in zip(self.graph.observers, observers, strict=True):
            observer.restore(saved)

    def _accept(self, t: float, H: float) -> None:
        self.predictor.append(t + H / 2, self.x, self.scale.values)
        self.scale.accept(self.x)
        if self.graph.observers:
            self.graph.accepted(t, H)
        self.graph.gather()

    def trial(
        self, t: float, H: float, x: np.ndarray, tolerance: float, enough: Callable[[], bool], report: StepReport
    ) -> bool:
        """Make one step from the unknowns `x` (n,) on; return whether it converged to `tolerance`.

        For its outputs, in the graph, alone: the caller takes all back. At least one correction is made, since the
        outputs are less accurate than the unknowns. A master that has good outputs earlier stops when they are `enough`.
        """
        self.graph.exchange_discrete()
        states = self.graph.save()
        try:
            return self._iterate(t, H, x, states, tolerance, report, least=2).converged
        finally:
            self.graph.release(states)

    def _solve(
        self, t: float, H: float, states: list[SavedState], report: StepReport, *, keep_best: bool
    ) -> tuple[bool, float]:
        """Iterate over one step; return whether it converged and the residual of the iterate the components
        are left at."""
        x = self._predicted(t, H, states, report)
        found = self._iterate(t, H, x, states, self.tolerance, report)
        if found.converged:
            self.x = found.x
        elif keep_best:
            self._hold(t, H, found, states, report)
        return found.converged, found.residual

    def _predicted(self, t: float, H: float, states: list[SavedState], report: StepReport) -> np.ndarray:
        """Return the unknowns that the iteration of a step begins with, (n,)."""
        return self.predictor.predict(t + H / 2, self.x)

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
        """Iterate from `x` on, `least` times at least; return the iterate with the smallest residual."""
        self.between.begin()
        self._begin(t, H, x, states)
        found = self._search(t, H, x, states, tolerance, report, least)
        if found.converged:
            self.accelerator.accept()
        else:
            self.accelerator.reject()
        return found

    def _search(
        self,
        t: float,
        H: float,
        x: np.ndarray,
        states: list[SavedState],
        tolerance: float,
        report: StepReport,
        least: int,
    ) -> Iterate:
        """Step, compare, correct, roll back, until residual and energy are small enough, nothing moves or it runs away."""
        best, limit = Iterate(x), np.abs(x)
        self.first_residual = np.inf
        for k in range(self.max_iterations):
            r = self._residual(t, H, x, states if k else None, report)
            if r is None:
                return best
            residual = self.scale.norm(r, x, H)
            self.first_residual = residual if not k else self.first_residual
            near = residual <= tolerance and k + 1 >= least
            if near and (least > 1 or self.account.allows(H)):
                return Iterate(x, residual, converged=True)
            if residual < best.residual:
                best = Iterate(x, residual, near=near)
            scale = self.scale.values.copy()  # that of x: the correction may try wild unknowns
            if not k:
                limit = DIVERGED * np.maximum(scale, np.abs(x))
            following = self._correct(t, H, x, r, states)
            if np.max(np.abs(following - x) / scale) <= ROUND_OFF:  # nothing more will come
                return self._settled(t, H, Iterate(x, residual, converged=True), best, states, report)
            x = following
            if not np.all(np.abs(x) <= limit):
                break
        return best

    def _settled(
        self, t: float, H: float, end: Iterate, best: Iterate, states: list[SavedState], report: StepReport
    ) -> Iterate:
        """Return where an iteration ends that moves no more above the tolerance: `end`, if that is noise, else `best`.

        The correction may have stepped components elsewhere: all are stepped once more from there. What such a step makes is
        round-off, which no correction takes out: the budget is not asked.
        """
        if end.residual > NOISE or self._residual(t, H, end.x, states, report) is None:
            return best
        return end

    def _begin(self, t: float, H: float, x: np.ndarray, states: list[SavedState]) -> None:
        """Prepare for the iteration of a step that starts at the unknowns `x`."""
        self.accelerator.begin(H, self.scale.update(x, H))

    def _correct(self, t: float, H: float, x: np.ndarray, r: np.ndarray, states: list[SavedState]) -> np.ndarray:
        """Return the next iterate."""
        return self.accelerator.propose(x, r)

    def _hold(self, t: float, H: float, best: Iterate, states: list[SavedState], report: StepReport) -> None:
        """Last resort: make the step with the best iterate, held (the rates of loads zero) if it is not even near."""
        x = best.x.copy()
        if not best.near:
            x[np.isin(self.places, self.loads.fed[:, 1])] = 0.0
        if self._residual(t, H, x, states, report) is None:
            raise self.failure or AssertionError
        self.x = x

    def _residual(
        self, t: float, H: float, x: np.ndarray, states: list[SavedState] | None, report: StepReport
    ) -> np.ndarray | None:
        """Step all components with the unknowns `x`; return S(x) - x, or None if that cannot be done."""
        report.iterations += 1
        try:
            if states is not None:
                self.graph.restore(states)
            self._evaluate(t, H, x)
        except FmuError as error:
            if not error.recoverable:
                raise
            self.failure = error
            return None
        return self.graph.gathered(self.places) - x

    def _evaluate(self, t: float, H: float, x: np.ndarray) -> None:
        graph = self.graph
        graph.u[self.places] = x

        def begin(node: Node) -> None:
            node.receive(graph.y)
            begin_node(self.between, node, t, H)

        self.crew.round(begin, lambda node: finish_node(node, t, H))
