"""The masters, one a file; `MASTERS` names what can be chosen."""

from orchestrator.masters.aitken import Aitken
from orchestrator.masters.anderson import Anderson
from orchestrator.masters.base import Master, StepReport
from orchestrator.masters.fixed_point import FixedPoint
from orchestrator.masters.gauss_seidel import GaussSeidel
from orchestrator.masters.interface_jacobian import InterfaceJacobian
from orchestrator.masters.iqn_ils import IqnIls
from orchestrator.masters.jacobi import Jacobi
from orchestrator.masters.nepce import Nepce
from orchestrator.masters.reduced_interface import ReducedInterface
from orchestrator.masters.semi_implicit import SemiImplicit

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
