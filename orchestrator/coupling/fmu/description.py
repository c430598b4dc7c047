"""What a model description says: variables as ports, capabilities."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import fmpy
import numpy as np
from fmpy.model_description import ModelDescription, ModelVariable, ValidationError

from orchestrator.coupling.fmu.archive import ArchiveError, files_of, sha256_of
from orchestrator.coupling.fmu.standard import (
    MOST_BYTES,
    DescriptionError,
    parsed_xml,
    require_consistent,
    require_sizes,
    require_usable,
)
from orchestrator.coupling.reading import is_file

NAME = "modelDescription.xml"
STRUCTURAL = "structuralParameter"
"""Causality of what the dimensions of arrays hang on (FMI 3.0)."""
Structure = Mapping[str, int]
NO_STRUCTURE: Structure = {}

Kind = Literal["real", "integer", "boolean", "string", "binary", "clock"]
KINDS: dict[str, Kind] = {
    "Real": "real",
    "Float64": "real",
    "Float32": "real",
    "Boolean": "boolean",
    "String": "string",
    "Binary": "binary",
    "Clock": "clock",
}
Value = float | int | bool | str


@dataclass(frozen=True)
class Port:
    """One scalar variable of an FMU; an array of FMI 3.0 is one port an element, ``name[1]``, ``name[2]`` …

    `variable` is the name of the whole variable, `size` its number of elements, `element` counts them from 0; `relative`:
    it is a difference of two quantities, in which an offset of the unit cancels.
    """

    name: str
    vr: int
    unit: str
    kind: Kind
    causality: str
    variability: str
    start: str | None
    fmi_type: str
    variable: str
    size: int = 1
    element: int = 0
    relative: bool = False

    @property
    def is_number(self) -> bool:
        """Whether it has a place among numbers."""
        return self.kind in ("real", "integer", "boolean")


@dataclass(frozen=True)
class Capabilities:
    """What the FMU says it can do; `internal_step`: its fixed internal step, s (FMI 3.0)."""

    rollback: bool
    serialize: bool
    variable_step: bool
    directional_derivatives: bool
    internal_step: float | None = None


def shape_of(variable: ModelVariable, structure: Structure = NO_STRUCTURE) -> tuple[int, ...]:
    """Return the lengths of an array along its dimensions; () of a scalar.

    Parameters
    ----------
    structure : values of structural parameters; others have their start values
    """
    lengths = (
        d.start if d.start is not None else structure.get(d.variable.name, d.variable.start)
        for d in variable.dimensions
    )
    return tuple(int(length) for length in lengths)


def element_names(variable: ModelVariable, structure: Structure = NO_STRUCTURE) -> list[str]:
    """Return the names of a variable's elements: ``x``, or ``x[1]``, ``x[2]`` …, or ``x[1,1]``, ``x[1,2]`` …"""
    shape = shape_of(variable, structure)
    if not shape:
        return [variable.name]
    places = np.ndindex(*shape)
    return [f"{variable.name}[{','.join(str(i + 1) for i in place)}]" for place in places]


def structure_of(description: ModelDescription, settings: Mapping[str, Any]) -> dict[str, int]:
    """Return those of the `settings` that are structural parameters; `ValueError` where the arrays become too large."""
    names = {v.name for v in description.modelVariables if v.causality == STRUCTURAL}
    found = {n: int(x) for n, x in settings.items() if n in names and isinstance(x, int) and not isinstance(x, bool)}
    if found:
        require_sizes(description.modelVariables, lambda variable: shape_of(variable, found))
    return found


def ports_of(variable: ModelVariable, structure: Structure = NO_STRUCTURE) -> list[Port]:
    """Return the scalar variables that a variable consists of; parameters as for `shape_of`."""
    kind = KINDS.get(variable.type, "integer")
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType else None) or ""
    names = element_names(variable, structure)
    size = len(names)
    fixed = (
        unit,
        kind,
        variable.causality,
        variable.variability,
        variable.start,
        variable.type,
        variable.name,
        size,
    )
    relative = bool(variable.relativeQuantity)
    return [Port(name, variable.valueReference, *fixed, i, relative) for i, name in enumerate(names)]


def parsed(path: Path) -> ModelDescription:
    """Return FMPy's model description of an FMU; the same content is parsed once, whenever it was written.

    `ValueError` says what is wrong with the archive, or with the description.
    """
    return _parsed(path, sha256_of(path))[0]


