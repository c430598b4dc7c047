"""Which FMUs of a scenario live in processes of their own, and within which limits."""

from __future__ import annotations

from orchestrator.coupling.fmu.isolated import Limits
from orchestrator.scenario.types import (
    CableSection,
    Component,
    ContactSection,
    ControllerSection,
    RobotSection,
    Simulation,
)

Isolatable = CableSection | RobotSection | ContactSection | ControllerSection | Component


def is_isolated(section: Isolatable) -> bool:
    """Return whether the FMU of a section lives in a process of its own: as it says, else whether it is a foreign one."""
    return section.fmu is not None if section.isolate is None else section.isolate


def isolation(section: Isolatable, simulation: Simulation) -> Limits | bool:
    """Return the limits of the process of a section's FMU; False where it lives in ours."""
    return is_isolated(section) and Limits(simulation.timeout, simulation.memory_limit, simulation.file_limit)
