"""From a TOML file to a checked scenario."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import (
    ValidationError,
)

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.masters.options import master_options
from orchestrator.scenario.check import Complaint, Document, check
from orchestrator.scenario.types import (
    DEFAULT_MASTER,
    CableSection,
    Component,
    ContactSection,
    GraphScenario,
    Landing,
    LandingScenario,
    Provenance,
    RobotSection,
    Scalar,
    Scenario,
    Section,
    Simulation,
)

NAMED_TABLES = ("parameters", "inputs", "tolerances")
"""Tables whose keys are variables' names: the dots in them are part of the name."""
QUANTITY_KEYS = ("value", "source", "reason", "unit")


LANDING_KEYS = ("cable", "robot", "contact", "landing")
GRAPH_KEYS = ("components", "connections")
MISSING: dict[str, str] = dict.fromkeys(
    ("cable", "robot", "landing"), "missing; a landing needs cable, robot and landing, a general graph components"
)
SECTIONS: dict[str, type[Section]] = {
    "simulation": Simulation,
    "cable": CableSection,
    "robot": RobotSection,
    "contact": ContactSection,
    "landing": Landing,
    "components": Component,
}


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
    problems: list[Complaint] = []
    provenance: dict[str, Provenance] = {}
    plain = _unwrap(document, "", provenance, problems)
    _resolve_paths(plain, path.parent)
    scenario, invalid = _validated(plain)
    problems += [*invalid, *check(plain, provenance)]
    if problems or scenario is None:
        raise InputError(_worded(problems, path, replaced))
    return scenario.placed_at(path, provenance | {key: Provenance("command line") for key in replaced})


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
        known = master_options().get(master, {})
        document["master"] = {key: value for key, value in options.items() if key == "tolerance" and key in known}
        simulation.pop("exchange", None)
    simulation["master"] = master


def _unwrap(table: Document, prefix: str, found: dict[str, Provenance], problems: list[Complaint]) -> Document:
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


def _quantity_problems(path: str, quantity: Document) -> Iterator[Complaint]:
    for key in quantity:
        if key not in QUANTITY_KEYS:
            yield Complaint(f"{path}.{key}", f"unknown key{nearest(key, QUANTITY_KEYS)}")
        elif key != "value" and not isinstance(quantity[key], str):
            yield Complaint(f"{path}.{key}", "must be a string")
    if quantity.get("source") == "assumed" and not quantity.get("reason"):
        yield Complaint(path, 'an assumed value needs a reason = "…"')


def _resolve_paths(document: Document, folder: Path) -> None:
    """Make the paths of FMUs absolute; they are relative to the scenario file."""
    sections = [document.get(key) for key in ("cable", "robot", "contact")]
    components = document.get("components", {})
    sections += components.values() if isinstance(components, dict) else []
    for section in sections:
        if isinstance(section, dict) and isinstance(section.get("fmu"), str):
            section["fmu"] = str((folder / section["fmu"]).absolute())


def _validated(plain: Document) -> tuple[Scenario | None, list[Complaint]]:
    """Return the landing or general graph, whichever the tables are those of, or what is wrong with it."""
    kind = GraphScenario if any(key in plain for key in GRAPH_KEYS) else LandingScenario
    if kind is GraphScenario and any(key in plain for key in LANDING_KEYS):
        return None, [Complaint("", "has both components and a landing; give one of them")]
    try:
        return kind.model_validate(plain), []
    except ValidationError as error:
        return None, [_translated(dict(e)) for e in error.errors()]


def _translated(error: dict[str, Any]) -> Complaint:
    """Return pydantic's `error` in our words."""
    loc = [str(key) for key in error["loc"]]
    path = ".".join(loc)
    if error["type"] == "extra_forbidden":
        return Complaint(path, f"unknown key{nearest(loc[-1], _known_keys(loc))}")
    if error["type"] == "missing":
        return Complaint(path, MISSING.get(path, "missing"))
    message = error["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    shown = f"{error['input']!r} " if isinstance(error["input"], Scalar) else ""
    return Complaint(path, shown + message)


def _known_keys(loc: list[str]) -> list[str]:
    if len(loc) > 1:
        return list(SECTIONS[loc[0]].model_fields)
    return [*LandingScenario.model_fields, *GRAPH_KEYS]


def _worded(problems: list[Complaint], file: Path, replaced: list[str]) -> Iterator[str]:
    for problem in problems:
        by_option = any(_related(problem.path, key) for key in replaced)
        place = "--set" if by_option else str(file)
        yield f"{place}: {problem.path}: {problem.message}" if problem.path else f"{place}: {problem.message}"


def _related(path: str, key: str) -> bool:
    return path != "" and (f"{key}.".startswith(f"{path}.") or path.startswith(f"{key}."))
