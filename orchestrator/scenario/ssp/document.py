"""A system structure as the document of a scenario: a general graph of its FMUs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.module.units import UnitError
from orchestrator.catalogue.documents import Document
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.ssp import osp
from orchestrator.scenario.ssp.archive import Files, opened
from orchestrator.scenario.ssp.names import ANNOTATION, OSP_FILE
from orchestrator.scenario.ssp.parts import Unit, linear, section, simulation, unique
from orchestrator.scenario.ssp.schema import violations
from orchestrator.scenario.ssp.structure import Place, System, flattened, name_of
from orchestrator.scenario.ssp.units import in_unit
from orchestrator.scenario.ssp.values import Values, values_of
from orchestrator.scenario.ssp.xml import child, children, number, parsed

MOST = 5
"""Names that a note lists."""


@dataclass(frozen=True)
class _Read:
    """A description and what it refers to."""

    files: Files
    root: Element
    system: System
    units: dict[Place, Unit]

    @property
    def names(self) -> dict[Place, str]:
        return {place: name_of(place) for place in self.system.components}

    @property
    def coupling(self) -> Element | None:
        """What one of our own exports says of step and master."""
        ours = [one for one in children(self.root, "Annotations", "Annotation") if one.get("type") == ANNOTATION]
        return child(ours[0], "Coupling") if ours else None


def document(path: Path) -> tuple[Document, list[str]]:
    """Return a system structure as the document of a scenario, and what is to be said of it.

    Raises
    ------
    InputError : it cannot be read, or has what is not understood: the construct is named
    """
    try:
        return osp.document(path) if path.name == OSP_FILE else _document(path)
    except (ValueError, KeyError, ArithmeticError, OSError) as error:
        raise InputError(f"{path}: is not as its standard has it: {error}; export it anew") from None


def _document(path: Path) -> tuple[Document, list[str]]:
    files = opened(path)
    content = _content(files)
    root = parsed(content, f"{path}: {files.main}")
    system = flattened(files, root)
    read = _Read(files, root, system, {place: Unit.of(file) for place, file in system.fmus.items()})
    unique(read.names, path)
    if not system.components:
        raise InputError(f"{path}: the system has no components; there is nothing to run")
    parts, lost = _components(read)
    times, chosen = _simulation(read)
    found = {"title": root.get("name") or path.stem, "simulation": times, "components": parts}
    notes = [*_invalid(files, content), *_variants(files), *chosen, *_ignored(files, lost)]
    return found | {"connections": list(_connections(read))}, notes


def _content(files: Files) -> bytes:
    try:
        return (files.folder / files.main).read_bytes()
    except OSError as error:
        raise InputError(f"{files.place}: cannot be read ({error.strerror}); check the path") from None


def _invalid(files: Files, content: bytes) -> list[str]:
    said = violations(content, "SystemStructureDescription.xsd")
    return (
        [f"{files.main} is not valid by the schema of SSP 1.0, and is read all the same: {'; '.join(said)}"]
        if said
        else []
    )


def _variants(files: Files) -> list[str]:
    others, file = ", ".join(files.variants), str(files.place).partition("#")[0]
    return [f"{file} has variants: {others}; choose one with {file}#{files.variants[0]}"] if others else []


def _ignored(files: Files, names: Iterable[str]) -> list[str]:
    found = list(dict.fromkeys(names))
    more = f" and {len(found) - MOST} more" if len(found) > MOST else ""
    what = "is given values that no parameter or input takes, as the standard has it"
    return [f"{files.place.name} {what}: {', '.join(found[:MOST])}{more}"] if found else []


def _components(read: _Read) -> tuple[Document, list[str]]:
    """Return the sections of the components, and the names of values that fit nothing."""
    values, lost = values_of(read.files, read.root, read.system)
    found: Document = {}
    steps = {one.get("component"): int(number(one, "count")) for one in children(read.coupling, "Steps")}
    for place, name in read.names.items():
        own = _in_units(read, place, values)
        sources = {variable: given.source for (p, variable), given in values.items() if p == place}
        found[name], strange = section(read.units[place], own, sources)
        found[name] |= {"steps": steps[name]} if name in steps else {}
        lost += [f"{name}.{variable}" for variable in strange]
    return found, lost


def _in_units(read: _Read, place: Place, values: Values) -> dict[str, float | int | bool | str]:
    """Return what a component is given, in the units of its variables."""
    unit, found = read.units[place], {}
    for (owner, name), given in values.items():
        if owner == place:
            variable = unit.variables.get(name)
            try:
                found[name] = in_unit(given, variable.unit if variable else "", unit.description)
            except UnitError as error:
                raise InputError(f"{read.files.place}: {given.source}: {name_of(place)}.{name}: {error}") from None
    return found


def _connections(read: _Read) -> Iterable[str]:
    for end in read.system.lines:
        if end[0] in read.system.components:
            for line in read.system.leads_to(end):
                ends = [f"{read.names[place]}.{name}" for place, name in (end, line.target)]
                yield linear(ends[0], ends[1], line.factor, line.offset)


def _simulation(read: _Read) -> tuple[Document, list[str]]:
    experiment, coupling = child(read.root, "DefaultExperiment"), read.coupling
    try:
        start = number(experiment, "startTime", 0.0) if experiment is not None else 0.0
        stop = number(experiment, "stopTime") if experiment is not None and experiment.get("stopTime") else None
        step = number(coupling, "macroStep") if coupling is not None else None
    except ValueError as error:
        raise InputError(f"{read.files.place}: {error}") from None
    master = coupling.get("master") if coupling is not None else None
    return simulation(read.units.values(), read.files.place, (start, stop), step, master)
