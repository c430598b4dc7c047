"""Scenario files: TOML, parsed once into types; the only place where dictionaries of settings live.

A scenario is either a landing (``[cable]``, ``[robot]``, ``[contact]``, ``[landing]``) or a general graph of
FMUs (``[components.NAME]`` and ``connections``). Every value may be bare or a quantity
``{ value, unit, source, reason }`` that says where the number comes from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    model_validator,
)

from fmus.module import registry
from orchestrator.catalogue.quantities import Scalar
from orchestrator.coupling.exchange import Choice
from orchestrator.scenario.over_time import as_input

DEFAULT_MASTER = "iqn_ils"


class ScenarioNote(UserWarning):
    """What was decided in reading a scenario that its author may not expect."""


class Section(BaseModel):
    """A table of the scenario file: no unknown keys, no conversion between types, no NaN or infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def _scalar(value: Any) -> Scalar:
    if not isinstance(value, Scalar):
        raise ValueError("must be a number, true, false or a string")
    return value


Settings = dict[str, Annotated[Any, AfterValidator(_scalar)]]
Inputs = dict[str, Annotated[Any, AfterValidator(as_input)]]
Positive = Annotated[float, Field(gt=0.0)]
Count = Annotated[int, Field(ge=1, le=10**6)]
NonNegative = Annotated[float, Field(ge=0.0)]
Temperature = Annotated[float, Field(ge=-100.0, le=300.0)]
"""°C, of a line."""


@dataclass(frozen=True)
class In:
    """The unit of a field: quantities are converted to it, bare numbers stand in it."""

    unit: str


class Simulation(Section):
    """Times in s. `start_time`: of a general graph; a landing starts at 0.

    `tolerances`: the largest `relative_max_error` that `compare` lets pass, by signal.

    `estimate`: by which second run `run` estimates the error of those signals, if any (docs/concepts/error.md). `timeout`: wall
    time that an FMU may take for one step or its initialisation, and for any call in a process of its own; none: as long as it
    likes. `memory_limit`: MB that an FMU may take in such a process, `file_limit`: files that it may have open
    there. `record`: the signals that are kept, ``component.variable``, of any causality; none: all outputs.
    `output_interval`: s from row to row of the results, a whole number of macro steps, twice that with
    ``estimate = "coarser"``; none: a row each communication point.
    """

    start_time: Annotated[float, In("s")] = 0.0
    stop_time: Annotated[float, In("s")]
    macro_step: Annotated[Positive, In("s")]
    master: str = DEFAULT_MASTER
    exchange: Choice | None = None
    tolerances: dict[str, Positive] = {}
    estimate: Literal["finer", "coarser", "none"] = "finer"
    timeout: Annotated[Positive | None, In("s")] = None
    memory_limit: Positive | None = None
    file_limit: Count | None = None
    record: Annotated[list[str], Field(min_length=1)] | None = None
    output_interval: Annotated[Positive | None, In("s")] = None

    @property
    def every(self) -> int:
        """Macro steps from row to row of the results."""
        return 1 if self.output_interval is None else max(round(self.output_interval / self.macro_step), 1)

    @property
    def duration(self) -> float:
        """From start to stop, s."""
        return self.stop_time - self.start_time

    @model_validator(mode="after")
    def _forward(self) -> Self:
        if not self.duration > 0.0:
            raise ValueError(f"stop_time {self.stop_time:g} s must be after the start at {self.start_time:g} s")
        return self

    @model_validator(mode="after")
    def _whole(self) -> Self:
        unit = (2.0 if self.estimate == "coarser" else 1.0) * self.macro_step
        rows = 1.0 if self.output_interval is None else self.output_interval / unit
        if abs(rows - round(rows)) > 1e-9 * rows or round(rows) < 1:
            steps = 'macro steps, twice that with estimate = "coarser"' if unit > self.macro_step else "macro steps"
            raise ValueError(
                f"output_interval {self.output_interval:g} s must be a whole number of {steps}: of {unit:g} s"
            )
        return self


