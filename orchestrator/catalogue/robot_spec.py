"""The catalogue of robots: one TOML file a robot, every number with its unit and source."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

FOLDER = Path(__file__).parent / "robots"
ASSUMED = "assumed"

UNITS: dict[str, tuple[str, float]] = {
    "1": ("1", 1.0),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "kg": ("kg", 1.0),
    "kg.m2": ("kg.m2", 1.0),
    "rad": ("rad", 1.0),
    "deg": ("rad", np.pi / 180.0),
}
"""Unit in a file → SI unit and factor."""

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class RobotError(ValueError):
    """A robot cannot be loaded: the message names file, key, cause and cure."""


class Strict(BaseModel):
    """A part of the file: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Stated(Strict):
    """What everything stated carries: its source, and the reason if it is assumed."""

    source: Annotated[str, Field(min_length=1)]
    reason: str | None = None

    @model_validator(mode="after")
    def _reason_if_assumed(self) -> Stated:
        if self.source == ASSUMED and not self.reason:
            raise ValueError('what is assumed needs its reason; add reason = "..."')
        return self


class Choice(Stated):
    """A yes or no."""

    value: Annotated[bool, Field(strict=True)]


class Quantity(Stated):
    """What has a unit."""

    unit: str

    @property
    def factor(self) -> float:
        """Return the factor from the file's unit to SI."""
        return UNITS[self.unit][1]


class Scalar(Quantity):
    """A number with unit and source."""

    value: Number

    @property
    def si(self) -> float:
        """Return the number in SI units."""
        return self.value * self.factor


class Vector(Quantity):
    """Three numbers with unit and source."""

    value: tuple[Number, Number, Number]

    @property
    def si(self) -> np.ndarray:
        """Return the numbers in SI units: (3,) float64."""
        return np.array(self.value) * self.factor


def _in_unit(si_unit: str) -> AfterValidator:
    def check(number: Quantity) -> Quantity:
        if UNITS.get(number.unit, ("", 0.0))[0] != si_unit:
            possible = ", ".join(name for name, (si, _) in UNITS.items() if si == si_unit)
            raise ValueError(f"unit {number.unit!r} does not fit; possible here: {possible}")
        return number

    return AfterValidator(check)


def _positive(number: Scalar) -> Scalar:
    if number.value <= 0.0:
        raise ValueError(f"{number.value:g} {number.unit} is not positive; give a value above 0")
    return number


Mass = Annotated[Scalar, _in_unit("kg"), AfterValidator(_positive)]
Moment = Annotated[Scalar, _in_unit("kg.m2"), AfterValidator(_positive)]
Product = Annotated[Scalar, _in_unit("kg.m2")]
Length = Annotated[Scalar, _in_unit("m"), AfterValidator(_positive)]
Angle = Annotated[Scalar, _in_unit("rad"), AfterValidator(_positive)]
Position = Annotated[Vector, _in_unit("m")]
Direction = Annotated[Vector, _in_unit("1")]


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
        xy, xz, yz = (0.0 if product is None else product.si for product in (self.xy, self.xz, self.yz))
        return np.array([[self.xx.si, xy, xz], [xy, self.yy.si, yz], [xz, yz, self.zz.si]])


class Body(Strict):
    """Mass, centre of mass (from b, in B) and inertia."""

    mass: Mass
    center_of_mass: Position
    inertia: Inertia

    def inertia_about_center_of_mass(self) -> np.ndarray:
        """Return the tensor about G: (3, 3) float64, kg m²; from b by the parallel axis theorem."""
        if self.inertia.about == "G":
            return self.inertia.tensor
        r = self.center_of_mass.si
        return self.inertia.tensor - self.mass.si * (r @ r * np.eye(3) - np.outer(r, r))


class Wheel(Strict):
    """One wheel: where its centre is (from b, in B), its axle, and whether it is braked."""

    mount: Position
    braked: Choice
    axle_direction: Direction | None = None
    inertia: Moment | None = None

    def parameters(self, name: str) -> dict[str, float | bool]:
        """Return the parameters of this wheel under the name ``wheel[k]``."""
        found: dict[str, float | bool] = {f"{name}.braked": self.braked.value}
        found |= _components(f"{name}.mount", self.mount.si)
        if self.axle_direction is not None:
            found |= _components(f"{name}.axle_direction", self.axle_direction.si)
        if self.inertia is not None:
            found[f"{name}.inertia"] = self.inertia.si
        return found


class Groove(Strict):
    """What the contact needs to know of the wheels."""

    wheel_radius: Length
    groove_angle: Angle
    groove_width: Length


