"""Robots: one TOML file each, every number with its unit and source; the catalogue, or anybody's own."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError

from fmus.module.units import convert
from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import Document, Stack, chain
from orchestrator.catalogue.quantities import (
    ASSUMED,
    POSITIVE,
    SOURCED,
    Choice,
    Number,
    Quantity,
    Triple,
    complaints,
    in_unit,
)
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "robots"

Mass = Annotated[Number, POSITIVE, in_unit("kg")]
Moment = Annotated[Number, POSITIVE, in_unit("kg.m2")]
Product = Annotated[Number, in_unit("kg.m2")]
Length = Annotated[Number, POSITIVE, in_unit("m")]
Angle = Annotated[Number, POSITIVE, in_unit("rad")]
Force = Annotated[Number, POSITIVE, in_unit("N")]
Time = Annotated[Number, POSITIVE, in_unit("s")]
Turn = Annotated[Number, in_unit("rad")]
Position = Annotated[Triple, in_unit("m")]
Direction = Annotated[Triple, in_unit("1")]


class Strict(BaseModel):
    """A part of the file: unknown keys are errors, values do not change. Numbers are SI once they are read."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Inertia(Strict):
    """Inertia tensor in B, wheels included; `about` says at which point, "b" or the centre of mass "G"."""

    about: Literal["b", "G"]
    xx: Moment
    yy: Moment
    zz: Moment
    xy: Product | None = None
    xz: Product | None = None
    yz: Product | None = None

    @property
    def tensor(self) -> np.ndarray:
        """Return the tensor as the file has it: (3, 3) float64, kg m²."""
        xy, xz, yz = (0.0 if product is None else product.value for product in (self.xy, self.xz, self.yz))
        return np.array([[self.xx.value, xy, xz], [xy, self.yy.value, yz], [xz, yz, self.zz.value]])


class Body(Strict):
    """Mass, centre of mass (from b, in B) and inertia."""

    mass: Mass
    center_of_mass: Position
    inertia: Inertia

    def inertia_about_center_of_mass(self) -> np.ndarray:
        """Return the tensor about G: (3, 3) float64, kg m²; from b by the parallel axis theorem."""
        if self.inertia.about == "G":
            return self.inertia.tensor
        r = np.array(self.center_of_mass.value)
        return self.inertia.tensor - self.mass.value * (r @ r * np.eye(3) - np.outer(r, r))


class Wheel(Strict):
    """One wheel: where its centre is (from b, in B), its axle and its misalignment, and whether it is braked."""

    mount: Position
    braked: Annotated[Choice, SOURCED]
    axle_direction: Direction | None = None
    axle_yaw: Turn | None = None
    axle_tilt: Turn | None = None
    inertia: Moment | None = None

    def parameters(self, name: str) -> dict[str, float | bool]:
        """Return the parameters of this wheel under the name ``wheel[k]``."""
        found: dict[str, float | bool] = {f"{name}.braked": self.braked.value}
        found |= _components(f"{name}.mount", self.mount.value)
        if self.axle_direction is not None:
            found |= _components(f"{name}.axle_direction", self.axle_direction.value)
        for key in ("axle_yaw", "axle_tilt", "inertia"):
            quantity: Number | None = getattr(self, key)
            if quantity is not None:
                found[f"{name}.{key}"] = quantity.value
        return found


class Groove(Strict):
    """What the contact needs to know of the wheels."""

    wheel_radius: Length
    groove_angle: Angle
    groove_width: Length


class Size(Strict):
    """The robot as a box: D_Rx, D_Ry, D_Rz of Jia et al. 2025; `below_line`: how much of its height is below the line, if
    not all of it."""

    across: Length
    along: Length
    height: Length
    below_line: Length | None = None


class Rotors(Strict):
    """The rotors: F_z,max, the largest thrust."""

    max_thrust: Force


class RobotLimits(Strict):
    """The largest values that the maker calls safe, in the place of those that follow from the geometry."""

    roll: Angle | None = None
    yaw: Angle | None = None
    pitch: Angle | None = None
    z: Length | None = None
    slip: Length | None = None
    airborne: Time | None = None
    wheel_force: Force | None = None


