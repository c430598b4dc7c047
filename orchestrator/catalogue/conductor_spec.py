"""Conductors: one TOML file each with its sets of stiffnesses, every number with its unit and source."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import Stack, chain
from orchestrator.catalogue.quantities import POSITIVE, Number, complaints, in_unit
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "conductors"


class Strict(BaseModel):
    """A part of the file: unknown keys are errors, values do not change. Numbers are SI once they are read."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class StiffnessSet(Strict):
    """EA and EI that belong together."""

    axial_stiffness: Annotated[Number, POSITIVE, in_unit("N")]
    bending_stiffness: Annotated[Number, POSITIVE, in_unit("N.m2")]


class ConductorSpec(Strict):
    """A conductor.

    Attributes
    ----------
    title : one line for people
    youngs_modulus, metallic_area : Pa, m²; what the sets come from
    rated_strength : N, of which the limit of tension is a share
    stiffness_sets : by name
    """

    title: str
    notes: str = ""
    diameter: Annotated[Number, POSITIVE, in_unit("m")]
    linear_density: Annotated[Number, POSITIVE, in_unit("kg/m")]
    youngs_modulus: Annotated[Number, POSITIVE, in_unit("Pa")]
    metallic_area: Annotated[Number, POSITIVE, in_unit("m2")]
    rated_strength: Annotated[Number, POSITIVE, in_unit("N")] | None = None
    stiffness_sets: Annotated[dict[str, StiffnessSet], Field(min_length=1)]
    _path: Path = PrivateAttr(default=Path("conductor.toml"))

    @property
    def path(self) -> Path:
        """The conductor's file."""
        return self._path

    @property
    def parameters(self) -> dict[str, Number]:
        """The cable's parameters by name, SI, that no set of stiffnesses changes."""
        return {"diameter": self.diameter, "linear_density": self.linear_density}

    def stiffnesses(self, stiffness_set: str) -> dict[str, Number]:
        """Return the cable's parameters by name, SI, of one of the sets of stiffnesses."""
        chosen = self.stiffness_sets[stiffness_set]
        return {"axial_stiffness": chosen.axial_stiffness, "bending_stiffness": chosen.bending_stiffness}


def load_conductor(name_or_path: str) -> ConductorSpec:
    """Return the conductor of a catalogue name, or of a path that ends in ``.toml``; `InputError` says what is wrong."""
    stack, path = Stack(), _find(name_or_path, Path())
    for file, document in chain(path, _find):
        stack.put(document, str(file))
    try:
        spec = ConductorSpec.model_validate(stack.document)
    except ValidationError as error:
        found = complaints(error, ConductorSpec)
        raise InputError(f"{stack.place_of(one.path)}: {one}" for one in found) from None
    spec._path = path
    return spec


def names() -> list[str]:
    """Return the names of the catalogue, whatever their files hold."""
    return shelf.names(FOLDER)


def _find(name_or_path: str, folder: Path) -> Path:
    """Return the file of a conductor; a path is relative to `folder`."""
    return shelf.find_or_path(FOLDER, name_or_path, "conductor", folder)
