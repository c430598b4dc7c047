"""Studies of the whole system: cable, robot and contact together, coupled and monolithic."""

from types import ModuleType

from verification.system import convergence, energy, estimate, friction, whole_error

STUDIES: tuple[ModuleType, ...] = (energy, estimate, whole_error, convergence, friction)