class RobotSpec(Strict):
    """A robot.

    Attributes
    ----------
    title : one line for people
    layout : ``top`` (the wheels above the rotors) or ``bottom`` (the robot stands on the line)
    """

    title: str
    layout: Literal["top", "bottom"]
    notes: str = ""
    body: Body
    contact: Groove
    size: Size | None = None
    rotors: Rotors | None = None
    limits: RobotLimits = RobotLimits()
    wheel: Annotated[list[Wheel], Field(min_length=1, max_length=4)]
    _path: Path = PrivateAttr(default=Path("robot.toml"))

    @property
    def name(self) -> str:
        """The name of the file, without its ending."""
        return self._path.stem

    @property
    def fmu_name(self) -> str:
        """The name of the robot's FMU: a C identifier, whatever the file is called."""
        name = re.sub("[^A-Za-z0-9_]", "_", self.name)
        return name if name[0].isalpha() else f"robot_{name}"

    @property
    def n_wheels(self) -> int:
        """Return the number of wheels, which fixes the model."""
        return len(self.wheel)

    @property
    def parameters(self) -> dict[str, float | bool]:
        """Return the robot's parameters by the names of its variable table (SI)."""
        j = self.body.inertia_about_center_of_mass()
        entries = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
        found: dict[str, float | bool] = {"mass": self.body.mass.value}
        found |= _components("center_of_mass", self.body.center_of_mass.value)
        found |= {f"inertia.{name}": float(j[place]) for name, place in entries.items()}
        for k, wheel in enumerate(self.wheel, start=1):
            found |= wheel.parameters(f"wheel[{k}]")
        return found

    @property
    def contact_parameters(self) -> dict[str, float]:
        """Return the contact's parameters that belong to the wheel (SI)."""
        return {name: getattr(self.contact, name).value for name in Groove.model_fields}

    def quantities(self) -> dict[str, Quantity[Any]]:
        """Return key → quantity of every number, with its unit, source and reason."""
        return dict(_quantities("", self))

    def assumptions(self) -> dict[str, str]:
        """Return key → reason of everything assumed."""
        return {key: one.reason or "" for key, one in self.quantities().items() if one.source == ASSUMED}


def _components(name: str, vector: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}.{axis}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def _quantities(place: str, part: Any) -> Iterator[tuple[str, Quantity[Any]]]:
    if isinstance(part, Quantity):
        yield place, part
    elif isinstance(part, list):
        for k, item in enumerate(part, 1):
            yield from _quantities(f"{place}[{k}]", item)
    elif isinstance(part, BaseModel):
        for name in type(part).model_fields:
            yield from _quantities(f"{place}.{name}".lstrip("."), getattr(part, name))


def load_robot(name_or_path: str | Path) -> RobotSpec:
    """Return the robot of a catalogue name, or of a path that ends in ``.toml``; `InputError` says what is wrong."""
    return _parse(_find(str(name_or_path), Path()))


def catalogue() -> dict[str, RobotSpec]:
    """Return the robots of the catalogue by name."""
    return {name: load_robot(name) for name in names()}


def names() -> list[str]:
    """Return the names of the catalogue, whatever their files hold."""
    return shelf.names(FOLDER)


def _find(name_or_path: str, folder: Path) -> Path:
    """Return the file of a robot; a path is relative to `folder`."""
    return shelf.find_or_path(FOLDER, name_or_path, "robot", folder)


def _parse(path: Path) -> RobotSpec:
    stack = Stack()
    for file, document in chain(path, _find):
        stack.put(_with_scaled_inertia(stack.document, document), str(file))
    try:
        spec = RobotSpec.model_validate(stack.document)
    except ValidationError as error:
        found = complaints(error, RobotSpec)
        raise InputError(f"{stack.place_of(one.path)}: {one}" for one in found) from None
    spec._path = path
    return spec


def _with_scaled_inertia(below: Document, above: Document) -> Document:
    """Return `above` with the inertia of `below` in proportion to the mass, where `above` has another mass alone.

    The shape is kept: every part becomes heavier or lighter by the same factor. What is no number yet is left to the check.
    """
    there, here = (document.get("body") for document in (below, above))
    if not (isinstance(there, dict) and isinstance(here, dict)) or "mass" not in here or "inertia" in here:
        return above
    try:
        ratio = _mass(here) / _mass(there)
        inertia = {axes: _scaled(moment, ratio) for axes, moment in there["inertia"].items()}
    except (TypeError, KeyError, ValueError, AttributeError, ArithmeticError):
        return above
    return above | {"body": here | {"inertia": inertia}}


def _scaled(moment: Any, ratio: float) -> Any:
    if not (isinstance(moment, dict) and isinstance(moment.get("value"), float | int)):
        return moment
    source = f"{moment.get('source')}; scaled by {ratio:.6g} with the mass"
    return moment | {"value": ratio * moment["value"], "source": source}


def _mass(body: Document) -> float:
    return convert(body["mass"]["value"], body["mass"]["unit"], "kg")
