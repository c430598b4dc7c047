"""What can be named in a scenario: variables of modules and FMUs, masters and their options, robots."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmus.module import registry
from fmus.module.variables import Bounds, Kind, ModuleError, Value, Variable
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.reading import is_file

NOTHING: Mapping[str, Any] = {}


def of_module(kind: str, robot: str | None = None) -> dict[str, Variable]:
    """Return the variables of a module of the registry by name; raise `InputError` if it cannot be found.

    Parameters
    ----------
    kind : key of the registry
    robot : name of the catalogue, or path of a TOML file; the number of its wheels decides which variables there are
    """
    arguments: dict[str, Value] = {}
    if robot is not None:
        from orchestrator.catalogue.robot_spec import load_robot

        arguments["n_wheels"] = load_robot(robot).n_wheels
    try:
        table = registry.find(kind).table(**arguments)
    except ModuleError as error:
        raise InputError(str(error)) from None
    return {v.name: v for v in table.variables}


def of_fmu(path: Path, settings: Mapping[str, Any] = NOTHING) -> dict[str, Variable]:
    """Return the variables of the FMU at `path` by name; raise `InputError` if it is none.

    Parameters
    ----------
    settings : values of parameters; on structural ones the lengths of arrays hang
    """
    from orchestrator.coupling.fmu.description import KINDS, STRUCTURAL, element_names, structure_of

    known: dict[str, Variable] = {}
    found = description(path)
    try:
        structure = structure_of(found, settings)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    for v in found.modelVariables:
        tunable = v.causality == "parameter" and v.variability == "tunable"
        parameter = v.causality in ("parameter", STRUCTURAL) or (v.causality == "local" and v.variability == "tunable")
        kind = KINDS.get(v.type, "integer")
        if kind in ("binary", "clock"):  # nothing that a scenario or a contract speaks of
            continue
        fixed = (
            "parameter" if parameter else "input" if v.causality == "input" else "output",
            v.unit or (v.declaredType.unit if v.declaredType else None) or "1",
            _start(v.start, kind),
            v.description or "",
            kind,
        )
        bounds = Bounds(ge=1) if v.causality == STRUCTURAL and not v.min else _bounds(v)
        names = element_names(v, structure)
        known |= {name: Variable(name, *fixed, discrete=tunable, bounds=bounds) for name in names}
    return known


def _bounds(variable: Any) -> Bounds:
    """Return min and max of a variable of a model description, or those of its declared type."""
    least, most = (getattr(variable, n) or getattr(variable.declaredType, n, None) for n in ("min", "max"))
    return Bounds(ge=_number(least), le=_number(most))


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def _start(text: str | None, kind: Kind) -> Value:
    """Return a start value of a model description; an empty string if there is none, or an array's."""
    if text is None or kind == "string":
        return text or ""
    if kind == "boolean":
        return text in ("true", "1")
    try:
        return int(text) if kind == "integer" else float(text)
    except ValueError:
        return ""


def description(path: Path) -> Any:
    """Return FMPy's model description of the FMU at `path`; raise `InputError` if it is none."""
    if not is_file(path):
        raise InputError(f"{path}: no such file")
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path}: not an FMU: not a zip archive")
    from orchestrator.coupling.fmu.archive import ArchiveError
    from orchestrator.coupling.fmu.description import parsed
    from orchestrator.coupling.fmu.standard import DescriptionError

    try:
        return parsed(path)
    except (ArchiveError, DescriptionError) as error:
        raise InputError(f"{path}: not an FMU: {error}") from None
    except Exception as error:  # FMPy and lxml raise many kinds; each means the same to the user
        raise InputError(f"{path}: not an FMU: its modelDescription.xml cannot be read: {error}") from None


def robots() -> list[str]:
    """Return the names of the robots of the catalogue."""
    from orchestrator.catalogue.robot_spec import names

    return names()
