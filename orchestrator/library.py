"""Our own FMUs: built when they are missing or older than their sources, and only then."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from fmus.recipe import FmuRecipe
from orchestrator.robots import RobotSpec, catalogue

FOLDER = Path(os.environ.get("LINE_LANDING_FMUS", "fmu"))
"""Where runs look for our FMUs and build them."""


def cable_fmu() -> Path:
    """Return the FMU of the cable, up to date."""
    from fmus.cable.cable_fmu import RECIPE

    return _ensured(RECIPE)


def contact_fmu() -> Path:
    """Return the FMU of the contact, up to date."""
    from fmus.contact.contact_fmu import RECIPE

    return _ensured(RECIPE)


def robot_fmu(robot: RobotSpec) -> Path:
    """Return the FMU of a robot of the catalogue, up to date."""
    return _ensured(robot_recipe(robot))


def robot_recipe(robot: RobotSpec) -> FmuRecipe:
    """Return the recipe of a robot of the catalogue."""
    from fmus.robot.robot_fmu import robot_recipe

    return robot_recipe(robot.name, robot.n_wheels, robot.parameters, robot.title)


def build_all(folder: Path) -> Iterator[Path]:
    """Build the FMUs of cable, contact and every robot of the catalogue; yield each when it is there."""
    from fmus.build import ensure_fmu
    from fmus.cable.cable_fmu import RECIPE as CABLE
    from fmus.contact.contact_fmu import RECIPE as CONTACT

    folder.mkdir(parents=True, exist_ok=True)
    for recipe in (CABLE, CONTACT, *map(robot_recipe, catalogue().values())):
        yield ensure_fmu(recipe, folder)


def _ensured(recipe: FmuRecipe) -> Path:
    from fmus.build import ensure_fmu

    FOLDER.mkdir(parents=True, exist_ok=True)
    return ensure_fmu(recipe, FOLDER)
