"""Scenario files: TOML, parsed once into types; the only place where dictionaries of settings live.

A scenario is either a landing (``[cable]``, ``[robot]``, ``[contact]``, ``[landing]``) or a general graph of
FMUs (``[components.NAME]`` and ``connections``). Every value may be bare or a table
``{ value, source, reason, unit }`` that says where the number comes from.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeGuard

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    model_validator,
)

from orchestrator import vocabulary
from orchestrator.errors import InputError, nearest

Scalar = bool | int | float | str
Document = dict[str, Any]

DEFAULT_MASTER = "iqn_ils"
NAMED_TABLES = ("parameters", "inputs", "tolerances")
"""Tables whose keys are variables' names: the dots in them are part of the name."""
QUANTITY_KEYS = ("value", "source", "reason", "unit")


class Section(BaseModel):
    """A table of the scenario file: no unknown keys, no conversion between types, no NaN or infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def _scalar(value: Any) -> Scalar:
    if not isinstance(value, Scalar):
        raise ValueError("must be a number, true, false or a string")
    return value


Settings = dict[str, Annotated[Any, AfterValidator(_scalar)]]
Positive = Annotated[float, Field(gt=0.0)]
Count = Annotated[int, Field(ge=1)]
NonNegative = Annotated[float, Field(ge=0.0)]


class Simulation(Section):
    """Times in s. `tolerances`: the largest `relative_max_error` that `compare` lets pass, by signal.

    `estimate`: by which second run `run` estimates the error of those signals, if any (docs/estimate.md). `timeout`: wall
    time that an FMU may take for one step or its initialisation; none: as long as it likes.
    """

    stop_time: Positive
    macro_step: Positive
    master: str = DEFAULT_MASTER
    exchange: Literal["point", "hermite", "waveform"] | None = None
    tolerances: dict[str, Positive] = {}
    estimate: Literal["finer", "coarser", "none"] = "finer"
    timeout: Positive | None = None


class CableSection(Section):
    """The cable: parameters by their names in the contract; `fmu` is a foreign one instead of ours.

    `steps`, here and below: steps that the FMU makes in each step of the master (docs/masters.md).
    """

    fmu: str | None = None
    stiffness_set: str = "unnamed"
    steps: Count = 1
    parameters: Settings = {}


class RobotSection(Section):
    """The robot: one of the catalogue (`model`) or any FMU that meets the contract (`fmu`).

    `inputs` are held over the whole run: thrust, control torque, drive torques of the wheels.
    """

    model: str | None = None
    fmu: str | None = None
    steps: Count = 1
    parameters: Settings = {}
    inputs: Settings = {}

    @model_validator(mode="after")
    def _one_robot(self) -> RobotSection:
        if (self.model is None) == (self.fmu is None):
            raise ValueError('give either model = "NAME" (see `orchestrator list`) or fmu = "FILE.fmu"')
        return self


class ContactSection(Section):
    """The wheel contact; one instance a wheel is made from it."""

    fmu: str | None = None
    parameters: Settings = {}


class Landing(Section):
    """Where and how the robot comes down.

    Attributes
    ----------
    position : m along the span from the left support; the wheel, or the middle of the wheels, lands there
    height : m above touching
    velocity : m/s downwards
    """

    position: float
    height: NonNegative = 0.0
    velocity: NonNegative = 0.0


class Component(Section):
    """One FMU of a general graph: any (`fmu`), or one of our modules (`model`)."""

    model: str | None = None
    fmu: str | None = None
    steps: Count = 1
    parameters: Settings = {}
    inputs: Settings = {}

    @model_validator(mode="after")
    def _one_source(self) -> Component:
        if (self.model is None) == (self.fmu is None):
            raise ValueError(f'give either fmu = "FILE.fmu" or model = one of {", ".join(vocabulary.MODELS)}')
        return self


@dataclass(frozen=True)
class Provenance:
    """Where a value comes from; `source` is ``assumed`` only together with a `reason`."""

    source: str = "scenario"
    reason: str = ""
    unit: str | None = None


class Scenario(Section):
    """One scenario, checked; `provenance` tells where each value comes from, by its path."""

    title: str
    simulation: Simulation
    master: Settings = {}
    cable: CableSection | None = None
    robot: RobotSection | None = None
    contact: ContactSection = ContactSection()
    landing: Landing | None = None
    components: dict[str, Component] = {}
    connections: list[str] = []
    _path: Path = PrivateAttr(default=Path("scenario.toml"))
    _provenance: dict[str, Provenance] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _one_kind(self) -> Scenario:
        parts = {"cable": self.cable, "robot": self.robot, "landing": self.landing}
        missing = [name for name, part in parts.items() if part is None]
        if self.components and len(missing) < len(parts):
            raise ValueError("has both components and a landing; give one of them")
        if not self.components and missing:
            raise ValueError(f"{', '.join(missing)}: missing; a landing needs cable, robot and landing")
        return self

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
    def is_landing(self) -> bool:
        """Whether this is a landing and not a general graph."""
        return self.landing is not None

    def changed(self, options: Settings | None = None, **simulation: Any) -> Scenario:
        """Return a copy with other simulation settings (macro_step, …) and master `options`, checked again."""
        document = self.model_dump()
        document["simulation"] |= simulation
        document["master"] = document["master"] if options is None else options
        copy = Scenario.model_validate(document)
        copy._path, copy._provenance = self._path, self._provenance
        return copy


SECTIONS: dict[str, type[Section]] = {
    "simulation": Simulation,
    "cable": CableSection,
    "robot": RobotSection,
    "contact": ContactSection,
    "landing": Landing,
    "components": Component,
}
UNITS = {
    "simulation.stop_time": "s",
    "simulation.macro_step": "s",
    "simulation.timeout": "s",
    "landing.position": "m",
    "landing.height": "m",
    "landing.velocity": "m/s",
}
POSITIVE = {
    "cable": {
        "span",
        "unstretched_length",
        "n_elements",
        "axial_stiffness",
        "linear_density",
        "integration_step",
    },
    "robot": {"mass", "inertia.xx", "inertia.yy", "inertia.zz"},
    "contact": {"stiffness", "exponent", "wheel_radius", "groove_angle", "groove_width", "cable_diameter"}
    | {"max_contact_length"},
    "master": {"tolerance", "absolute", "max_iterations", "relaxation", "mixing", "difference", "inner_tolerance"}
    | {"inner_iterations", "slow", "refresh"},
}
NON_NEGATIVE = {
    "cable": {"bending_stiffness", "damping_time", "spectral_radius", "gravity"},
    "robot": {"gravity"},
    "contact": {"damping", "friction_coefficient"},
    "master": {"max_depth", "local_tolerance", "reuse", "depth", "threshold"},
}


@dataclass(frozen=True)
class Problem:
    """What is wrong with the value at `path`."""

    path: str
    message: str


def load(
    path: Path | str, overrides: Iterable[str] = (), robot: str | None = None, master: str | None = None
) -> Scenario:
    """Read, check and return a scenario; raise `InputError` with all problems at once.

    Parameters
    ----------
    path : the TOML file
    overrides : ``key=value`` in TOML syntax, ``robot.parameters.mass=12``; they replace what the file says
    robot : name of the catalogue or path of an FMU (relative to the current folder), in the robot's place
    master : in the master's place, with its own defaults: exchange and options of another do not fit it, but for the
        tolerance
    """
    path = Path(path)
    document = _named_tables(_read(path))
    if robot is not None:
        _replace_robot(document, robot)
    if master is not None:
        _replace_master(document, master)
    replaced = [_override(document, text) for text in overrides]
    problems: list[Problem] = []
    provenance: dict[str, Provenance] = {}
    plain = _unwrap(document, "", provenance, problems)
    _resolve_paths(plain, path.parent)
    scenario, invalid = _validated(plain)
    problems += [*invalid, *_check(plain, provenance)]
    if problems or scenario is None:
        raise InputError(_worded(problems, path, replaced))
    scenario._path = path
    scenario._provenance = provenance | {key: Provenance("command line") for key in replaced}
    return scenario


def _read(path: Path) -> Document:
    if not path.is_file():
        raise InputError(f"{path}: no such scenario file; `orchestrator list` shows those there are")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None


def _named_tables(document: Document) -> Document:
    """Return a copy in which nested keys of `NAMED_TABLES` are one name: ``inertia.xx`` and not a table."""
    copy: Document = {}
    for key, value in document.items():
        if not isinstance(value, dict):
            copy[key] = value
        elif key in NAMED_TABLES:
            copy[key] = dict(_flat(value))
        else:
            copy[key] = _named_tables(value)
    return copy


def _flat(table: Document, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict) and "value" not in value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def _override(document: Document, text: str) -> str:
    """Write one ``key=value`` into `document` and return the key."""
    path, equals, value = (part.strip() for part in text.partition("="))
    if not (path and equals and value):
        raise InputError(f"--set {text}: write key=value, for instance robot.parameters.mass=12")
    *tables, last = _keys(path)
    table = document
    for key in tables:
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise InputError(f"--set {text}: {key} is a value and has no keys below it")
    table[last] = _toml_value(value, text)
    return path


def _keys(path: str) -> list[str]:
    parts = path.split(".")
    for i, part in enumerate(parts):
        if part in NAMED_TABLES and i + 1 < len(parts):
            return [*parts[: i + 1], ".".join(parts[i + 1 :])]
    return parts


def _toml_value(value: str, text: str) -> Any:
    """Return a TOML value; a bare word is taken as a string, so that a shell's quotes can be left out."""
    try:
        return tomllib.loads(f"v = {value}")["v"]
    except tomllib.TOMLDecodeError:
        if re.fullmatch(r"[A-Za-z_./][\w./+-]*", value):
            return value
        raise InputError(f"--set {text}: {value} is not a TOML value; quote a string") from None


