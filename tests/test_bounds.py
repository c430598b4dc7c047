"""The bounds of parameters, written once in the variable tables: each module keeps them, each FMU shows them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fmpy import read_model_description

from fmus.cable.module import Cable
from fmus.contact.module import Contact
from fmus.face.build import build_fmu
from fmus.module.recipe import FmuRecipe
from fmus.module.variables import Bounds, ModuleError, Variable
from fmus.oscillator.module import Oscillator
from fmus.robot.module import Robot

MODULES = (Cable, Contact, Robot, Oscillator)
BOUNDED = [(module, v) for module in MODULES for v in module().table.variables if v.bounds != Bounds()]


def outside(variable: Variable) -> list[float]:
    """Return the numbers nearest to the bounds that are not allowed; of an integer whole ones."""
    far = 1.0 if variable.kind == "integer" else 0.0
    bounds = variable.bounds
    found = [bounds.ge - far if far else np.nextafter(bounds.ge, -np.inf)] if bounds.ge is not None else []
    found += [bounds.le + far if far else np.nextafter(bounds.le, np.inf)] if bounds.le is not None else []
    return found + [bound for bound in (bounds.gt, bounds.lt) if bound is not None] + [math.nan]


@pytest.mark.parametrize(("module", "variable"), BOUNDED, ids=lambda v: getattr(v, "name", getattr(v, "NAME", "")))
def test_a_module_refuses_what_is_out_of_bounds(module, variable):
    """Place, parameter and value are named; the start value of the table is allowed."""
    assert variable.causality == "parameter" and variable.bounds.admit(variable.encode(variable.start))
    for value in outside(variable):
        one = module()
        one.values[one.table.index[variable.name]] = value
        with pytest.raises(ModuleError) as caught:
            one.initialize(0.0)
        assert str(caught.value).startswith(f"{module.NAME}: {variable.name} = {value:g}")


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.NAME)
def test_every_parameter_that_is_not_finite_is_named(module):
    for name in module().table.names("parameter"):
        one = module()
        one.values[one.table.index[name]] = math.inf
        with pytest.raises(ModuleError, match="not a finite number") as caught:
            one.initialize(0.0)
        assert f"{name} = inf" in str(caught.value)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.NAME)
def test_an_fmu_shows_the_bounds(module, tmp_path):
    """In the model description as min and max, which are inclusive in FMI 2.0, and in words for people."""
    recipe = FmuRecipe(f"bounded_{module.NAME}", f"{module.__module__}:{module.__name__}")
    path = build_fmu(recipe, tmp_path)
    shown = {v.name: (v.min, v.max) for v in read_model_description(str(path), validate=True).modelVariables}
    for variable in module().table.variables:
        wanted = (variable.bounds.lowest, variable.bounds.highest)
        assert tuple(bound if bound is None else float(bound) for bound in shown[variable.name]) == wanted


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        (Bounds(gt=0.0), "greater than 0"),
        (Bounds(ge=1, le=5000), "at least 1 and at most 5000"),
        (Bounds(gt=0.0, lt=math.pi), "greater than 0 and less than 3.14159"),
        (Bounds(), ""),
    ],
)
def test_bounds_in_words(bounds, words):
    assert str(bounds) == words
    assert not bounds.admit(math.nan)
