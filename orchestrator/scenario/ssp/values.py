"""Parameter sets of a system structure, inline or in files of their own, mapped to the variables of its FMUs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

from orchestrator.coupling.errors import InputError
from orchestrator.scenario.ssp.archive import Files
from orchestrator.scenario.ssp.names import PARAMETER_MAPPING, PARAMETER_SET
from orchestrator.scenario.ssp.structure import Place, System
from orchestrator.scenario.ssp.xml import child, children, number, parsed, tag

Units = Mapping[str, Element]
"""Name of a unit → its base units."""


@dataclass(frozen=True)
class Given:
    """A value as a parameter set has it.

    Attributes
    ----------
    unit : empty where none is given, or where it is that of the variable
    units : definitions of the parameter set's units
    factor, offset : of a mapping; they come after the conversion of units
    source : where it stands
    """

    value: float | int | bool | str
    unit: str = ""
    units: Units | None = None
    factor: float = 1.0
    offset: float = 0.0
    source: str = ""


Values = dict[tuple[Place, str], Given]
"""Component and variable → what it is given."""


def values_of(files: Files, root: Element, system: System) -> tuple[Values, list[str]]:
    """Return what the bindings of all systems and components give, the outermost last; and the names that fit nothing."""
    found: Values = {}
    lost: list[str] = []
    for place in sorted(system.elements, key=len, reverse=True):
        for binding in children(system.elements[place], "ParameterBindings", "ParameterBinding"):
            for name, given in _bound(files, root, binding):
                targets = list(_targets(system, place, name))
                found |= dict.fromkeys(targets, given)
                lost += [] if targets else [name]
    return found, lost


def _bound(files: Files, root: Element, binding: Element) -> Iterator[tuple[str, Given]]:
    """Yield the names of a binding, as its element knows them, with their values."""
    what = "parameter binding"
    if binding.get("sourceBase", "SSD") != "SSD":
        raise InputError(
            f"{files.place}: {what}: a source within a component (sourceBase) is not read; put it into the SSP"
        )
    content, source = _content(files, binding, ("ParameterValues", "ParameterSet"), PARAMETER_SET, what)
    mapping = child(binding, "ParameterMapping")
    entries = None
    if mapping is not None:
        entries, _ = _content(files, mapping, ("ParameterMapping",), PARAMETER_MAPPING, "parameter mapping")
    prefix = binding.get("prefix", "")
    given = {prefix + name: value for name, value in _given(files, root, content, source).items()}
    yield from given.items() if entries is None else _mapped(files, entries, given)


def _content(files: Files, element: Element, inline: tuple[str, ...], kind: str, what: str) -> tuple[Element, str]:
    """Return the root of what an element holds or names, and where that is."""
    if element.get("type", kind) != kind:
        raise InputError(f"{files.place}: {what}: type {element.get('type')} is not read; use {kind}")
    source = element.get("source")
    if source:
        return parsed(files.file(source, what).read_bytes(), f"{files.place}: {source}"), source
    found = child(element, *inline)
    if found is None:
        raise InputError(f"{files.place}: {what}: has neither a source nor values; take it out")
    return found, files.main


def _given(files: Files, root: Element, content: Element, source: str) -> dict[str, Given]:
    units = {one.get("name", ""): one for place in (root, content) for one in children(place, "Units", "Unit")}
    enumerations = _enumerations(root) | _enumerations(content)
    found: dict[str, Given] = {}
    for parameter in children(content, "Parameters", "Parameter"):
        name = parameter.get("name", "")
        try:
            value, unit = _value(parameter, enumerations)
        except ValueError as error:
            raise InputError(f"{files.place}: {source}: {name}: {error}") from None
        found[name] = Given(value, unit, units, source=source)
    return found


def _enumerations(place: Element) -> dict[str, dict[str, int]]:
    return {
        one.get("name", ""): {item.get("name", ""): int(number(item, "value")) for item in children(one, "Item")}
        for one in children(place, "Enumerations", "Enumeration")
    }


def _value(parameter: Element, enumerations: Mapping[str, Mapping[str, int]]) -> tuple[float | int | bool | str, str]:
    """Return value and unit of a parameter; `ValueError` says what is not read."""
    typed = next((one for one in parameter if tag(one) != "Annotations"), None)
    kind, text = ("", "") if typed is None else (tag(typed), typed.get("value", ""))
    match kind:
        case "Real" if typed is not None:
            return number(typed, "value"), typed.get("unit", "")
        case "Integer":
            return int(text), ""
        case "Boolean":
            return text in ("true", "1"), ""
        case "String":
            return text, ""
        case "Enumeration" if typed is not None:
            return _item(text, typed.get("name", ""), enumerations), ""
    raise ValueError(f"a value of the kind {kind or 'none'} is not read; take it out")


def _item(text: str, name: str, enumerations: Mapping[str, Mapping[str, int]]) -> int:
    items = enumerations.get(name, {})
    if text not in items:
        raise ValueError(f"enumeration {name!r} has no item {text!r}; give the number as an Integer")
    return items[text]


def _mapped(files: Files, mapping: Element, given: Mapping[str, Given]) -> Iterator[tuple[str, Given]]:
    """Yield what a mapping makes of the values: those that it does not name are not used."""
    for entry in children(mapping, "MappingEntry"):
        source, target = entry.get("source", ""), entry.get("target", "")
        if source in given:
            try:
                yield target, _transformed(entry, given[source])
            except (ValueError, KeyError) as error:
                what = f"parameter mapping {source} → {target}"
                raise InputError(f"{files.place}: {what}: {error}") from None


def _transformed(entry: Element, given: Given) -> Given:
    if entry.get("suppressUnitConversion", "false") in ("true", "1"):
        given = replace(given, unit="")
    for found in entry:
        if tag(found) == "LinearTransformation":
            return replace(given, factor=number(found, "factor", 1.0), offset=number(found, "offset", 0.0))
        if tag(found).endswith("MappingTransformation"):
            return replace(given, value=_looked_up(found, given.value))
    return given


def _looked_up(table: Element, value: float | int | bool | str) -> float | int | bool | str:
    """Return what a table of a mapping has for a value; `ValueError` where it has nothing."""
    read = {"Boolean": lambda text: text in ("true", "1"), "Integer": int}.get(
        tag(table).removesuffix("MappingTransformation")
    )
    if read is None:
        raise ValueError(f"a {tag(table)} is not read; give the number as an Integer")
    rows = {read(row.get("source", "")): read(row.get("target", "")) for row in children(table, "MapEntry")}
    if value not in rows:
        raise ValueError(f"the table has no entry for {value!r}")
    return rows[value]


def _targets(system: System, place: Place, name: str) -> Iterator[tuple[Place, str]]:
    """Yield the variables of components that a name at a place stands for: of itself, of what it holds, or of a connector."""
    if place in system.components:
        yield place, name
        return
    for line in system.leads_to((place, name)):
        yield line.target
    inside = [one for one in system.elements if len(one) == len(place) + 1 and one[: len(place)] == place]
    for one in inside:
        if name.startswith(f"{one[-1]}."):
            yield from _targets(system, one, name[len(one[-1]) + 1 :])
