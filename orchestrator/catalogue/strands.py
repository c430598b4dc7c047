"""The wires of a stranded conductor, and how stiff in bending they are: free to slip on one another, or all stuck."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import read
from orchestrator.catalogue.quantities import POSITIVE, Number, complaints, in_unit
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "wires"


class Strict(BaseModel):
    """A part of a file: unknown keys are errors, values do not change. Numbers are SI once they are read."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Material(Strict):
    """What wires are made of."""

    title: str
    youngs_modulus: Annotated[Number, POSITIVE, in_unit("Pa")]
    density: Annotated[Number, POSITIVE, in_unit("kg/m3")]


def load_material(name: str) -> Material:
    """Return the material of that name, checked; `InputError` names the nearest one."""
    path = shelf.find(FOLDER, name, f"material of wires {name!r}")
    try:
        return Material.model_validate(read(path))
    except ValidationError as error:
        raise InputError(f"{path}: {one}" for one in complaints(error, Material)) from None


def _known(name: str) -> str:
    try:
        load_material(name)
    except InputError as error:
        raise ValueError(f"is {error.problems[0]}") from None
    return name


class Layer(Strict):
    """A layer of equal wires.

    Attributes
    ----------
    wires : number of wires; 0 of what takes room and carries nothing: the tube of fibres in an OPGW
    diameter : of a wire, m
    material : by its name in the catalogue
    """

    wires: Annotated[int, Field(ge=0, strict=True)]
    diameter: Annotated[Number, POSITIVE, in_unit("m")]
    material: Annotated[str, AfterValidator(_known)]

    @property
    def area(self) -> float:
        """Section of all its wires, m²."""
        return self.wires * pi * self.diameter.value**2 / 4.0


def outer_diameter(layers: Sequence[Layer]) -> float:
    """Return the diameter (m) of a conductor of these layers, from the centre outwards."""
    return 2.0 * sum(layer.diameter.value for layer in layers) - layers[0].diameter.value


def bending_range(layers: Sequence[Layer]) -> tuple[float, float]:
    """Return the bending stiffness (N m²) of wires that slip freely, and of wires that all stick together.

    Slipping, each wire bends about its own axis: Σ E π d⁴/64. Sticking, sections stay plane, and n wires of section A on a
    circle of radius R add E n A R²/2 (Papailiou, *IEEE Trans. Power Delivery* 12, 1997). The wires' axes are taken as
    parallel; their lay takes 2 % from the first and 6 % from the second, by RTE's strdcable for Aster 570.
    """
    rows = list(_rows(layers))
    slip = sum(e * area * d**2 / 16.0 for e, area, d, _ in rows)
    return slip, slip + sum(0.5 * e * area * radius**2 for e, area, _, radius in rows)


def _rows(layers: Sequence[Layer]) -> Iterator[tuple[float, float, float, float]]:
    """Yield of each layer Young's modulus, section of all wires, their diameter, and the radius on which they lie."""
    edge = 0.0
    for layer in layers:
        d = layer.diameter.value
        radius = edge + 0.5 * d if edge > 0.0 else 0.0
        yield load_material(layer.material).youngs_modulus.value, layer.area, d, radius
        edge = radius + 0.5 * d
