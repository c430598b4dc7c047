"""NEPCE: extrapolation that makes good, in the next step, what it got wrong in the last."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters.jacobi import Jacobi
from orchestrator.coupling.stepping.report import StepReport


class Nepce(Jacobi):
    """Explicit; Jacobi, the impulse that the extrapolation got wrong in a step is added in the next one.

    With b_n the mean of the extrapolation over step n and (u_n + u_{n+1})/2 the mean it should have been,
    the input held in step n + 1 is b_{n+1} + alpha ((u_n + u_{n+1})/2 - b_n). With alpha = 1 the sum over
    all steps telescopes: only the last step's error is open, so energy does not pile up at the interface
    (*nearly energy-preserving*).

    Order: 2. Stability: explicit, H < 2/omega at most. When: FMUs without rollback and weakly damped motion.
    Reference: Benedikt, Watzenig, Zehetner & Hofer, Int. Conf. Coupled Problems (2013); Sadjina et al.,
    Engineering with Computers 33 (2017) 607-620 (power residual).

    Parameters
    ----------
    extrapolation : degree of b, 0, 1 or 2
    alpha : share of the error that is made good
    parallel : see `Jacobi`
    """

    NAME: ClassVar[str] = "nepce"
    TITLE: ClassVar[str] = "explicit, all components at once, coupling error of the last step compensated"

    def __init__(self, graph: Graph, *, extrapolation: int = 0, alpha: float = 1.0, parallel: str = "auto"):
        super().__init__(graph, extrapolation=extrapolation, parallel=parallel)
        self.alpha = alpha

    def start(self, t: float) -> None:
        """Forget earlier steps."""
        super().start(t)
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        graph = self.graph
        graph.communicate()
        true = graph.u.copy()
        self._extrapolate(t, H)
        base = graph.u.copy()
        if self.last is not None:
            before, extrapolated = self.last
            graph.u += self.alpha * (0.5 * (before + true) - extrapolated)
        self.last = true, base
        self._step_all(t, H)
        return StepReport(t + H)
