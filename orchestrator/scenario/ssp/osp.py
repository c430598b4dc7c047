"""OspSystemStructure.xml, as libcosim has it, as the document of a scenario."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from orchestrator.catalogue.documents import Document
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.ssp.names import OSP_FILE
from orchestrator.scenario.ssp.parts import Unit, linear, section, simulation, unique
from orchestrator.scenario.ssp.xml import child, children, number, parsed, tag

Signal = tuple[str, str]
"""Simulator and variable, or function and signal."""
TYPES = {"Real": float, "Integer": int, "Boolean": lambda text: text in ("true", "1"), "String": str}


@dataclass(frozen=True)
class _Read:
    place: Path
    root: Element
    units: Mapping[str, Unit]
    functions: Mapping[str, tuple[float, float]]

    def error(self, what: str) -> InputError:
        return InputError(f"{self.place}: {what}")


def document(path: Path) -> tuple[Document, list[str]]:
    """Return the structure as the document of a scenario, and what is to be said of it."""
    root = parsed(path.read_bytes(), str(path))
    simulators = {one.get("name", ""): one for one in children(root, "Simulators", "Simulator")}
    if not simulators:
        raise InputError(f"{path}: has no simulators; there is nothing to run")
    names = {name: re.sub(r"\W+", "_", name) for name in simulators}
    unique(names, path)
    units = {name: Unit.of(_file(path, name, one)) for name, one in simulators.items()}
    read = _Read(path, root, units, _functions(path, root))
    parts = {names[name]: _section(read, name, one) for name, one in simulators.items()}
    step = child(root, "BaseStepSize")
    times, notes = simulation(units.values(), path, _span(root), _number(step), None)
    texts = [linear(_text(a, names), _text(b, names), *scale) for a, b, scale in _connections(read)]
    title = f"{path.absolute().parent.name}, {OSP_FILE}"
    return {"title": title, "simulation": times, "components": parts, "connections": texts}, notes


def _text(signal: Signal, names: Mapping[str, str]) -> str:
    return f"{names[signal[0]]}.{signal[1]}"


def _file(path: Path, name: str, simulator: Element) -> Path:
    source = unquote(simulator.get("source", "")).removeprefix("file:///")
    if "://" in source:
        raise InputError(f"{path}: simulator {name}: {source} is no file; put the FMU into the folder")
    return path.absolute().parent / source


def _functions(path: Path, root: Element) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}
    for functions in children(root, "Functions"):
        for one in functions:
            if tag(one) != "LinearTransformation":
                raise InputError(f"{path}: function {one.get('name')}: a {tag(one)} is not read; let an FMU do it")
            found[one.get("name", "")] = number(one, "factor", 1.0), number(one, "offset", 0.0)
    return found


def _section(read: _Read, name: str, simulator: Element) -> Document:
    values = {}
    for one in children(simulator, "InitialValues", "InitialValue"):
        for typed in one:
            values[one.get("variable", "")] = TYPES[tag(typed)](typed.get("value", ""))
    found, lost = section(read.units[name], values, dict.fromkeys(values, OSP_FILE))
    if lost:
        hint = nearest(lost[0], read.units[name].variables)
        raise read.error(f"simulator {name}: {lost[0]} is no parameter or input of its FMU{hint}")
    return found


def _span(root: Element) -> tuple[float, float | None]:
    return _number(child(root, "StartTime")) or 0.0, _number(child(root, "EndTime"))


def _number(element: Element | None) -> float | None:
    return float(element.text or "") if element is not None else None


def _connections(read: _Read) -> Iterator[tuple[Signal, Signal, tuple[float, float]]]:
    """Yield source, target, factor and offset of the connections, those through a function as one."""
    into: dict[str, Signal] = {}
    out: list[tuple[str, Signal]] = []
    for connections in children(read.root, "Connections"):
        for one in connections:
            ends = [(end.get("simulator", ""), end.get("name", "")) for end in children(one, "Variable")]
            if tag(one) == "VariableConnection" and len(ends) == 2:
                yield (*sorted(ends, key=lambda end: _causality(read, end) != "output"), (1.0, 0.0))  # type: ignore[misc]
            elif tag(one) == "SignalConnection" and len(ends) == 1:
                function = (child(one, "Signal") or one).get("function", "")
                if _causality(read, ends[0]) == "output":
                    into[function] = ends[0]
                else:
                    out.append((function, ends[0]))
            else:
                raise read.error(f"a {tag(one)} is not read; connect variable by variable")
    for function, target in out:
        if function not in into or function not in read.functions:
            raise read.error(f"function {function} feeds {'.'.join(target)}, and nothing feeds it")
        yield into[function], target, read.functions[function]


def _causality(read: _Read, end: Signal) -> str:
    unit = read.units.get(end[0])
    if unit is None:
        raise read.error(f"connections: no simulator {end[0]!r}{nearest(end[0], read.units)}")
    if end[1] not in unit.variables:
        raise read.error(f"connections: {end[0]} has no variable {end[1]!r}{nearest(end[1], unit.variables)}")
    return unit.variables[end[1]].causality
