"""Studies of the cable."""

from types import ModuleType

from verification.cable import statics

STUDIES: tuple[ModuleType, ...] = (statics,)
