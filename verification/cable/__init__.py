"""Studies of the cable."""

from types import ModuleType

STUDIES: tuple[ModuleType, ...] = ()
