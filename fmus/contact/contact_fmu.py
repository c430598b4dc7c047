"""The FMU of the contact between one wheel and the cable."""

from fmus.module.recipe import FmuRecipe

RECIPE = FmuRecipe("contact", "fmus.contact.module:Contact", "Contact between a grooved wheel and a cable")
