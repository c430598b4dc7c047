"""Jacobi: all components step from the same communication point."""

from __future__ import annotations

from typing import ClassVar

from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.stepping.interpolation import History, Loads
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport


class Jacobi(Master):
    r"""Explicit, parallel: every input is extrapolated over the macro step from its past values.

    With p the polynomial of degree k through u(t), u(t - H), …, a component receives the mean of p over the
    step, and the slope 12/H² ∫ p (tau - t - H/2) dtau where it has an input
    for it (``force_rate``). k = 0 is the classical held input. Outputs that depend on inputs without a step are read at t + H
    with the inputs of t + H (docs/concepts/masters.md has the algorithm, and what other engines do differently).

    Order: k + 1, but at most 2 where an FMU has no input for the slope. Stability: explicit; about H <
    2/omega of the stiffest coupling at k = 0, less for larger k; none without damping. When: coupling by
    soft elements, FMUs without rollback, a first look. Reference: Kübler & Schiehlen, Multibody System
    Dynamics 4 (2000) 107-127; Busch, ZAMM 96 (2016) 1061-1081.

    Parameters
    ----------
    extrapolation : degree k, 0, 1 or 2
    parallel : components in threads: ``auto`` (where it pays), ``always`` or ``never``
    """

    NAME: ClassVar[str] = "jacobi"
    TITLE: ClassVar[str] = "explicit, all components at once, inputs extrapolated"

    def __init__(self, graph: Graph, *, extrapolation: int = 0, parallel: str = "auto"):
        super().__init__(graph, parallel=parallel, sequential=False)
        self.history = History(extrapolation)
        self.loads = Loads(graph)

    def start(self, t: float) -> None:
        """Forget earlier steps."""
        self.history.clear()

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        self.graph.communicate()
        if self.history.order:
            self._extrapolate(t, H)
        self._step_all(t, H)
        return StepReport(t + H)

    def _extrapolate(self, t: float, H: float) -> None:
        self.history.append(t, self.graph.u)
        extrapolate(self.graph, self.loads, self.history, t, H)

    def _step_all(self, t: float, H: float) -> None:
        """Step with the inputs that are in the graph, then move the outputs."""
        graph = self.graph

        def begin(node: Node) -> None:
            if node.inputs.names:
                node.inputs.set()
            if node.rates.names:
                node.rates.set()
            node.fmu.begin(t, H)

        self.crew.round(begin, lambda node: node.fmu.step(t, H))
        graph.acted[:] = graph.u
        graph.refresh()
        if graph.observers:
            graph.accepted(t, H)


def extrapolate(graph: Graph, loads: Loads, history: History, t: float, H: float) -> None:
    """Write mean and slope of the extrapolated inputs over [t, t + H] into the graph."""
    c, a, b = history.coefficients(t, H)
    graph.u[:] = c + a / 2 + b / 3
    slope = (a + b) / H
    graph.u[loads.fed[:, 1]] = slope[loads.fed[:, 0]]
    graph.r[:] = slope[graph.rate_of]
