"""The FMU of the oscillator."""

from fmus.module.recipe import FmuRecipe

RECIPE = FmuRecipe("oscillator", "fmus.oscillator.module:Oscillator", "Mass between springs")
