"""Conductors: one TOML file each with wires or sets of stiffnesses, every number with its unit and source."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import Stack, chain
from orchestrator.catalogue.quantities import ASSUMED, POSITIVE, Number, complaints, in_unit
from orchestrator.catalogue.strands import Layer, Strict, bending_range
from orchestrator.coupling.errors import InputError, nearest

FOLDER = Path(__file__).parent / "conductors"
MODELS = {"metallic": 0.5, "slip": 0.0, "stick": 1.0}
"""Set that follows from the wires → its place between wires that slip freely (0) and wires that all stick (1)."""


class StiffnessSet(Strict):
    """EA and EI that belong together."""

    axial_stiffness: Annotated[Number, POSITIVE, in_unit("N")]
    bending_stiffness: Annotated[Number, POSITIVE, in_unit("N.m2")]


class ConductorSpec(Strict):
    """A conductor.

    Attributes
    ----------
    title : one line for people
    youngs_modulus, metallic_area : Pa, m²; what the sets come from. The modulus is the final one, of settled strands
    rated_strength : N, of which the limit of tension is a share
    thermal_expansion : 1/K, by which the line's state follows the temperature
    layers : of wires, from the centre outwards; three sets follow from them: `metallic`, `slip`, `stick`
    stiffness_sets : further sets by name
    default_set : the set of a scenario that names none
    """

    title: str
    notes: str = ""
    diameter: Annotated[Number, POSITIVE, in_unit("m")]
    linear_density: Annotated[Number, POSITIVE, in_unit("kg/m")]
    youngs_modulus: Annotated[Number, POSITIVE, in_unit("Pa")]
    metallic_area: Annotated[Number, POSITIVE, in_unit("m2")]
    rated_strength: Annotated[Number, POSITIVE, in_unit("N")] | None = None
    thermal_expansion: Annotated[Number, POSITIVE, in_unit("1/K")] | None = None
    layers: Annotated[list[Layer], Field(default_factory=list)]
    stiffness_sets: Annotated[dict[str, StiffnessSet], Field(default_factory=dict)]
    default_set: str | None = None
    _path: Path = PrivateAttr(default=Path("conductor.toml"))

    @model_validator(mode="after")
    def _some_set(self) -> ConductorSpec:
        if not self.sets:
            raise ValueError("has no stiffness; give [[layers]] of wires, or [stiffness_sets.NAME]")
        if self.default_set is not None and self.default_set not in self.sets:
            hint = nearest(self.default_set, self.sets) or f"; it has {', '.join(self.sets)}"
            raise ValueError(f"default_set: no set {self.default_set!r}{hint}")
        return self

    @cached_property
    def sets(self) -> Mapping[str, StiffnessSet]:
        """All sets of stiffnesses by name: those that follow from the wires, and those of the file, which win."""
        return {name: self._of_wires(place) for name, place in MODELS.items() if self.layers} | self.stiffness_sets

    def _of_wires(self, place: float) -> StiffnessSet:
        e, area = self.youngs_modulus.value, self.metallic_area.value
        slip, stick = bending_range(self.layers)
        axial = f"E times the metallic area: {1e-9 * e:.4g} GPa of {1e6 * area:.5g} mm2"
        between = (
            f"half of {stick:.3g} N.m2, which the wires have that all stick together; "
            f"wires that slip freely have {slip:.3g} N.m2. Wires stick where the line swings and slip where a wheel bends it"
        )
        bending = {
            0.0: Number(value=slip, unit="N.m2", source="the wires, free to slip: the sum of E pi d^4/64"),
            0.5: Number(value=0.5 * stick, unit="N.m2", source=ASSUMED, reason=between),
            1.0: Number(value=stick, unit="N.m2", source="the wires, all stuck together: sections stay plane"),
        }
        return StiffnessSet(
            axial_stiffness=Number(value=e * area, unit="N", source=axial), bending_stiffness=bending[place]
        )

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
        chosen = self.sets[stiffness_set]
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
