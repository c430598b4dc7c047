"""What a scenario's files and the options of a command say, laid over one another."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import (
    DEEPEST,
    TOO_DEEP,
    Document,
    Stack,
    bare,
    chain,
    is_over_time,
    is_quantity,
    is_whole,
    leaves,
    merged,
    parsed,
    read,
)
from orchestrator.catalogue.scenarios import find
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.masters.options import master_options
from orchestrator.scenario import line_state
from orchestrator.scenario.named_sets import make_room
from orchestrator.scenario.ssp.archive import is_structure
from orchestrator.scenario.ssp.document import document as of_structure
from orchestrator.scenario.types import DEFAULT_MASTER

NAMED_TABLES = ("parameters", "inputs", "tolerances")
"""Tables whose keys are variables' names: the dots in them are part of the name."""
SET = "--set"


def files(path: Path) -> tuple[Stack, list[str]]:
    """Return the scenario file at `path` over those that it extends, and what is to be said of it."""
    stack, notes = Stack(), []

    def content(file: Path) -> Document:
        if not is_structure(file):
            return read(file)
        document, said = of_structure(file)
        notes.extend(said)
        return document

    for file, document in chain(path, find, content):
        named = named_tables(document)
        resolve_paths(named, file.parent)
        notes += lay(stack, named, str(file))
    return stack, notes


def lay(stack: Stack, above: Document, place: str) -> list[str]:
    """Lay `above` over the stack; return what is to be said of it.

    What belongs to another model does not stay: a section that names another model or FMU starts empty, another master
    starts with its own defaults, the tolerance excepted.
    """
    notes = []
    for section in _sections(above):
        below = _table(stack.document, section)
        if below is not None and _is_another(below, _table(above, section) or {}):
            notes += _left_behind(section, below)
            _drop(stack.document, section)
    simulation = above.get("simulation")
    master = bare(simulation.get("master")) if isinstance(simulation, dict) else None
    if isinstance(master, str):
        _make_room_for_master(stack.document, master)
    notes += _make_room(stack.document, above)
    stack.put(above, place)
    return notes


def _make_room(document: Document, above: Document) -> list[str]:
    """Take from `document` what `above` gives anew by another name; return what is to be said of it."""
    return [*make_room(document, above), *line_state.make_room(document, above)]


def _sections(document: Document) -> Iterator[tuple[str, ...]]:
    """Yield the places of the sections that may name a model or an FMU."""
    for key in ("cable", "robot", "contact", "controller"):
        if key in document:
            yield (key,)
    components = document.get("components")
    for name in components if isinstance(components, dict) else ():
        yield "components", name


def _table(document: Document, place: tuple[str, ...]) -> Document | None:
    table: Any = document
    for key in place:
        table = table.get(key) if isinstance(table, dict) else None
    return table if isinstance(table, dict) else None


def _is_another(below: Document, above: Document) -> bool:
    given = [key for key in ("model", "fmu") if key in above]
    return any(bare(above[key]) != bare(below.get(key)) for key in given)


def _left_behind(place: tuple[str, ...], below: Document) -> Iterator[str]:
    lost = [f"{group}.{name}" for group in ("parameters", "inputs") for name in _table(below, (group,)) or {}]
    was = bare(below.get("model")) or bare(below.get("fmu"))
    if lost:
        whose = f"{was}'s" if was else "those of our own module"
        yield f"{'.'.join(place)}: {', '.join(lost)} are {whose} and not taken over for another"


def _drop(document: Document, place: tuple[str, ...]) -> None:
    *above, last = place
    table = _table(document, tuple(above))
    if table is not None:
        del table[last]


def _make_room_for_master(document: Document, master: str) -> None:
    simulation, options = (_table(document, (key,)) or {} for key in ("simulation", "master"))
    if bare(simulation.get("master", DEFAULT_MASTER)) != master:
        document["master"] = shared_options(options, master)
        simulation.pop("exchange", None)


def shared_options(options: Document, master: str) -> Document:
    """Return those `options` of one master that are also for another: the tolerance."""
    known = master_options().get(master, {})
    return {key: value for key, value in options.items() if key == "tolerance" and key in known}


