"""Connections, checked once: ends, types, units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from fmpy.model_description import Unit

from orchestrator.coupling.errors import nearest
from orchestrator.coupling.fmu.description import Port
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.vocabulary import EXPONENTS

Signal = tuple[str, str]
"""Component and variable."""
CASTS = {("real", "real"), ("integer", "real"), ("integer", "integer"), ("boolean", "boolean"), ("string", "string")}


class GraphError(ValueError):
    """The graph cannot be built: the message names connection, cause and cure."""


NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
LINEAR = re.compile(rf"(?:({NUMBER}) \* )?(.+?)(?: ([+-]) ({NUMBER}))?")
"""Factor, source, sign and offset of ``2.0 * a.x + 1.0``; the blanks are part of it, names may have such signs."""


@dataclass(frozen=True)
class Connection:
    """From an output to an input, both as ``component.variable``: input = `gain` * output + `offset`, in the input's unit."""

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Connection:
        """Return the connection that is written as ``a.x -> b.u`` or ``2.0 * a.x + 1.0 -> b.u``; `GraphError` if it is not."""
        left, arrow, target = (part.strip() for part in text.partition("->"))
        found = LINEAR.fullmatch(left)
        if not (found and arrow and target):
            raise GraphError(f'connections: {text!r} is not of the form "a.x -> b.u"')
        gain, source, sign, offset = found.groups()
        return cls(source, target, float(gain or 1.0), float(f"{sign or ''}{offset or 0.0}"))

    @property
    def is_plain(self) -> bool:
        """Whether the value goes as it is."""
        return (self.gain, self.offset) == (1.0, 0.0)


def owner_of(signal: str) -> str:
    """Return the component of ``component.variable``."""
    return signal.partition(".")[0]


def variable_of(signal: str) -> str:
    """Return the variable of ``component.variable``."""
    return signal.partition(".")[2]


@dataclass
class Link:
    """A checked connection."""

    source: Signal
    target: Signal
    gain: float
    offset: float
    discrete: bool

    def __str__(self) -> str:
        return f"{'.'.join(self.source)} -> {'.'.join(self.target)}"


def checked_links(components: Mapping[str, Fmu], connections: Iterable[Connection]) -> list[Link]:
    """Return the connections as links; `GraphError` says which cannot be, why, and what to do."""
    links, fed = [], {}
    for connection in connections:
        link = _checked(components, connection)
        if link.target in fed:
            raise GraphError(
                f"{connection.target} is fed twice, by {fed[link.target]} and by {connection.source}; "
                "drop one of the two"
            )
        fed[link.target] = connection.source
        links.append(link)
    return links


def _checked(components: Mapping[str, Fmu], connection: Connection) -> Link:
    where = f"connection {connection.source} → {connection.target}"
    source, target = _split(components, connection.source, where), _split(components, connection.target, where)
    giver, taker = components[source[0]], components[target[0]]
    a, b = giver.ports[source[1]], taker.ports[target[1]]
    if a.causality != "output":
        raise GraphError(f"{where}: {connection.source} is no output but {a.causality}; connect from an output")
    if b.causality != "input":
        raise GraphError(f"{where}: {connection.target} is no input but {b.causality}; connect to an input")
    if (a.kind, b.kind) not in CASTS or not _holds(taker, b, giver, a):
        raise GraphError(f"{where}: {a.fmi_type} cannot feed {b.fmi_type}; connect variables of one type")
    if b.kind != "real" and not connection.is_plain:
        raise GraphError(f"{where}: {connection.target} is of type {b.kind}; only reals take a factor or an offset")
    gain, offset = _conversion(giver, a, taker, b, where)
    gain, offset = connection.gain * gain, connection.gain * offset + connection.offset
    discrete = "discrete" in (a.variability, b.variability) or b.kind != "real" or a.kind != "real"
    return Link(source, target, gain, offset, discrete)


def _holds(fmu_b: Fmu, b: Port, fmu_a: Fmu, a: Port) -> bool:
    """Return whether every whole number of the type of `a` has a place in that of `b`."""
    if a.kind != "integer" or "Enumeration" in (a.fmi_type, b.fmi_type):
        return True
    return np.can_cast(fmu_a.fmi.TYPES[a.fmi_type][1], fmu_b.fmi.TYPES[b.fmi_type][1])


def _split(components: Mapping[str, Fmu], signal: str, where: str) -> Signal:
    component, _, variable = signal.partition(".")
    if component not in components:
        raise GraphError(f"{where}: no component {component!r}{nearest(component, components)}")
    if variable not in components[component].ports:
        known = components[component].ports
        raise GraphError(f"{where}: {component} has no variable {variable!r}{nearest(variable, known)}")
    return component, variable


def _conversion(fmu_a: Fmu, a: Port, fmu_b: Fmu, b: Port, where: str) -> tuple[float, float]:
    """Return gain and offset from a's unit to b's; a difference has no offset."""
    if not a.unit or not b.unit or a.unit == b.unit:
        return 1.0, 0.0
    unit_a, unit_b = _unit(fmu_a, a.unit), _unit(fmu_b, b.unit)
    base_a, base_b = unit_a and unit_a.baseUnit, unit_b and unit_b.baseUnit
    if not base_a or not base_b:
        raise GraphError(
            f"{where}: units {a.unit} and {b.unit} differ and are not defined by base units; make them one"
        )
    if any(int(getattr(base_a, e) or 0) != int(getattr(base_b, e) or 0) for e in EXPONENTS):
        raise GraphError(f"{where}: unit {a.unit} is no measure of {b.unit}; connect like with like")
    factor = float(base_b.factor)
    offset = (float(base_a.offset) - float(base_b.offset)) / factor
    if a.relative is not b.relative and offset:
        raise GraphError(
            f"{where}: one of the two is a difference (relativeQuantity), the other is not, and {a.unit} and {b.unit} differ "
            "by an offset; connect like with like, or give both one unit"
        )
    return float(base_a.factor) / factor, 0.0 if a.relative else offset


def _unit(fmu: Fmu, name: str) -> Unit | None:
    return next((unit for unit in fmu.description.unitDefinitions if unit.name == name), None)
