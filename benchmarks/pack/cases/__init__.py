"""The cases: a scenario (TOML) and a file that says what of it is compared, each."""

from benchmarks.pack.bumper import BUMPER
from benchmarks.pack.cases import (
    chain,
    drop,
    drop_hard,
    flagship,
    oscillator_impact,
    oscillator_soft,
    oscillator_stiff,
    rig_driving,
)
from fmus.module.registry import register

register(BUMPER)
_MODULES = (oscillator_soft, oscillator_stiff, oscillator_impact, chain, flagship, rig_driving, drop, drop_hard)
CASES = {module.CASE.name: module.CASE for module in _MODULES}
"""By name, the simple ones first."""
