"""A massless bumper between two masses: contact along one axis, the smallest thing with a touch in it."""

from fmus.module.registry import ModuleEntry

BUMPER = ModuleEntry("bumper", "benchmarks.pack.bumper.module:Bumper", "Bumper between two masses")
