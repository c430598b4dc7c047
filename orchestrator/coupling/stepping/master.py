"""What all masters are: something that advances a graph by a macro step and reports on it."""

from __future__ import annotations

from typing import ClassVar

from orchestrator.coupling.errors import FORWARD
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.parallel import Crew
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.work import Work


class Master:
    """Base of all masters: advances every component of a graph from one communication point to the next.

    Attributes
    ----------
    NAME : key in `MASTERS`
    TITLE : one line
    IMPLICIT : True if steps are repeated, so that every FMU needs rollback
    work : books the work through the interfaces, from the start to the end of a run
    crew : makes the rounds over the components, in threads where it pays
    """

    NAME: ClassVar[str] = ""
    TITLE: ClassVar[str] = ""
    IMPLICIT: ClassVar[bool] = False

    def __init__(self, graph: Graph, *, parallel: str = "never", sequential: bool = True):
        self.graph = graph
        self.work = Work(graph)
        self.crew = Crew(graph, parallel, sequential=sequential)

    def start(self, t: float) -> None:
        """Prepare for the first step, after `graph.initialize`."""

    def keep_books(self) -> None:
        """Begin to book the work through the interfaces, unless that is done already."""
        if self.work.names and self.work not in self.graph.observers:
            self.work.start()
            self.graph.observers.append(self.work)

    def step(self, t: float, H: float) -> StepReport:
        """Advance all components from `t` to `t + H`."""
        raise NotImplementedError

    def finish(self) -> None:
        """The run has ended, well or not: end its threads and its books."""
        if self.work in self.graph.observers:
            self.graph.observers.remove(self.work)
        self.crew.close()


def require_rollback(graph: Graph, master: str) -> None:
    """Raise `GraphError` if a component cannot be rolled back."""
    stuck = [node.name for node in graph.nodes if not node.fmu.capabilities.rollback]
    if stuck:
        raise GraphError(
            f"master {master}: {', '.join(stuck)} cannot save its state (canGetAndSetFMUstate is false); {FORWARD}"
        )
