"""What `orchestrator.coupling` offers, and where each of it lives; that package imports this one when it is used."""

from __future__ import annotations

from orchestrator.coupling.course import Course as Course
from orchestrator.coupling.course import read_courses as read_courses
from orchestrator.coupling.errors import InputError as InputError
from orchestrator.coupling.fmu.failure import FmuError as FmuError
from orchestrator.coupling.fmu.instance import Fmu as Fmu
from orchestrator.coupling.fmu.sub_steps import SubStepped as SubStepped
from orchestrator.coupling.graph.graph import Graph as Graph
from orchestrator.coupling.graph.links import Connection as Connection
from orchestrator.coupling.graph.links import GraphError as GraphError
from orchestrator.coupling.masters import MASTERS as MASTERS
from orchestrator.coupling.masters.aitken import Aitken as Aitken
from orchestrator.coupling.masters.anderson import Anderson as Anderson
from orchestrator.coupling.masters.fixed_point import FixedPoint as FixedPoint
from orchestrator.coupling.masters.gauss_seidel import GaussSeidel as GaussSeidel
from orchestrator.coupling.masters.interface_jacobian import InterfaceJacobian as InterfaceJacobian
from orchestrator.coupling.masters.iqn_ils import IqnIls as IqnIls
from orchestrator.coupling.masters.jacobi import Jacobi as Jacobi
from orchestrator.coupling.masters.nepce import Nepce as Nepce
from orchestrator.coupling.masters.reduced_interface import ReducedInterface as ReducedInterface
from orchestrator.coupling.masters.semi_implicit import SemiImplicit as SemiImplicit
from orchestrator.coupling.run.compare import SignalError as SignalError
from orchestrator.coupling.run.compare import observed_order as observed_order
from orchestrator.coupling.run.compare import signal_errors as signal_errors
from orchestrator.coupling.run.interval import Interval as Interval
from orchestrator.coupling.run.log import Log as Log
from orchestrator.coupling.run.results import Table as Table
from orchestrator.coupling.run.results import read_table as read_table
from orchestrator.coupling.run.simulate import simulate as simulate
from orchestrator.coupling.stepping.accelerator import Accelerator as Accelerator
from orchestrator.coupling.stepping.implicit import Implicit as Implicit
from orchestrator.coupling.stepping.master import Master as Master
from orchestrator.coupling.stepping.report import StepReport as StepReport
