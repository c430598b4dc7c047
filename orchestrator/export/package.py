"""What is handed to another tool: FMUs with their values, connections, units, times, and what the tool must be told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.description import Port, Value
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.vocabulary import EXPONENTS
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Link, Signal, checked_links, owner_of, variable_of
from orchestrator.runs.components import recorded
from orchestrator.scenario.types import Scenario, Simulation


def _tool() -> str:
    try:
        return f"line-landing {version('line-landing')}"
    except PackageNotFoundError:  # a source tree that was never installed
        return "line-landing"


TOOL = _tool()
"""Who writes the package."""


@dataclass(frozen=True)
class BaseUnit:
    """A unit by its base units: exponents without zeros, factor and offset to SI."""

    exponents: Mapping[str, int]
    factor: float
    offset: float


@dataclass(frozen=True)
class Part:
    """One component.

    Attributes
    ----------
    fmu : its file, with the values as start values as far as it can have them
    file : its name in the package
    ports : the variables that other components are connected to, and the outputs worth recording
    values : parameters and held inputs, by the names of variables
    kinds, units : of the values; a unit is empty where the FMU has none
    steps : steps that it makes in each of the master's
    strange : values that the FMU does not start from by itself
    """

    name: str
    fmu: Path
    file: str
    ports: tuple[Port, ...]
    values: Mapping[str, Value]
    kinds: Mapping[str, str]
    units: Mapping[str, str]
    steps: int
    strange: tuple[str, ...] = ()


@dataclass(frozen=True)
class Package:
    """A system for another tool.

    Attributes
    ----------
    wires : the connections, checked; their gains and offsets are those of the conversion of units and of `linear` together
    linear : gain and offset of a connection itself, by its target
    units : by name; those that no FMU defines by base units are left out
    notes : what the tool must be told, or whoever uses it, a line each
    """

    name: str
    title: str
    parts: tuple[Part, ...]
    wires: tuple[Link, ...]
    linear: Mapping[Signal, tuple[float, float]]
    units: Mapping[str, BaseUnit]
    simulation: Simulation
    notes: tuple[str, ...] = ()

    def noted(self, notes: tuple[str, ...]) -> Package:
        """Return it with `notes`."""
        return replace(self, notes=notes)


def packed(scenario: Scenario, graph: Graph) -> Package:
    """Return what `graph` is made of; `InputError` names what no system structure can say."""
    problems = [*_over_time(graph), *_arrays(graph)]
    if problems:
        raise InputError(f"{scenario.path}: {problem}" for problem in problems)
    kept = {(owner_of(signal), variable_of(signal)) for signal in recorded(graph, scenario)}
    links = tuple(checked_links(graph.components, graph.connections))
    kept |= {end for link in links for end in (link.source, link.target)}
    parts = tuple(_part(name, fmu, kept) for name, fmu in graph.components.items())
    linear = {
        link.target: (c.gain, c.offset) for link, c in zip(links, graph.connections, strict=True) if not c.is_plain
    }
    return Package(scenario.name, scenario.title, parts, links, linear, _units(graph), scenario.simulation)


def _part(name: str, fmu: Fmu, kept: set[tuple[str, str]]) -> Part:
    values = {n: _typed(fmu.ports[n].kind, value) for n, value in fmu.parameters.items()}
    ports = tuple(port for n, port in fmu.ports.items() if (name, n) in kept and port.causality in ("input", "output"))
    kinds = {n: fmu.ports[n].kind for n in values}
    units = {n: fmu.ports[n].unit for n in values}
    return Part(name, fmu.path, f"{name}.fmu", ports, values, kinds, units, getattr(fmu, "steps", 1))


def _typed(kind: str, value: Value) -> Value:
    """Return a value as its variable's type has it: 1 of a real is 1.0."""
    return float(value) if kind == "real" else int(value) if kind == "integer" else value


def _over_time(graph: Graph) -> Iterator[str]:
    what = "follows a table over time, which no system structure can say"
    for signal in graph.courses:
        yield f"inputs: {signal} {what}; give it one value, with --set, or take it out and drive it there"


def _arrays(graph: Graph) -> Iterator[str]:
    for name, fmu in graph.components.items():
        linked = [variable_of(s) for c in graph.connections for s in (c.source, c.target) if owner_of(s) == name]
        for n in dict.fromkeys((*linked, *fmu.parameters)):
            if fmu.ports[n].size > 1:
                yield f"{name}.{n} is an element of an array, which SSP 1.0 and OSP cannot name; use scalar variables"


def _units(graph: Graph) -> dict[str, BaseUnit]:
    """Return the units that the FMUs define by base units, by name; the first definition of a name counts."""
    found: dict[str, BaseUnit] = {}
    for fmu in graph.components.values():
        for unit in fmu.description.unitDefinitions:
            base = unit.baseUnit
            if base is not None:
                exponents = {e: int(getattr(base, e) or 0) for e in EXPONENTS if int(getattr(base, e) or 0)}
                one = BaseUnit(exponents, float(base.factor or 1.0), float(base.offset or 0.0))
                found.setdefault(str(unit.name), one)
    return found
