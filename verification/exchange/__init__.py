"""Studies of the exchange between the FMUs within a macro step."""

from types import ModuleType

from verification.exchange import drop, moments, rolling, smooth

STUDIES: tuple[ModuleType, ...] = (moments, smooth, rolling, drop)
