"""From a landing to the modules of the monolithic reference, which stand for its FMUs where they can."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.cable.module import Cable
from fmus.module.variables import VariableTable
from fmus.robot.module import Robot
from orchestrator.landing.resolve import Landing, Variables, cable_module, contact_module, resolve, robot_module
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
    return Problem(cable, robot, contacts, landing.robot.courses)


def has_monolithic(landing: Landing) -> bool:
    """Return whether the monolithic solver can stand for the landing's FMUs, foreign ones included."""
    if landing.contact.foreign is not None:
        return False
    known = landing.sources.variables
    tables = {"cable": Cable.table, "robot": Robot(landing.n_wheels).table}
    if any(name not in tables["robot"].index for name in landing.robot.courses):
        return False
    return all(_suffice(known[name], table) for name, table in tables.items())


def _suffice(known: Variables, table: VariableTable) -> bool:
    needed = [n for n in table.names("parameter") if not any(part in n for part in NOT_NEEDED)]
    return all(name in known for name in needed)