def _replace_robot(document: Document, robot: str) -> None:
    section = document.setdefault("robot", {})
    section.pop("model", None)
    section.pop("fmu", None)
    if robot.endswith(".fmu"):
        section["fmu"] = str(Path(robot).absolute())
    else:
        section["model"] = robot


def _replace_master(document: Document, master: str) -> None:
    simulation, options = document.setdefault("simulation", {}), document.get("master", {})
    if simulation.get("master", DEFAULT_MASTER) != master:
        known = vocabulary.masters().get(master, {})
        document["master"] = {key: value for key, value in options.items() if key == "tolerance" and key in known}
        simulation.pop("exchange", None)
    simulation["master"] = master


def _unwrap(table: Document, prefix: str, found: dict[str, Provenance], problems: list[Problem]) -> Document:
    """Return `table` with bare values; what the quantities say about themselves goes to `found`."""
    plain: Document = {}
    for key, value in table.items():
        path = prefix + key
        if isinstance(value, dict) and "value" in value:
            problems += _quantity_problems(path, value)
            texts = {k: str(value[k]) for k in QUANTITY_KEYS[1:] if k in value}
            found[path] = Provenance(**texts)
            plain[key] = value["value"]
        elif isinstance(value, dict):
            plain[key] = _unwrap(value, f"{path}.", found, problems)
        else:
            found[path] = Provenance()
            plain[key] = value
    return plain


