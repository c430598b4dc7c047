"""Gauss–Seidel: components step one after the other and see what the earlier ones have become."""

from __future__ import annotations

from typing import ClassVar

from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.masters.jacobi import extrapolate
from orchestrator.coupling.stepping.interpolation import Between, History, Loads, begin_node, finish_node
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport


class GaussSeidel(Master):
    """Explicit, sequential: inputs from components earlier in the order are known at the end of the step.

    Inputs from later components are extrapolated (degree k) as in Jacobi. Inputs from earlier ones are held
    at their value at t + H for k = 0, and interpolated between t and t + H for k > 0 (values at an instant
    alone: means, and motions that come with a mean, are passed on).

    Order: k + 1, at most 2. Stability: explicit; with k = 0 in a displacement-force loop it is the
    symplectic Euler coupling, H < 2/omega, without drift of the energy. When: one component much stiffer or
    faster than the others, put last; FMUs without rollback. Reference: Kübler & Schiehlen, Multibody System
    Dynamics 4 (2000) 107-127; Busch, ZAMM 96 (2016) 1061-1081.

    Parameters
    ----------
    extrapolation : degree k, 0, 1 or 2
    parallel : components that need nothing of one another in threads: ``auto`` (where it pays), ``always`` or ``never``
    """

    NAME: ClassVar[str] = "gauss_seidel"
    TITLE: ClassVar[str] = "explicit, one component after the other, inputs extrapolated"

    def __init__(self, graph: Graph, *, extrapolation: int = 0, parallel: str = "auto"):
        super().__init__(graph, parallel=parallel)
        self.history = History(extrapolation)
        self.loads = Loads(graph)
        self.between = Between(graph, self.loads, torn=False)

    def start(self, t: float) -> None:
        """Forget earlier steps."""
        self.history.clear()

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        graph = self.graph
        graph.communicate()
        if self.history.order:
            self.history.append(t, graph.u)
            self.between.begin()
            extrapolate(graph, self.loads, self.history, t, H)
        between = self.between if self.history.order else None

        def begin(node: Node) -> None:
            if node.forward.size:
                node.receive(graph.y)
            begin_node(between, node, t, H)

        self.crew.round(begin, lambda node: finish_node(node, t, H))
        graph.refresh()
        if graph.observers:
            graph.accepted(t, H)
        return StepReport(t + H)
