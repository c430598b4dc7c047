"""A description's system, its sub-systems flattened: components, and which output feeds which input."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from orchestrator.coupling.errors import InputError
from orchestrator.scenario.ssp.archive import Files
from orchestrator.scenario.ssp.names import FMU_TYPES
from orchestrator.scenario.ssp.xml import child, children, number, tag

Place = tuple[str, ...]
"""Names of elements from the outermost system inwards; its own is left out."""
End = tuple[Place, str]
"""An element and a connector of it."""
DEEPEST = 50
"""Systems within one another."""
TRANSFORMATIONS = (
    "LinearTransformation",
    "BooleanMappingTransformation",
    "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)


@dataclass(frozen=True)
class Line:
    """A connection as it is written: factor and offset of its linear transformation."""

    target: End
    factor: float = 1.0
    offset: float = 0.0


@dataclass
class System:
    """A system with all that is in it.

    Attributes
    ----------
    components : place → the component's element
    fmus : place → its FMU
    lines : an output, or a connector of a system → where it leads
    elements : place → the element of a system or component, the system itself at ()
    """

    components: dict[Place, Element] = field(default_factory=dict)
    fmus: dict[Place, Path] = field(default_factory=dict)
    lines: dict[End, list[Line]] = field(default_factory=dict)
    elements: dict[Place, Element] = field(default_factory=dict)

    def leads_to(self, end: End, passed: frozenset[End] = frozenset()) -> Iterator[Line]:
        """Yield the connectors of components that a connector leads to, with the transformations on the way.

        A way that comes back to a connector of `passed` leads nowhere.
        """
        for line in self.lines.get(end, ()):
            if line.target[0] in self.components:
                yield line
                continue
            for further in self.leads_to(line.target, passed | {end}) if line.target not in passed else ():
                factor = line.factor * further.factor
                yield Line(further.target, factor, further.factor * line.offset + further.offset)


def flattened(files: Files, root: Element) -> System:
    """Return the system of a description; `InputError` names what it has that is not understood."""
    top = child(root, "System")
    if top is None:
        raise InputError(f"{files.place}: {files.main} has no System; export it anew")
    system = System()
    _enter(files, system, top, ())
    return system


def name_of(place: Place) -> str:
    """Return the name of a component in a scenario: a dot there parts component and variable."""
    return re.sub(r"\W+", "_", "_".join(place))


def _enter(files: Files, system: System, element: Element, place: Place) -> None:
    system.elements[place] = element
    if len(place) > DEEPEST:
        raise InputError(f"{files.place}: systems lie more than {DEEPEST} deep in one another; flatten them")
    if child(element, "SignalDictionaries", "SignalDictionary") is not None:
        raise InputError(
            f"{files.place}: {_words(place)}: signal dictionaries (SSB) are not read; connect the FMUs directly"
        )
    for one in children(element, "Elements"):
        for part in one:
            _add(files, system, part, (*place, part.get("name", "")))
    for connection in children(element, "Connections", "Connection"):
        _connect(files, system, connection, place)


def _add(files: Files, system: System, element: Element, place: Place) -> None:
    if place in system.elements:
        raise InputError(f"{files.place}: two elements are called {'.'.join(place)}; rename one")
    match tag(element):
        case "System":
            _enter(files, system, element, place)
        case "Component":
            system.elements[place] = system.components[place] = element
            system.fmus[place] = _fmu(files, element, place)
        case other:
            raise InputError(f"{files.place}: {_words(place)}: elements of the kind {other} are not read; leave it out")


def _fmu(files: Files, element: Element, place: Place) -> Path:
    kind, wanted = element.get("type", FMU_TYPES[0]), element.get("implementation", "any")
    if kind not in FMU_TYPES:
        what = f"is of type {kind}, no FMU"
        raise InputError(f"{files.place}: {_words(place)}: {what}; put the system inside in its place, or its FMUs")
    if wanted == "ModelExchange":
        raise InputError(f"{files.place}: {_words(place)}: wants ModelExchange, and FMUs run by co-simulation here")
    return files.file(element.get("source", ""), _words(place))


def _connect(files: Files, system: System, connection: Element, place: Place) -> None:
    start, end = (_end(connection, side, place) for side in ("start", "end"))
    words = f"connection {'.'.join(start[0])}.{start[1]} → {'.'.join(end[0])}.{end[1]}"
    turned = not _gives(system, start, place)
    if turned:
        start, end = end, start
    factor, offset = _transformation(files, connection, words)
    if turned and (factor, offset) != (1.0, 0.0):
        raise InputError(
            f"{files.place}: {words}: goes from an input to an output, with a transformation; turn it round"
        )
    system.lines.setdefault(start, []).append(Line(end, factor, offset))


def _end(connection: Element, side: str, place: Place) -> End:
    element = connection.get(f"{side}Element")
    return (place if element is None else (*place, element)), connection.get(f"{side}Connector", "")


def _gives(system: System, end: End, within: Place) -> bool:
    """Return whether a connector gives a value to a connection: an output of an element, or an input of the system around."""
    kinds = {c.get("name"): c.get("kind") for c in children(system.elements.get(end[0]), "Connectors", "Connector")}
    kind = kinds.get(end[1])
    if kind is None:
        return True  # said where FMUs are loaded
    return (kind in ("output", "calculatedParameter")) != (end[0] == within)


def _transformation(files: Files, connection: Element, words: str) -> tuple[float, float]:
    for found in connection:
        if tag(found) not in TRANSFORMATIONS:
            continue
        if tag(found) != TRANSFORMATIONS[0]:
            raise InputError(f"{files.place}: {words}: a {tag(found)} is not read; let one of the FMUs do it")
        if connection.get("suppressUnitConversion", "false") in ("true", "1"):
            what = "a LinearTransformation in the place of a conversion of units (suppressUnitConversion)"
            raise InputError(f"{files.place}: {words}: {what} is not read; let the units convert")
        try:
            return number(found, "factor", 1.0), number(found, "offset", 0.0)
        except ValueError as error:
            raise InputError(f"{files.place}: {words}: {error}") from None
    return 1.0, 0.0


def _words(place: Place) -> str:
    return f"element {'.'.join(place)}" if place else "the system"