class StateSection(Section):
    """How the line is strung, and how warm and icy it is now; one of the first four is given.

    Attributes
    ----------
    sag : m, in the middle, below half way between the supports' heights
    horizontal_tension, tension_share : N; or as a share of the rated strength
    unstretched_length : m
    at_temperature : °C, at which the line is strung so, bare
    temperature : °C, now; that of stringing if none is given
    thermal_expansion : 1/K; the conductor's, where it has one
    ice_thickness, ice_density : m of ice all around, now; kg/m³
    """

    sag: Annotated[Positive | None, In("m")] = None
    horizontal_tension: Annotated[Positive | None, In("N")] = None
    tension_share: Annotated[Annotated[float, Field(gt=0.0, le=1.0)] | None, In("1")] = None
    unstretched_length: Annotated[Positive | None, In("m")] = None
    at_temperature: Annotated[Temperature | None, In("degC")] = None
    temperature: Annotated[Temperature | None, In("degC")] = None
    thermal_expansion: Annotated[Positive | None, In("1/K")] = None
    ice_thickness: Annotated[NonNegative, In("m")] = 0.0
    ice_density: Annotated[Positive, In("kg/m3")] = 900.0

    @property
    def now(self) -> float | None:
        """The temperature of the line now, °C."""
        return self.at_temperature if self.temperature is None else self.temperature

    @property
    def growth(self) -> float:
        """The unstretched length now by that of stringing."""
        if self.temperature is None or self.at_temperature is None or self.thermal_expansion is None:
            return 1.0
        return 1.0 + self.thermal_expansion * (self.temperature - self.at_temperature)


class CableSection(Section):
    """The cable: parameters by their names in the contract; `fmu` is a foreign one instead of ours.

    `conductor` is one of the catalogue, or a TOML file like those there; `stiffness_set` one of its sets. Without a
    conductor the latter is a label. What `parameters` of the same file give wins. `state`: how the line is strung.
    `steps`, here and below: steps that the FMU makes in each step of the master (docs/reference/masters.md). `isolate`, here
    and below: whether the FMU lives in a process of its own; a foreign one does if nothing is said.
    """

    fmu: str | None = None
    isolate: bool | None = None
    conductor: str | None = None
    stiffness_set: str = "unnamed"
    steps: Count = 1
    state: StateSection | None = None
    parameters: Settings = {}


class RobotSection(Section):
    """The robot: one of the catalogue or a TOML file like those there (`model`), or any FMU of the contract (`fmu`).

    `inputs`: thrust, control torque, drive torques of the wheels; held over the whole run, or over time.
    """

    model: str | None = None
    fmu: str | None = None
    isolate: bool | None = None
    steps: Count = 1
    parameters: Settings = {}
    inputs: Inputs = {}

    @model_validator(mode="after")
    def _one_robot(self) -> RobotSection:
        if (self.model is None) == (self.fmu is None):
            raise ValueError('give either model = "NAME" (see `orchestrator list`) or "FILE.toml", or fmu = "FILE.fmu"')
        return self


class ContactSection(Section):
    """The wheel contact; one instance a wheel is made from it.

    `stiffness_set` : a set of the catalogue; what `parameters` of the same file give wins over it
    """

    fmu: str | None = None
    isolate: bool | None = None
    stiffness_set: str | None = None
    parameters: Settings = {}


class ControllerSection(Section):
    """What flies the robot: a module of ours or of an installed package (`model`), or any FMU of the contract (`fmu`).

    Where it has the parameters mass, gravity, inertia.xx …, max_thrust, they are the robot's unless given.
    """

    model: str | None = None
    fmu: str | None = None
    isolate: bool | None = None
    parameters: Settings = {}

    @model_validator(mode="after")
    def _one_controller(self) -> ControllerSection:
        if (self.model is None) == (self.fmu is None):
            raise ValueError('give either model = "setdown" or fmu = "FILE.fmu"')
        return self


class LandingSection(Section):
    """Where and how the robot comes down.

    Attributes
    ----------
    position : m along the span from the left support; the wheel, or the middle of the wheels, lands there
    height : m above touching
    velocity : m/s downwards
    """

    position: Annotated[float, In("m")]
    height: Annotated[NonNegative, In("m")] = 0.0
    velocity: Annotated[NonNegative, In("m/s")] = 0.0


def _bound(value: Any) -> float | Literal[False] | None:
    if value is None or value is False:
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and 0.0 <= value < float("inf")):
        raise ValueError("must be a finite number, not negative; or false, which switches the limit off")
    return float(value)


def _angle(value: Any) -> float | Literal[False] | None:
    bound = _bound(value)
    if bound and bound > MOST_ANGLE:
        raise ValueError('is more than half a turn: rad unless a unit is given; write { value = 20.0, unit = "deg" }')
    return bound


MOST_ANGLE = 3.15
"""rad."""
Bound = Annotated[Any, AfterValidator(_bound)]
"""The largest value that is safe; None: by the robot's file or its geometry; False: not judged."""
AngleBound = Annotated[Any, AfterValidator(_angle)]


