"""Studies of the cable."""

from types import ModuleType

from verification.cable import large_rotation, point_mass, statics, time_steps, vibration

STUDIES: tuple[ModuleType, ...] = (statics, large_rotation, vibration, time_steps, point_mass)
