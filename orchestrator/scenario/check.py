"""What the types of a scenario cannot see: names, kinds, units and bounds of parameters, places, files."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeGuard

from fmus.module import registry
from fmus.module.units import UnitError, convert
from fmus.module.variables import Variable
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.documents import Document, table_of
from orchestrator.catalogue.quantities import Complaint, Scalar
from orchestrator.coupling.errors import InputError, digits, nearest
from orchestrator.coupling.masters.options import master_options, out_of_bounds, takes
from orchestrator.coupling.steps import number_of
from orchestrator.scenario.over_time import OverTime, is_tunable, problems_of
from orchestrator.scenario.types import DEFAULT_MASTER, UNITS, Provenance

Known = Mapping[str, Mapping[str, Variable]]
"""Section → its variables by name."""
LARGEST = sys.float_info.max
SPACING = ("conductor_spacing", "safe_clearance")
GROUPS = {"parameters": "parameter", "inputs": "input"}
"""Table of a section → causality of the variables that it sets."""


def known_variables(document: Document) -> tuple[Known, list[Complaint]]:
    """Return the variables of every section that stands for an FMU, and what is wrong with those that have none."""
    known: dict[str, Mapping[str, Variable]] = {}
    problems: list[Complaint] = []
    for path, kind, section in _sections(document):
        fmu = section.get("fmu")
        try:
            settings = table_of(section, "parameters")
            known[path] = vocabulary.of_fmu(Path(fmu), settings) if isinstance(fmu, str) else _own(kind, section)
        except InputError as error:
            problems += [Complaint(f"{path}.{'fmu' if fmu else 'model'}", problem) for problem in error.problems]
    return known, problems


def _sections(document: Document) -> Iterator[tuple[str, str, Document]]:
    """Yield path, kind (of a landing) and content of every section that stands for an FMU."""
    for kind in ("cable", "robot", "contact", "controller"):
        if isinstance(document.get(kind), dict):
            yield kind, kind, document[kind]
    for name, section in table_of(document, "components").items():
        if isinstance(section, dict):
            yield f"components.{name}", "", section


def _own(kind: str, section: Document) -> dict[str, Variable]:
    """Return the variables of our own module: a landing's `kind`, or the `model` of a component or a controller."""
    model = section.get("model")
    if kind and kind != "controller":
        return vocabulary.of_module(kind, model if kind == "robot" and isinstance(model, str) else None)
    if isinstance(model, str) and model not in registry.names():
        raise InputError(f"no model {model!r}{nearest(model, registry.names())}")
    return vocabulary.of_module(model) if isinstance(model, str) else {}


# -- units -------------------------------------------------------------------------------------------------------


def to_si(document: Document, known: Known, provenance: dict[str, Provenance], prefix: str = "") -> Iterator[Complaint]:
    """Convert the values that give a unit to the unit wanted, in place; yield what does not convert."""
    for key, value in document.items():
        path = prefix + key
        if isinstance(value, dict):
            yield from to_si(value, known, provenance, f"{path}.")
            continue
        given, wanted = provenance[path].unit if path in provenance else None, _unit_of(path, known)
        if given is None or wanted is None or given == wanted:
            continue
        try:
            document[key] = _converted(value, given, wanted)
            shown = f"{len(value.time)} values in" if isinstance(value, OverTime) else value
            provenance[path] = replace(provenance[path], written=provenance[path].written or f"{shown} {given}")
        except UnitError as error:
            yield Complaint(path, str(error))


def _converted(value: Any, given: str, wanted: str) -> Any:
    if isinstance(value, OverTime):
        return value.converted(given, wanted)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return convert(value, given, wanted)
    raise UnitError(f"{value!r} is no number and has no unit")


def _unit_of(path: str, known: Known) -> str | None:
    """Return the unit in which the value at `path` is wanted; None if there is no such variable."""
    for section, variables in known.items():
        for group in GROUPS:
            if path.startswith(f"{section}.{group}."):
                variable = variables.get(path.removeprefix(f"{section}.{group}."))
                return (variable.unit or "1") if variable is not None else None
    return UNITS.get(path, "1")


# -- values ------------------------------------------------------------------------------------------------------


def check(document: Document, known: Known) -> Iterator[Complaint]:
    """Yield what the types cannot see: names, kinds and bounds of parameters, masters, places."""
    for path, _, section in _sections(document):
        if path in known:
            yield from _section_problems(path, section, known[path])
    yield from _master_problems(document)
    yield from _step_problems(document)
    yield from _position_problems(document, known)
    yield from _limit_problems(document)
    yield from _controller_problems(document, known)


def _section_problems(path: str, section: Document, known: Mapping[str, Variable]) -> Iterator[Complaint]:
    for group, causality in GROUPS.items():
        names = [v.name for v in known.values() if v.causality == causality]
        for name, value in table_of(section, group).items():
            place = f"{path}.{group}.{name}"
            if name in known and is_tunable(known[name]) and (misplaced := _misplaced(group, value)):
                yield Complaint(place, misplaced)
            elif name in names or (name in known and is_tunable(known[name])):
                yield from _value_problems(place, known[name], value)
            elif name in known:
                yield Complaint(place, f"is no {causality}; its causality is {known[name].causality}")
            else:
                yield Complaint(place, f"unknown key{nearest(name, names)}")


