"""Our own FMUs: built when they are missing or older than their sources, and only then.

Runs keep them in a cache of the user's, or in the folder that ``LINE_LANDING_FMUS`` names.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from fmus.kernels.cache import prune, used, user_folder
from fmus.module import registry
from fmus.module.recipe import FmuRecipe
from orchestrator.catalogue.robot_spec import RobotSpec, catalogue
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.scratch import remove_left_overs, remove_parts


def module_fmu(name: str) -> Path:
    """Return the FMU of a module of the registry, up to date."""
    return kept([module_recipe(name)])[0]


def module_recipe(name: str) -> FmuRecipe:
    """Return the recipe of a module of the registry."""
    return registry.find(name).recipe()


def robot_fmu(robot: RobotSpec) -> Path:
    """Return the FMU of a robot, up to date."""
    return kept([robot_recipe(robot)])[0]


def robot_recipe(robot: RobotSpec) -> FmuRecipe:
    """Return the recipe of a robot."""
    wheels = {"n_wheels": robot.n_wheels}
    return registry.find("robot").recipe(robot.fmu_name, robot.title, wheels, robot.parameters)


def build_all(folder: Path | None) -> list[Path]:
    """Build the FMUs of all modules and of every robot of the catalogue in `folder`.

    None: where runs keep them, and all is made ready for a landing, compiled kernels too.
    """
    from fmus.face.build import ensure_all, plain
    from fmus.face.first_use import compile_modules

    remove_left_overs()
    ours = [module_recipe(key) for key in registry.OURS if key != "robot"]  # robots: those of the catalogue
    recipes = (*ours, *map(robot_recipe, catalogue().values()))
    if folder is None:
        compile_modules()
        return kept(recipes)
    return _within(folder, lambda: ensure_all(plain(recipe, folder) for recipe in recipes))


def kept(recipes: Iterable[FmuRecipe]) -> list[Path]:
    """Return the FMUs of `recipes` where runs keep them, up to date."""
    from fmus.face import build

    folder = _folder()
    return [used(p) for p in _within(folder, lambda: build.ensure_all(build.kept(r, folder) for r in recipes))]


def _folder() -> Path:
    """Return where runs keep FMUs; from the cache old ones are removed."""
    given = os.environ.get("LINE_LANDING_FMUS")
    if given:
        return Path(given)
    try:
        folder = user_folder("fmus")
    except OSError as error:
        raise InputError(str(error)) from None
    prune(folder)
    return folder


def _within(folder: Path, build: Callable[[], list[Path]]) -> list[Path]:
    try:
        if folder.is_dir():
            remove_parts(folder)
        return build()
    except OSError as error:
        cure = "choose a folder to write to with LINE_LANDING_FMUS (`build`: --out)"
        raise InputError(f"{folder}: FMUs cannot be built there ({error.strerror}); {cure}") from None
