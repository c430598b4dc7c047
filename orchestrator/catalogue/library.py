"""Our own FMUs: built when they are missing or older than their sources, and only then."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from fmus.module.recipe import FmuRecipe
from orchestrator.catalogue.robot_spec import RobotSpec, catalogue
from orchestrator.coupling.errors import InputError

FOLDER = Path(os.environ.get("LINE_LANDING_FMUS", "fmu"))
"""Where runs look for our FMUs and build them."""
MODULES = ("cable", "contact", "oscillator")
"""Our modules with one FMU each; robots have one for each entry of the catalogue."""


def cable_fmu() -> Path:
    """Return the FMU of the cable, up to date."""
    return module_fmu("cable")


def contact_fmu() -> Path:
    """Return the FMU of the contact, up to date."""
    return module_fmu("contact")


def module_fmu(name: str) -> Path:
    """Return the FMU of one of `MODULES`, up to date."""
    return _ensured(module_recipe(name), FOLDER)


def robot_fmu(robot: RobotSpec) -> Path:
    """Return the FMU of a robot, up to date."""
    return _ensured(robot_recipe(robot), FOLDER)


def module_recipe(name: str) -> FmuRecipe:
    """Return the recipe of one of `MODULES`."""
    return import_module(f"fmus.{name}.{name}_fmu").RECIPE


def robot_recipe(robot: RobotSpec) -> FmuRecipe:
    """Return the recipe of a robot."""
    from fmus.robot.robot_fmu import robot_recipe

    return robot_recipe(robot.fmu_name, robot.n_wheels, robot.parameters, robot.title)


def build_all(folder: Path) -> Iterator[Path]:
    """Build the FMUs of all modules and of every robot of the catalogue; yield each when it is there."""
    for recipe in (*map(module_recipe, MODULES), *map(robot_recipe, catalogue().values())):
        yield _ensured(recipe, folder)


def _ensured(recipe: FmuRecipe, folder: Path) -> Path:
    from fmus.face.build import ensure_fmu

    try:
        folder.mkdir(parents=True, exist_ok=True)
        return ensure_fmu(recipe, folder)
    except OSError as error:
        cure = "choose a folder to write to with LINE_LANDING_FMUS (`build`: --out)"
        raise InputError(f"{folder}: the FMU {recipe.name} cannot be built there ({error.strerror}); {cure}") from None
