"""What all masters are: something that advances a graph by a macro step and reports on it."""

from __future__ import annotations

from typing import ClassVar

from orchestrator.coupling.errors import FORWARD
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.parallel import Crew
from orchestrator.coupling.stepping.report import StepReport


class Master:
    """Base of all masters: advances every component of a graph from one communication point to the next.

    Attributes
    ----------
    NAME : key in `MASTERS`
    TITLE : one line
    IMPLICIT : True if steps are repeated, so that every FMU needs rollback
    crew : makes the rounds over the components, in threads where it pays
    """

    NAME: ClassVar[str] = ""
    TITLE: ClassVar[str] = ""
    IMPLICIT: ClassVar[bool] = False

    def __init__(self, graph: Graph, *, parallel: str = "never", sequential: bool = True):
        self.graph = graph
        self.crew = Crew(graph, parallel, sequential=sequential)

    def start(self, t: float) -> None:
        """Prepare for the first step, after `graph.initialize`."""

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        raise NotImplementedError

    def finish(self) -> None:
        """The run has ended, well or not: end its threads."""
        self.crew.close()


def require_rollback(graph: Graph, master: str) -> None:
    """Raise `GraphError` if a component cannot be rolled back."""
    stuck = [node.name for node in graph.nodes if not node.fmu.capabilities.rollback]
    if stuck:
        raise GraphError(
            f"master {master}: {', '.join(stuck)} cannot save its state (canGetAndSetFMUstate is false); {FORWARD}"
        )
