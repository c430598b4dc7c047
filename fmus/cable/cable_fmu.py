"""The FMU of the cable."""

from fmus.module.recipe import FmuRecipe

RECIPE = FmuRecipe("cable", "fmus.cable.module:Cable", "ANCF cable between two supports")