# -- files -------------------------------------------------------------------------------------------------------


def named_tables(document: Document) -> Document:
    """Return a copy in which nested keys of `NAMED_TABLES` are one name: ``inertia.xx`` and not a table."""
    copy: Document = {}
    for key, value in document.items():
        if not isinstance(value, dict):
            copy[key] = value
        elif key in NAMED_TABLES:
            copy[key] = dict(_flat(value))
        else:
            copy[key] = named_tables(value)
    return copy


def _flat(table: Document, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict) and not is_whole(value):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def resolve_paths(document: Document, folder: Path) -> None:
    """Make the paths of FMUs, of robots' and conductors' files and of tables absolute; they are relative to their file."""
    for place in _sections(document):
        section = _table(document, place) or {}
        for key in ("fmu", "model", "conductor"):
            text = bare(section.get(key))
            if isinstance(text, str) and (key == "fmu" or shelf.is_file(text)):
                path = str((folder / text).absolute())
                section[key] = section[key] | {"value": path} if is_quantity(section[key]) else path
        for name, value in (_table(section, ("inputs",)) or {}).items():
            if is_over_time(value) and isinstance(value.get("file"), str):
                section["inputs"][name] = value | {"file": str((folder / value["file"]).absolute())}


# -- options of a command ----------------------------------------------------------------------------------------


def replace_robot(stack: Stack, robot: str) -> list[str]:
    """Put another robot in place: a name of the catalogue, or the path of a robot's file or of an FMU."""
    key = "fmu" if robot.endswith(".fmu") else "model"
    section = {key: robot}
    above = {"robot": section}
    resolve_paths(above, Path())
    return lay(stack, above, "--robot")


def replace_master(stack: Stack, master: str) -> None:
    """Put another master in place, with its own defaults, the tolerance excepted."""
    lay(stack, {"simulation": {"master": master}}, "--master")


def override(stack: Stack, texts: Iterable[str], folder: Path) -> list[str]:
    """Write each ``key=value`` into the document; return what is to be said of it.

    Together they are one file, the last; `folder` is what paths in them are relative to.
    """
    changes = [_parsed(text) for text in texts]
    together: Document = {}
    for _, tables, given in changes:
        together = merged(together, _within(tables, given))
    resolve_paths(together, folder)
    notes = _make_room(stack.document, together)
    for text, tables, given in changes:
        table = stack.document
        for key in tables:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise InputError(f"{SET} {text}: {key} is a value and has no keys below it")
        table |= given
        prefix = "".join(f"{key}." for key in tables)
        stack.note(SET, [prefix + next(iter(given)), *leaves(given, prefix)])
    return notes


def _parsed(text: str) -> tuple[str, list[str], Document]:
    """Return a ``key=value``, the tables that it goes through, and the last key with its value."""
    path, equals, value = (part.strip() for part in text.partition("="))
    if not (path and equals and value):
        raise InputError(f"{SET} {text}: write key=value, for instance robot.parameters.mass=12")
    *tables, last = _keys(path)
    if len(tables) > DEEPEST:
        raise InputError(f"{SET} {text}: {TOO_DEEP}")
    return text, tables, named_tables({last: _toml_value(value, text)})


def _within(tables: list[str], given: Document) -> Document:
    for key in reversed(tables):
        given = {key: given}
    return given


def _keys(path: str) -> list[str]:
    parts = path.split(".")
    for i, part in enumerate(parts):
        if part in NAMED_TABLES and i + 1 < len(parts):
            return [*parts[: i + 1], ".".join(parts[i + 1 :])]
    return parts


def _toml_value(value: str, text: str) -> Any:
    """Return a TOML value; a bare word is taken as a string, so that a shell's quotes can be left out."""
    try:
        found = parsed(f"v = {value}")
    except ValueError as error:
        if re.fullmatch(r"[A-Za-z_./][\w./+-]*", value):
            return value
        why = "is not a TOML value; quote a string" if isinstance(error, tomllib.TOMLDecodeError) else str(error)
        raise InputError(f"{SET} {text}: {value} {why}") from None
    if len(found) > 1:
        raise InputError(f"{SET} {text}: give one value, and the next with a {SET} of its own")
    return found["v"]