class LimitsSection(Section):
    """What is safe (docs/concepts/limits.md), and what of the line the formulas need.

    Attributes
    ----------
    roll, yaw, pitch, z, slip, airborne, tension, wheel_force : the limits; `tension` as a share of `rated_strength`
    conductor_spacing : D_12, from this line to the one below it
    safe_clearance : D_E, that must stay between robot and the line below
    rated_strength : rated tensile strength of the conductor
    """

    roll: Annotated[AngleBound, In("rad")] = None
    yaw: Annotated[AngleBound, In("rad")] = None
    pitch: Annotated[AngleBound, In("rad")] = None
    z: Annotated[Bound, In("m")] = None
    slip: Annotated[Bound, In("m")] = None
    airborne: Annotated[Bound, In("s")] = None
    tension: Annotated[Bound, In("1")] = None
    wheel_force: Annotated[Bound, In("N")] = None
    conductor_spacing: Annotated[Positive | None, In("m")] = None
    safe_clearance: Annotated[Positive | None, In("m")] = None
    rated_strength: Annotated[Positive | None, In("N")] = None


class Component(Section):
    """One FMU of a general graph: any (`fmu`), or one of our modules (`model`).

    `continuous`: real variables that it declares discrete, and are not.
    """

    model: str | None = None
    fmu: str | None = None
    isolate: bool | None = None
    steps: Count = 1
    continuous: list[str] = []
    parameters: Settings = {}
    inputs: Inputs = {}

    @model_validator(mode="after")
    def _one_source(self) -> Component:
        if (self.model is None) == (self.fmu is None):
            raise ValueError(f'give either fmu = "FILE.fmu" or model = one of {", ".join(registry.names())}')
        return self


@dataclass(frozen=True)
class Provenance:
    """Where a value comes from.

    Attributes
    ----------
    source : ``scenario`` or ``command line`` if the value names none; ``assumed`` only together with a `reason`
    unit : in which it was written, None if it was bare
    written : how it was written, where that was another unit than the variable's: ``18 mm``
    file : which says it; empty on the command line
    sha256 : of the file that the value names, where that is a robot's
    """

    source: str = "scenario"
    reason: str = ""
    unit: str | None = None
    written: str = ""
    file: str = ""
    sha256: str = ""


class _Common(Section):
    """What every scenario has; `provenance` tells where each value comes from, by its path."""

    title: str
    simulation: Simulation
    master: Settings = {}
    _path: Path = PrivateAttr(default=Path("scenario.toml"))
    _provenance: dict[str, Provenance] = PrivateAttr(default_factory=dict)
    _notes: tuple[str, ...] = PrivateAttr(default=())

    @property
    def name(self) -> str:
        """The scenario file's name without its ending."""
        return self._path.stem

    @property
    def path(self) -> Path:
        """The scenario file."""
        return self._path

    @property
    def provenance(self) -> Mapping[str, Provenance]:
        """Source, reason and unit of every value, by its path."""
        return self._provenance

    @property
    def notes(self) -> tuple[str, ...]:
        """What was decided in reading it that its author may not expect, a line each."""
        return self._notes

    def read_from(self, path: Path, provenance: Mapping[str, Provenance], notes: Iterable[str] = ()) -> Self:
        """Note the file that the scenario comes from, where each of its values does, and what is to be said; return it."""
        self._path, self._provenance, self._notes = path, dict(provenance), tuple(notes)
        return self

    def changed(self, options: Settings | None = None, **simulation: Any) -> Self:
        """Return a copy with other simulation settings (macro_step, …) and master `options`, checked again."""
        document = self.model_dump()
        document["simulation"] |= simulation
        document["master"] = document["master"] if options is None else options
        return type(self).model_validate(document).read_from(self._path, self._provenance, self._notes)


class LandingScenario(_Common):
    """A robot comes down on a cable: cable, robot, one contact a wheel, what flies it if anything does, where they meet."""

    cable: CableSection
    robot: RobotSection
    contact: ContactSection = ContactSection()
    controller: ControllerSection | None = None
    landing: LandingSection
    limits: LimitsSection = LimitsSection()

    @model_validator(mode="after")
    def _from_the_beginning(self) -> Self:
        if self.simulation.start_time != 0.0:
            raise ValueError(
                "simulation.start_time: a landing starts at 0 s; leave it out, or shift the inputs over time"
            )
        return self


class GraphScenario(_Common):
    """A general graph: any FMUs by name, and what is connected to what (``"a.x -> b.u"``)."""

    components: Annotated[dict[str, Component], Field(min_length=1)]
    connections: list[str] = []


Scenario = LandingScenario | GraphScenario
"""One scenario, checked; `isinstance` tells which kind."""


SECTIONS_WITH_UNITS = {
    "simulation": Simulation, "landing": LandingSection, "limits": LimitsSection, "cable.state": StateSection,
}  # fmt: skip
UNITS = {
    f"{section}.{name}": marker.unit
    for section, model in SECTIONS_WITH_UNITS.items()
    for name, field in model.model_fields.items()
    for marker in field.metadata
    if isinstance(marker, In)
}
"""Units of the values that belong to no FMU, by their path."""