def departures(path: Path) -> tuple[str, ...]:
    """Return where a description departs from the standard, by FMPy's validation; the FMU can be run all the same."""
    return _parsed(path, sha256_of(path))[1]


@lru_cache(maxsize=32)
def _parsed(path: Path, sha256: str) -> tuple[ModelDescription, tuple[str, ...]]:
    root = _root(path)
    require_usable(root)
    try:
        description, problems = fmpy.read_model_description(str(path), validate=True), ()
    except ValidationError as error:
        description, problems = fmpy.read_model_description(str(path), validate=False), tuple(error.problems)
    require_consistent(description)
    relative = _differences(root)
    for variable in description.modelVariables:
        stated, type_ = relative.get(variable.name), variable.declaredType
        variable.relativeQuantity = bool(type_ and type_.relativeQuantity) if stated is None else stated
    return description, problems


def _differences(root: ElementTree.Element) -> dict[str, bool]:
    """Return what the reals of a description say of ``relativeQuantity``; FMPy 0.3 does not find the attribute."""
    said: dict[str, bool] = {}
    for variable in root.iterfind("ModelVariables/*"):
        for element in (variable, *variable):
            if (text := element.get("relativeQuantity")) is not None:
                said[variable.get("name", "")] = text in ("true", "1")
    return said


def _root(path: Path) -> ElementTree.Element:
    """Return the root of the model description in an archive; `ValueError` says what is wrong with either."""
    try:
        with zipfile.ZipFile(path) as archive:
            info = files_of(archive).get(NAME)
            if info is None:
                raise ArchiveError(f"its archive has no {NAME}; export the FMU anew")
            if info.file_size > MOST_BYTES:
                raise DescriptionError([f"it has {info.file_size / 2**20:.0f} MB, more than {MOST_BYTES // 2**20}"])
            return parsed_xml(archive.read(info))
    except (zipfile.BadZipFile, zlib.error, EOFError, UnicodeDecodeError, NotImplementedError, RuntimeError) as error:
        raise ArchiveError(f"its archive is damaged: {error}; export the FMU anew") from None


def read_description(path: Path) -> tuple[ModelDescription, str]:
    """Return model description and SHA-256 of an FMU; `ValueError` says what is wrong with it."""
    if not is_file(path):
        raise ValueError(f"{path}: no such file; build the FMUs, or correct the path")
    sha256 = sha256_of(path)
    try:
        description, _ = _parsed(path, sha256)
    except Exception as error:  # FMPy and lxml raise many kinds
        raise ValueError(f"{path}: not an FMU: {error}") from error
    if description.coSimulation is None:
        raise ValueError(f"{path}: no co-simulation FMU; export it for co-simulation")
    if str(description.fmiVersion).startswith("1"):
        _read_capabilities(path, description.coSimulation)
    if str(description.fmiVersion).startswith("3"):
        description.coSimulation.providesDirectionalDerivative = _provides_derivatives(path)
    return description, sha256


def _read_capabilities(path: Path, interface: Any) -> None:
    """Write what an FMI 1.0 description says of its capabilities to FMPy's, which leaves them out."""
    said = _root(path).find("Implementation/*/Capabilities")
    for name in ("canHandleVariableCommunicationStepSize", "canBeInstantiatedOnlyOncePerProcess"):
        setattr(interface, name, said is not None and said.get(name) in ("true", "1"))


def _provides_derivatives(path: Path) -> bool:
    """Return what an FMI 3.0 description says; FMPy 0.3 looks for the attribute under its name in FMI 2.0."""
    interface = _root(path).find("CoSimulation")
    return interface is not None and interface.get("providesDirectionalDerivatives") in ("true", "1")


def capabilities_of(description: ModelDescription) -> Capabilities:
    interface: Any = description.coSimulation
    return Capabilities(
        rollback=bool(interface.canGetAndSetFMUstate),
        serialize=bool(interface.canSerializeFMUstate),
        variable_step=bool(interface.canHandleVariableCommunicationStepSize),
        directional_derivatives=bool(interface.providesDirectionalDerivative),
        internal_step=float(interface.fixedInternalStepSize) if interface.fixedInternalStepSize else None,
    )