def _quantity_problems(path: str, quantity: Document) -> Iterator[Problem]:
    for key in quantity:
        if key not in QUANTITY_KEYS:
            yield Problem(f"{path}.{key}", f"unknown key{nearest(key, QUANTITY_KEYS)}")
        elif key != "value" and not isinstance(quantity[key], str):
            yield Problem(f"{path}.{key}", "must be a string")
    if quantity.get("source") == "assumed" and not quantity.get("reason"):
        yield Problem(path, 'an assumed value needs a reason = "…"')


def _resolve_paths(document: Document, folder: Path) -> None:
    """Make the paths of FMUs absolute; they are relative to the scenario file."""
    sections = [document.get(key) for key in ("cable", "robot", "contact")]
    components = document.get("components", {})
    sections += components.values() if isinstance(components, dict) else []
    for section in sections:
        if isinstance(section, dict) and isinstance(section.get("fmu"), str):
            section["fmu"] = str((folder / section["fmu"]).absolute())


def _validated(plain: Document) -> tuple[Scenario | None, list[Problem]]:
    try:
        return Scenario.model_validate(plain), []
    except ValidationError as error:
        return None, [_translated(dict(e)) for e in error.errors()]


def _translated(error: dict[str, Any]) -> Problem:
    """Return pydantic's `error` in our words."""
    loc = [str(key) for key in error["loc"]]
    path = ".".join(loc)
    if error["type"] == "extra_forbidden":
        model = SECTIONS.get(loc[0], Scenario) if len(loc) > 1 else Scenario
        return Problem(path, f"unknown key{nearest(loc[-1], model.model_fields)}")
    if error["type"] == "missing":
        return Problem(path, "missing")
    message = error["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    shown = f"{error['input']!r} " if isinstance(error["input"], Scalar) else ""
    return Problem(path, shown + message)


def _check(document: Document, provenance: Mapping[str, Provenance]) -> Iterator[Problem]:
    """Yield what the types cannot see: names, kinds, units and bounds of parameters, places, files."""
    for path, unit in UNITS.items():
        yield from _unit_problems(path, provenance, unit)
    for section in ("cable", "robot", "contact"):
        if isinstance(document.get(section), dict):
            yield from _component_problems(section, section, document[section], provenance)
    components = document.get("components", {})
    for name, section in components.items() if isinstance(components, dict) else ():
        if isinstance(section, dict):
            yield from _component_problems(f"components.{name}", "", section, provenance)
    yield from _choice_problems(document)
    yield from _step_problems(document)
    yield from _position_problems(document)


def _component_problems(
    path: str, kind: str, section: Document, provenance: Mapping[str, Provenance]
) -> Iterator[Problem]:
    fmu = section.get("fmu")
    try:
        known = vocabulary.of_fmu(Path(fmu)) if isinstance(fmu, str) else _own(kind, section)
    except InputError as error:
        yield from (Problem(f"{path}.{'fmu' if fmu else 'model'}", problem) for problem in error.problems)
        return
    for group, causality in (("parameters", "parameter"), ("inputs", "input")):
        values = section.get(group, {})
        for name, value in values.items() if isinstance(values, dict) else ():
            place = f"{path}.{group}.{name}"
            names = [v.name for v in known.values() if v.causality == causality]
            if name not in names:
                other = f"is no {causality}; its causality is {known[name].causality}" if name in known else ""
                yield Problem(place, other or f"unknown key{nearest(name, names)}")
                continue
            yield from _value_problems(place, known[name], value)
            yield from _unit_problems(place, provenance, known[name].unit)
            yield from _bound_problems(place, kind, name, value)


def _own(kind: str, section: Document) -> dict[str, vocabulary.Variable]:
    """Return the variables of our own module: a landing's `kind`, or a component's `model`."""
    if kind:
        return vocabulary.of_module(kind, section.get("model"))
    model = section.get("model")
    if isinstance(model, str) and model not in vocabulary.MODELS:
        raise InputError(f"no model {model!r}{nearest(model, vocabulary.MODELS)}")
    return vocabulary.of_module(model) if isinstance(model, str) else {}


def _value_problems(path: str, variable: vocabulary.Variable, value: Any) -> Iterator[Problem]:
    if not isinstance(value, Scalar):
        return  # the types have said so
    wanted = {"real": (int, float), "integer": int, "boolean": bool, "string": str}[variable.kind]
    is_bool = isinstance(value, bool)
    if not isinstance(value, wanted) or is_bool != (variable.kind == "boolean"):
        yield Problem(path, f"{value!r} is not of type {variable.kind}")
    elif isinstance(value, float) and not abs(value) < float("inf"):
        yield Problem(path, f"{value!r} must be a finite number")
    elif variable.choices and value not in variable.choices:
        yield Problem(path, f"{value!r} is not one of {', '.join(variable.choices)}")


def _unit_problems(path: str, provenance: Mapping[str, Provenance], wanted: str) -> Iterator[Problem]:
    given = provenance[path].unit if path in provenance else None
    if given is not None and given != (wanted or "1"):
        yield Problem(path, f"unit is {given}; {wanted or '1'} is wanted, convert the value")


def _bound_problems(path: str, kind: str, name: str, value: Any) -> Iterator[Problem]:
    if not _is_number(value):
        return
    if name in POSITIVE.get(kind, ()) and value <= 0:
        yield Problem(path, f"{value!r} must be greater than 0")
    if name in NON_NEGATIVE.get(kind, ()) and value < 0:
        yield Problem(path, f"{value!r} must not be negative")


def _choice_problems(document: Document) -> Iterator[Problem]:
    """Yield a master or robot that does not exist, and options that a master does not have."""
    simulation, robot, options = (_table(document, key) for key in ("simulation", "robot", "master"))
    name, model = simulation.get("master", DEFAULT_MASTER), robot.get("model")
    masters = vocabulary.masters()
    if isinstance(name, str) and name not in masters:
        yield Problem("simulation.master", f"no master {name!r}{nearest(name, masters)}")
    for key, value in options.items() if name in masters else ():
        if key not in masters[name]:
            yield Problem(f"master.{key}", f"unknown key for master {name}{nearest(key, masters[name])}")
        elif not _is_like(value, masters[name][key]):
            wanted = type(masters[name][key]).__name__
            yield Problem(f"master.{key}", f"{value!r} is not of type {wanted}")
        else:
            yield from _bound_problems(f"master.{key}", "master", key, value)
    robots = vocabulary.robots()
    if isinstance(model, str) and model not in robots:
        yield Problem("robot.model", f"no robot {model!r} in the catalogue{nearest(model, robots)}")


def _is_like(value: Any, default: Any) -> bool:
    """Whether `value` is of the type of `default`; a whole number may stand for a real one."""
    if isinstance(default, float):
        return _is_number(value)
    return type(value) is type(default) or default is None


def _step_problems(document: Document) -> Iterator[Problem]:
    simulation = _table(document, "simulation")
    stop, step = simulation.get("stop_time"), simulation.get("macro_step")
    if not (_is_number(stop) and _is_number(step) and 0.0 < step < float("inf") and 0.0 < stop < float("inf")):
        return
    n = max(1, round(stop / step))
    if abs(n * step - stop) > 1e-9 * stop:
        yield Problem(
            "simulation.macro_step", f"{step:g} s does not divide stop_time {stop:g} s; {stop / n:.6g} s does"
        )


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _position_problems(document: Document) -> Iterator[Problem]:
    position = _table(document, "landing").get("position")
    span = _table(_table(document, "cable"), "parameters").get("span")
    if span is None and "fmu" not in _table(document, "cable"):
        span = vocabulary.of_module("cable")["span"].start
    if _is_number(position) and _is_number(span) and 0 < span < float("inf") and not 0 < position < span:
        yield Problem("landing.position", f"{position:g} m is off the span; it must lie within 0 … {span:g} m")


def _table(document: Document, key: str) -> Document:
    value = document.get(key)
    return value if isinstance(value, dict) else {}


def _worded(problems: list[Problem], file: Path, replaced: list[str]) -> Iterator[str]:
    for problem in problems:
        by_option = any(_related(problem.path, key) for key in replaced)
        place = "--set" if by_option else str(file)
        yield f"{place}: {problem.path}: {problem.message}" if problem.path else f"{place}: {problem.message}"


def _related(path: str, key: str) -> bool:
    return path != "" and (f"{key}.".startswith(f"{path}.") or path.startswith(f"{key}."))
