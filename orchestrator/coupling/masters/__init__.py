"""The masters, one a file; `MASTERS` names what can be chosen."""

from __future__ import annotations

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

__all__ = ["MASTERS", "Master", "StepReport"]
