"""A robot that is made heavier or lighter: its inertia goes with the mass, unless the scenario gives it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from orchestrator.catalogue.documents import Document
from orchestrator.catalogue.robot_spec import RobotSpec, load_robot
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.types import LandingScenario, Provenance

MASS = "robot.parameters.mass"
SCALED = "inertia scaled by"
"""How the reason of an inertia begins that was found from the mass."""
DIAGONAL = {"inertia.xx", "inertia.yy", "inertia.zz"}


def scale_inertia(plain: Document, provenance: dict[str, Provenance]) -> list[str]:
    """Give the robot of `plain`, whose mass the scenario gives, the inertia that goes with it; return what is to be said.

    The shape and the centre of mass are kept, every part becomes heavier by the same factor; so does the inertia about the
    centre of mass. A free wheel's own spin inertia stays: the wheel is a part of its own. What a foreign FMU holds is not
    known, and what the scenario gives itself is not touched.
    """
    robot = plain.get("robot")
    parameters = robot.get("parameters") if isinstance(robot, dict) else None
    if not isinstance(robot, dict) or not isinstance(parameters, dict) or "mass" not in parameters:
        return []
    given = sorted(name for name in parameters if name.startswith("inertia."))
    if given:
        partly = not set(given) >= DIAGONAL
        return [f"{MASS}: the inertia is not scaled with the mass, since {', '.join(given)} is given"] if partly else []
    if isinstance(robot.get("fmu"), str):
        return [f"{MASS}: the inertia of {Path(robot['fmu']).name} is not scaled with the mass; give inertia.* as well"]
    spec, mass = _robot(robot.get("model")), parameters["mass"]
    if spec is None or not _is_mass(mass) or mass == spec.parameters["mass"]:
        return []
    ratio = mass / float(spec.parameters["mass"])
    said = f"{SCALED} {ratio:.4g} with the mass"
    for name, value in spec.parameters.items():
        if name.startswith("inertia."):
            parameters[name] = ratio * value
            provenance[f"robot.parameters.{name}"] = Provenance(spec.name, said)
    return [f"{MASS}: {said}"]


def goes_with_mass(scenario: LandingScenario) -> bool:
    """Return whether another mass would bring another inertia: not where the scenario gives that, or of a foreign FMU."""
    names = [f"robot.parameters.{name}" for name in scenario.robot.parameters if name.startswith("inertia.")]
    found = all(scenario.provenance.get(name, Provenance()).reason.startswith(SCALED) for name in names)
    return scenario.robot.fmu is None and found


def _robot(model: Any) -> RobotSpec | None:
    try:
        return load_robot(model) if isinstance(model, str) else None
    except InputError:
        return None  # the check says what is wrong with it


def _is_mass(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value <= sys.float_info.max