class RobotSpec(Strict):
    """A robot of the catalogue.

    Attributes
    ----------
    name : of the file, without its ending
    title : one line for people
    layout : ``top`` (the wheels above the rotors) or ``bottom`` (the robot stands on the line)
    """

    name: str
    title: str
    layout: Literal["top", "bottom"]
    notes: str = ""
    body: Body
    contact: Groove
    wheel: Annotated[list[Wheel], Field(min_length=1, max_length=4)]

    @property
    def n_wheels(self) -> int:
        """Return the number of wheels, which fixes the model."""
        return len(self.wheel)

    @property
    def parameters(self) -> dict[str, float | bool]:
        """Return the robot's parameters by the names of its variable table (SI)."""
        j = self.body.inertia_about_center_of_mass()
        entries = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
        found: dict[str, float | bool] = {"mass": self.body.mass.si}
        found |= _components("center_of_mass", self.body.center_of_mass.si)
        found |= {f"inertia.{name}": float(j[place]) for name, place in entries.items()}
        for k, wheel in enumerate(self.wheel, start=1):
            found |= wheel.parameters(f"wheel[{k}]")
        return found

    @property
    def contact_parameters(self) -> dict[str, float]:
        """Return the contact's parameters that belong to the wheel (SI)."""
        return {name: getattr(self.contact, name).si for name in Groove.model_fields}

    def assumptions(self) -> dict[str, str]:
        """Return key → reason of everything assumed."""
        return dict(_assumptions("", self))


def _components(name: str, vector: np.ndarray) -> dict[str, float]:
    return {f"{name}.{axis}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def _assumptions(place: str, part: Any) -> list[tuple[str, str]]:
    if isinstance(part, Stated):
        return [(place, part.reason or "")] if part.source == ASSUMED else []
    if isinstance(part, list):
        return [found for k, item in enumerate(part, 1) for found in _assumptions(f"{place}[{k}]", item)]
    if isinstance(part, BaseModel):
        names = type(part).model_fields
        return [found for name in names for found in _assumptions(f"{place}.{name}".lstrip("."), getattr(part, name))]
    return []


def load_robot(name_or_path: str | Path) -> RobotSpec:
    """Return the robot of a catalogue name, or of a path that ends in ``.toml``; else raise `RobotError`."""
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = FOLDER / f"{name_or_path}.toml"
        if path.parent != FOLDER or not path.is_file():
            names = sorted(file.stem for file in FOLDER.glob("*.toml"))
            hint = _did_you_mean(str(name_or_path), names)
            raise RobotError(f"robot {str(name_or_path)!r}: not in the catalogue ({', '.join(names)}){hint}")
    return _parse(path)


def catalogue() -> dict[str, RobotSpec]:
    """Return the robots of the catalogue by name."""
    return {path.stem: _parse(path) for path in sorted(FOLDER.glob("*.toml"))}


def _parse(path: Path) -> RobotSpec:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: is not UTF-8 text ({error.reason}); save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise RobotError(f"{path}: is not valid TOML ({error}); mend that line") from error
    try:
        return RobotSpec.model_validate({"name": path.stem} | content)
    except ValidationError as error:
        raise RobotError("\n".join(_word(path, found) for found in error.errors())) from error


def _word(path: Path, error: Any) -> str:
    """Return one line: file, key, cause and cure."""
    key = "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
    match error["type"]:
        case "extra_forbidden":
            parent, last = error["loc"][:-1], str(error["loc"][-1])
            known = _known_keys(RobotSpec, parent)
            return f"{path}: {key}: unknown key; known here: {', '.join(known)}{_did_you_mean(last, known)}"
        case "missing":
            return f"{path}: {key}: is missing; add it"
        case "value_error":
            return f"{path}: {key}: {error['ctx']['error']}"
    cure = 'a number is written { value = 1.5, unit = "m", source = "..." }'
    if error["loc"][-1] == "value" or error["type"] not in ("model_type", "model_attributes_type"):
        cure = f"found {error['input']!r}"
    return f"{path}: {key}: {error['msg']}; {cure}"


def _known_keys(model: type[BaseModel], place: tuple[str | int, ...]) -> list[str]:
    """Return the keys known at `place`, by walking down the models."""
    for part in place:
        if isinstance(part, str):
            model = _model_of(model.model_fields[part].annotation)
    return [name for name in model.model_fields if name != "name" or model is not RobotSpec]


def _model_of(annotation: Any) -> type[BaseModel]:
    """Return the model inside ``Model``, ``list[Model]`` or ``Annotated[Model, ...] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    inner = getattr(annotation, "__origin__", None)
    candidates = [inner, *getattr(annotation, "__args__", ())]
    for candidate in candidates:
        if candidate not in (None, list, type(None)):
            return _model_of(candidate)
    raise TypeError(f"no model in {annotation}")


def _did_you_mean(word: str, known: list[str]) -> str:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f". Did you mean {near[0]!r}?" if near else ""