def _misplaced(group: str, value: Any) -> str:
    """Return what is wrong with the table in which a tunable parameter stands; empty if nothing is."""
    if group == "parameters" and isinstance(value, OverTime):
        return "is a tunable parameter; its table stands in inputs"
    if group == "inputs" and not isinstance(value, OverTime):
        return "is a parameter; one value for it stands in parameters, a table in inputs"
    return ""


def _value_problems(path: str, variable: Variable, value: Any) -> Iterator[Complaint]:
    if isinstance(value, OverTime):
        yield from problems_of(path, variable, value)
    if not isinstance(value, Scalar):
        return  # the types have said so
    wanted = {"real": (int, float), "integer": int, "boolean": bool, "string": str}[variable.kind]
    is_bool = isinstance(value, bool)
    if not isinstance(value, wanted) or is_bool != (variable.kind == "boolean"):
        yield Complaint(path, f"{value!r} is not of type {variable.kind}")
    elif isinstance(value, int | float) and not abs(value) <= LARGEST:
        yield Complaint(path, f"{value!r} must be a finite number")
    elif variable.choices and value not in variable.choices:
        yield Complaint(path, f"{value!r} is not one of {', '.join(variable.choices)}")
    elif _is_number(value) and not variable.bounds.admit(value):
        yield Complaint(path, f"{value!r} must be {variable.bounds}")


def _master_problems(document: Document) -> Iterator[Complaint]:
    """Yield a master that does not exist, and options that it does not have or that are out of bounds."""
    name, options = table_of(document, "simulation").get("master", DEFAULT_MASTER), table_of(document, "master")
    masters = master_options()
    if isinstance(name, str) and name not in masters:
        yield Complaint("simulation.master", f"no master {name!r}{nearest(name, masters)}")
    for key, value in options.items() if isinstance(name, str) and name in masters else ():
        if key not in masters[name]:
            yield Complaint(f"master.{key}", f"unknown key for master {name}{nearest(key, masters[name])}")
        elif not (_is_like(value, masters[name][key]) or takes(name, key, value)):
            yield Complaint(f"master.{key}", f"{value!r} is not of type {type(masters[name][key]).__name__}")
        elif _is_number(value) and (wanted := out_of_bounds(name, key, value)):
            yield Complaint(f"master.{key}", f"{value!r} must be {wanted}")


def _is_like(value: Any, default: Any) -> bool:
    """Whether `value` is of the type of `default`; a whole number may stand for a real one."""
    if isinstance(default, float):
        return _is_number(value)
    return type(value) is type(default) or default is None


def _step_problems(document: Document) -> Iterator[Complaint]:
    simulation = table_of(document, "simulation")
    start, stop, step = (simulation.get(key, 0.0) for key in ("start_time", "stop_time", "macro_step"))
    if not (_is_number(start) and _is_number(stop) and _is_number(step) and 0.0 < step < float("inf")):
        return
    span = stop - start
    if not 0.0 < span < float("inf"):
        return
    try:
        n = number_of(span, step)
    except ValueError as error:
        yield Complaint("simulation.macro_step", f"{digits(step)} s: {error}")
        return
    if abs(n * step - span) > 1e-9 * span:
        what = f"stop_time {digits(stop)} s" if start == 0.0 else f"the {digits(span)} s from start_time to stop_time"
        yield Complaint("simulation.macro_step", f"{digits(step)} s does not divide {what}; {digits(span / n)} s does")


def _is_number(value: Any) -> TypeGuard[float]:
    """Whether `value` is a number that has a place among floats."""
    return isinstance(value, float) or (type(value) is int and abs(value) <= LARGEST)


def _position_problems(document: Document, known: Known) -> Iterator[Complaint]:
    position, cable = table_of(document, "landing").get("position"), table_of(document, "cable")
    span = table_of(cable, "parameters").get("span")
    if span is None and "fmu" not in cable and "cable" in known:
        span = known["cable"]["span"].start
    if _is_number(position) and _is_number(span) and 0 < span < float("inf") and not 0 < position < span:
        yield Complaint("landing.position", f"{position:g} m is off the span; it must lie within 0 … {span:g} m")


def _limit_problems(document: Document) -> Iterator[Complaint]:
    """Yield limits that lack what they are counted by."""
    limits = table_of(document, "limits")
    if _is_number(limits.get("tension")) and "rated_strength" not in limits:
        cure = "give limits.rated_strength as well, or a conductor that has one"
        yield Complaint("limits.tension", f"is a share of the rated tensile strength; {cure}")
    for here, there in (SPACING, SPACING[::-1]):
        if here in limits and there not in limits:
            yield Complaint(f"limits.{here}", f"says nothing without limits.{there}; give both")


def _controller_problems(document: Document, known: Known) -> Iterator[Complaint]:
    """Yield a model that is no controller, and inputs of the robot that the scenario gives beside it."""
    section = document.get("controller")
    if not isinstance(section, dict):
        return
    model = section.get("model")
    if isinstance(model, str) and model in registry.names() and registry.find(model).contract != "controller":
        yield Complaint("controller.model", f"{model} is no controller{nearest(model, controllers())}")
    outputs = [v.name for v in known.get("controller", {}).values() if v.causality == "output"]
    for name in table_of(table_of(document, "robot"), "inputs"):
        if name in outputs:
            yield Complaint(f"robot.inputs.{name}", "is what the controller gives; leave it out, or the controller")


def controllers() -> list[str]:
    """Return the modules that can play the part of a controller."""
    return [key for key, entry in registry.MODULES.items() if entry.contract == "controller"]
