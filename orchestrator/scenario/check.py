"""What the types of a scenario cannot see: names, kinds, units and bounds of parameters, places, files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from orchestrator.catalogue import modules as vocabulary
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.masters.options import master_options
from orchestrator.scenario.types import DEFAULT_MASTER, Provenance, Scalar

Document = dict[str, Any]
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
class Complaint:
    """What is wrong with the value at `path`."""

    path: str
    message: str


def check(document: Document, provenance: Mapping[str, Provenance]) -> Iterator[Complaint]:
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
) -> Iterator[Complaint]:
    fmu = section.get("fmu")
    try:
        known = vocabulary.of_fmu(Path(fmu)) if isinstance(fmu, str) else _own(kind, section)
    except InputError as error:
        yield from (Complaint(f"{path}.{'fmu' if fmu else 'model'}", problem) for problem in error.problems)
        return
    for group, causality in (("parameters", "parameter"), ("inputs", "input")):
        values = section.get(group, {})
        for name, value in values.items() if isinstance(values, dict) else ():
            place = f"{path}.{group}.{name}"
            names = [v.name for v in known.values() if v.causality == causality]
            if name not in names:
                other = f"is no {causality}; its causality is {known[name].causality}" if name in known else ""
                yield Complaint(place, other or f"unknown key{nearest(name, names)}")
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


def _value_problems(path: str, variable: vocabulary.Variable, value: Any) -> Iterator[Complaint]:
    if not isinstance(value, Scalar):
        return  # the types have said so
    wanted = {"real": (int, float), "integer": int, "boolean": bool, "string": str}[variable.kind]
    is_bool = isinstance(value, bool)
    if not isinstance(value, wanted) or is_bool != (variable.kind == "boolean"):
        yield Complaint(path, f"{value!r} is not of type {variable.kind}")
    elif isinstance(value, float) and not abs(value) < float("inf"):
        yield Complaint(path, f"{value!r} must be a finite number")
    elif variable.choices and value not in variable.choices:
        yield Complaint(path, f"{value!r} is not one of {', '.join(variable.choices)}")


def _unit_problems(path: str, provenance: Mapping[str, Provenance], wanted: str) -> Iterator[Complaint]:
    given = provenance[path].unit if path in provenance else None
    if given is not None and given != (wanted or "1"):
        yield Complaint(path, f"unit is {given}; {wanted or '1'} is wanted, convert the value")


def _bound_problems(path: str, kind: str, name: str, value: Any) -> Iterator[Complaint]:
    if not _is_number(value):
        return
    if name in POSITIVE.get(kind, ()) and value <= 0:
        yield Complaint(path, f"{value!r} must be greater than 0")
    if name in NON_NEGATIVE.get(kind, ()) and value < 0:
        yield Complaint(path, f"{value!r} must not be negative")


def _choice_problems(document: Document) -> Iterator[Complaint]:
    """Yield a master or robot that does not exist, and options that a master does not have."""
    simulation, robot, options = (_table(document, key) for key in ("simulation", "robot", "master"))
    name, model = simulation.get("master", DEFAULT_MASTER), robot.get("model")
    masters = master_options()
    if isinstance(name, str) and name not in masters:
        yield Complaint("simulation.master", f"no master {name!r}{nearest(name, masters)}")
    for key, value in options.items() if name in masters else ():
        if key not in masters[name]:
            yield Complaint(f"master.{key}", f"unknown key for master {name}{nearest(key, masters[name])}")
        elif not _is_like(value, masters[name][key]):
            wanted = type(masters[name][key]).__name__
            yield Complaint(f"master.{key}", f"{value!r} is not of type {wanted}")
        else:
            yield from _bound_problems(f"master.{key}", "master", key, value)
    robots = vocabulary.robots()
    if isinstance(model, str) and model not in robots:
        yield Complaint("robot.model", f"no robot {model!r} in the catalogue{nearest(model, robots)}")


def _is_like(value: Any, default: Any) -> bool:
    """Whether `value` is of the type of `default`; a whole number may stand for a real one."""
    if isinstance(default, float):
        return _is_number(value)
    return type(value) is type(default) or default is None


def _step_problems(document: Document) -> Iterator[Complaint]:
    simulation = _table(document, "simulation")
    stop, step = simulation.get("stop_time"), simulation.get("macro_step")
    if not (_is_number(stop) and _is_number(step) and 0.0 < step < float("inf") and 0.0 < stop < float("inf")):
        return
    n = max(1, round(stop / step))
    if abs(n * step - stop) > 1e-9 * stop:
        yield Complaint(
            "simulation.macro_step", f"{step:g} s does not divide stop_time {stop:g} s; {stop / n:.6g} s does"
        )


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _position_problems(document: Document) -> Iterator[Complaint]:
    position = _table(document, "landing").get("position")
    span = _table(_table(document, "cable"), "parameters").get("span")
    if span is None and "fmu" not in _table(document, "cable"):
        span = vocabulary.of_module("cable")["span"].start
    if _is_number(position) and _is_number(span) and 0 < span < float("inf") and not 0 < position < span:
        yield Complaint("landing.position", f"{position:g} m is off the span; it must lie within 0 … {span:g} m")


def _table(document: Document, key: str) -> Document:
    value = document.get(key)
    return value if isinstance(value, dict) else {}
