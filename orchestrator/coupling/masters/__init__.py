"""The masters, one a file; `MASTERS` names what can be chosen."""

from __future__ import annotations

from orchestrator.coupling.errors import nearest
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters.aitken import Aitken
from orchestrator.coupling.masters.anderson import Anderson
from orchestrator.coupling.masters.fixed_point import FixedPoint
from orchestrator.coupling.masters.gauss_seidel import GaussSeidel
from orchestrator.coupling.masters.interface_jacobian import InterfaceJacobian
from orchestrator.coupling.masters.iqn_ils import IqnIls
from orchestrator.coupling.masters.jacobi import Jacobi
from orchestrator.coupling.masters.nepce import Nepce
from orchestrator.coupling.masters.reduced_interface import ReducedInterface
from orchestrator.coupling.masters.semi_implicit import SemiImplicit
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport

MASTERS: dict[str, type[Master]] = {
    "jacobi": Jacobi,
    "gauss_seidel": GaussSeidel,
    "nepce": Nepce,
    "fixed_point": FixedPoint,
    "aitken": Aitken,
    "anderson": Anderson,
    "iqn_ils": IqnIls,
    "interface_jacobian": InterfaceJacobian,
    "semi_implicit": SemiImplicit,
    "reduced_interface": ReducedInterface,
}


def made_for(graph: Graph, master: Master | type[Master] | str) -> Master:
    """Return `master` itself, or one of that class or name for `graph`, with default options.

    Raises
    ------
    ValueError
        if there is no such master, it was made for another graph, or it cannot couple these FMUs
    """
    if isinstance(master, str):
        if master not in MASTERS:
            raise ValueError(f"master {master!r}: choose {', '.join(MASTERS)}{nearest(master, MASTERS)}")
        master = MASTERS[master]
    if isinstance(master, type):
        return master(graph)
    if master.graph is not graph:
        raise ValueError(f"master {master.NAME}: was made for another graph; make it for the one that is run")
    return master


__all__ = ["MASTERS", "Master", "StepReport", "made_for"]
