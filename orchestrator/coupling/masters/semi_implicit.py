"""Semi-implicit: predict, correct once by a Newton step, done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.accelerator import Accelerator
from orchestrator.coupling.stepping.bounds import Positive, PositiveCount
from orchestrator.coupling.stepping.implicit import Implicit
from orchestrator.coupling.stepping.report import StepReport


class SemiImplicit(Implicit):
    """Predictor-corrector with one correction: two steps of every component a macro step, whatever the
    stiffness.

    The components are stepped with the predicted unknowns x; with the interface Jacobian dr/dx, made by
    differences with rollback, x ← x - (dr/dx)⁻¹ r; they are rolled back and stepped once more. The residual
    that is left is reported; a step counts as converged if it is below `tolerance`. The Jacobian is made
    anew when the residual exceeds it, at most once in `refresh` steps. It is not sub-divided.

    Order: that of the exchange for linear coupling. Stability: that of the exchange for linear coupling.
    When: smooth coupling and a fixed budget. Reference: Schweizer & Lu, Archive of Applied Mechanics 84
    (2014) 1817-1841; Multibody System Dynamics 34 (2015) 197-226.

    Parameters
    ----------
    refresh : macro steps that a Jacobian serves at least
    difference : step of the differences, relative to the magnitude of the unknown (at least 1 in its unit)
    options : those of `Implicit`
    """

    NAME: ClassVar[str] = "semi_implicit"
    TITLE: ClassVar[str] = "implicit with a single Newton correction, two steps a macro step"

    def __init__(
        self,
        graph: Graph,
        *,
        tolerance: Positive = 1e-3,
        refresh: PositiveCount = 20,
        difference: Positive = 1e-3,
        **options: Any,
    ):
        super().__init__(graph, Accelerator(), tolerance=tolerance, **options)
        self.refresh, self.difference = refresh, difference

    def start(self, t: float) -> None:
        """Prepare for the first step."""
        super().start(t)
        self.jacobians: dict[float, np.ndarray] = {}
        self.age, self.wanted = 0, False

    def attempt(self, t: float, H: float, report: StepReport, *, last: bool) -> bool:
        """Make one step, whatever residual it leaves."""
        self.graph.exchange_discrete()
        self.x, residual = self._corrected(t, H, self.predictor.predict(t + H / 2, self.x), report)
        self.wanted = residual > self.tolerance
        report.residual = max(report.residual, residual)
        report.converged &= not self.wanted
        self._accept(t, H)
        return True

    def trial(
        self, t: float, H: float, x: np.ndarray, tolerance: float, enough: Callable[[], bool], report: StepReport
    ) -> bool:
        """Make one step from the unknowns `x` (n,) on, for its outputs alone."""
        self.graph.exchange_discrete()
        self._corrected(t, H, x, report)
        return True

    def _corrected(self, t: float, H: float, x: np.ndarray, report: StepReport) -> tuple[np.ndarray, float]:
        """Step all components with the unknowns `x` (n,) and once more with better ones; return those, and the residual."""
        states = self.graph.save()
        try:
            self.between.begin()
            self.scale.update(x, H)
            r = self._required(t, H, x, None, report)
            self.age += 1
            if H not in self.jacobians or (self.wanted and self.age >= self.refresh):
                self._differentiate(t, H, x, r, states, report)
            x = x - np.linalg.lstsq(self.jacobians[H], r, rcond=None)[0]
            r = self._required(t, H, x, states, report)
        finally:
            self.graph.release(states)
        return x, self.scale.norm(r, x, H)

    def _required(
        self, t: float, H: float, x: np.ndarray, states: list[SavedState] | None, report: StepReport
    ) -> np.ndarray:
        """Return the residual; a component that cannot make the step ends the run."""
        r = self._residual(t, H, x, states, report)
        if r is None:
            raise self.failure or AssertionError
        return r

    def _differentiate(
        self, t: float, H: float, x: np.ndarray, r: np.ndarray, states: list[SavedState], report: StepReport
    ) -> None:
        steps = self.difference * np.maximum(np.abs(x), 1.0)
        jacobian = np.empty((x.size, x.size))
        for j, step in enumerate(steps):
            shifted = x.copy()
            shifted[j] += step
            jacobian[:, j] = (self._required(t, H, shifted, states, report) - r) / step
        self.jacobians[H], self.age = jacobian, 0
