"""The FMU of a robot: one recipe a robot, since the number of wheels decides which variables there are."""

from collections.abc import Mapping

from fmus.module.recipe import FmuRecipe
from fmus.module.variables import Value


def robot_recipe(name: str, n_wheels: int, start: Mapping[str, Value], description: str) -> FmuRecipe:
    """Return the recipe of the robot `name` with `n_wheels` wheels and the parameters `start`."""
    return FmuRecipe(name, "fmus.robot.module:Robot", description, {"n_wheels": n_wheels}, start)


RECIPE = robot_recipe("robot", 1, {}, "Rigid robot with one wheel")
