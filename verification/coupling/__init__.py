"""Studies of the coupling: how wrong a coupled run is, what that costs, and what it knows of it."""

from types import ModuleType

from verification.coupling import catalogue, estimate, work_precision

STUDIES: tuple[ModuleType, ...] = (estimate, work_precision, catalogue)
