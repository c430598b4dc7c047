"""The masters, one a file; `MASTERS` names what can be chosen."""

from orchestrator.masters.base import Master, StepReport
from orchestrator.masters.gauss_seidel import GaussSeidel
from orchestrator.masters.interface_jacobian import InterfaceJacobian
from orchestrator.masters.iqn_ils import IqnIls
from orchestrator.masters.jacobi import Jacobi

MASTERS: dict[str, type[Master]] = {
    "jacobi": Jacobi,
    "gauss_seidel": GaussSeidel,
    "iqn_ils": IqnIls,
    "interface_jacobian": InterfaceJacobian,
}

__all__ = ["MASTERS", "Master", "StepReport"]
