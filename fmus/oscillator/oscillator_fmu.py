"""The FMU of the oscillator."""

from fmus.recipe import FmuRecipe

RECIPE = FmuRecipe("oscillator", "fmus.oscillator.module:Oscillator", "Mass between springs")
