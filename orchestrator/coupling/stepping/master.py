"""What all masters share: the report of a macro step, the history of the inputs and its extrapolation."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import ClassVar

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import GraphError
from orchestrator.coupling.stepping.parallel import Crew


@dataclass(slots=True)
class StepReport:
    """One macro step.

    Attributes
    ----------
    time : s, its end
    iterations : times the components were stepped over it (sub-steps all counted)
    residual : largest relative interface residual it was left with
    subdivisions : sub-steps beyond the first
    rejected : sub-steps rolled back, because they did not converge or their error was too large
    columns : least-squares columns kept, 0 where there are none
    converged : False if any part of it did not reach the tolerance
    estimate : a-posteriori error estimate, nan where none is made
    power_residual : W, largest difference of the powers on both sides of an interface, nan where none is booked
    """

    time: float
    iterations: int = 1
    residual: float = 0.0
    subdivisions: int = 0
    rejected: int = 0
    columns: int = 0
    converged: bool = True
    estimate: float = nan
    power_residual: float = nan


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
            f"master {master}: {', '.join(stuck)} cannot save its state (canGetAndSetFMUstate is false); "
            "choose an explicit master or reduced_interface"
        )
