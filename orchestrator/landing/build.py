"""From a landing to the modules of the monolithic reference, which stand for its FMUs where they can."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.cable.module import Cable
from fmus.module.variables import VariableTable
from fmus.robot.module import Robot
from orchestrator.landing.resolve import (
    SAMPLE_TIME,
    Landing,
    Variables,
    cable_module,
    contact_module,
    controller_module,
    resolve,
    robot_module,
)
from orchestrator.scenario.types import LandingScenario

if TYPE_CHECKING:
    from orchestrator.landing.monolithic import Problem

NOT_NEEDED = ("initial.", ".braked", ".inertia", ".axle_", "integration_step", "n_wheels", "center_of_mass")
"""Robot parameters that a reference takes at their defaults where a foreign robot does not have them."""


def problem(landing: Landing | LandingScenario) -> Problem:
    """Return new initialised modules for the monolithic solver; a scenario is resolved first."""
    from orchestrator.landing.monolithic import Problem

    if not isinstance(landing, Landing):
        landing = resolve(landing)
    cable, robot = cable_module(landing.cable), robot_module(landing.robot, landing.n_wheels)
    robot.initialize(0.0)
    contacts = [contact_module(landing.contact, s) for s in landing.placement.arc_lengths]
    flown = landing.controller is not None and _samples(landing)
    controller = controller_module(landing) if flown else None
    return Problem(cable, robot, contacts, landing.robot.courses, controller)


def has_monolithic(landing: Landing) -> bool:
    """Return whether the monolithic solver can stand for the landing's FMUs, foreign ones included."""
    if landing.contact.foreign is not None or not _samples(landing):
        return False
    known = landing.sources.variables
    tables = {"cable": Cable.table, "robot": Robot(landing.n_wheels).table}
    if any(name not in tables["robot"].index for name in landing.robot.courses):
        return False
    return all(_suffice(known[name], table) for name, table in tables.items())


def _samples(landing: Landing) -> bool:
    """Return whether what flies the robot, if anything does, is a module whose commands are held between its instants."""
    if landing.controller is None:
        return True
    known = landing.sources.variables["controller"]
    outputs = [v for v in known.values() if v.causality == "output"]
    return landing.controller.foreign is None and SAMPLE_TIME in known and all(v.discrete for v in outputs)


def _suffice(known: Variables, table: VariableTable) -> bool:
    needed = [n for n in table.names("parameter") if not any(part in n for part in NOT_NEEDED)]
    return all(name in known for name in needed)
