"""A package as SSP 1.0: the description of the system, its parameter set, the FMUs, in one archive."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from orchestrator.coupling.fmu.description import Port
from orchestrator.export.baked import text_of
from orchestrator.export.package import TOOL, Package, Part
from orchestrator.scenario.ssp.names import (
    ANNOTATION,
    DEFAULT_SSD,
    FMU_TYPES,
    KINDS,
    LINE_LANDING,
    PARAMETER_SET,
    PREFIXES,
    SSC,
    SSD,
    SSV,
)

VALUES = "resources/parameters.ssv"
"""All values, by the names that they have in the system. Each component has its own besides: some engines look nowhere else."""


def files(package: Package) -> dict[str, bytes]:
    """Return what stands in the archive, name → content, without the FMUs."""
    own = {_values_of(part): text(parameter_set(package, (part,), "")) for part in package.parts if part.values}
    everything = text(parameter_set(package, package.parts, "{}."))
    return {DEFAULT_SSD: text(description(package)), VALUES: everything} | own


def _values_of(part: Part) -> str:
    return f"resources/{part.name}.ssv"


def text(root: Element) -> bytes:
    """Return an element as a file."""
    for prefix, namespace in (*PREFIXES.items(), ("ll", LINE_LANDING)):
        ElementTree.register_namespace(prefix, namespace)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def description(package: Package) -> Element:
    """Return SystemStructure.ssd."""
    root = Element(f"{{{SSD}}}SystemStructureDescription", version="1.0", name=package.name, generationTool=TOOL)
    root.set("description", package.title)
    system = SubElement(root, f"{{{SSD}}}System", name=package.name)
    _bind(system, VALUES)
    elements = SubElement(system, f"{{{SSD}}}Elements")
    for part in package.parts:
        _component(elements, part, package)
    if package.wires:
        _connections(SubElement(system, f"{{{SSD}}}Connections"), package)
    _units(root, SSD, package, {port.unit for part in package.parts for port in part.ports})
    simulation = package.simulation
    times = {"startTime": simulation.start_time, "stopTime": simulation.stop_time}
    SubElement(root, f"{{{SSD}}}DefaultExperiment", {name: repr(time) for name, time in times.items()})
    _annotation(SubElement(root, f"{{{SSD}}}Annotations"), package)
    return root


def _component(parent: Element, part: Part, package: Package) -> None:
    place = {"name": part.name, "type": FMU_TYPES[0], "source": f"resources/{part.file}"}
    component = SubElement(parent, f"{{{SSD}}}Component", place, implementation="CoSimulation")
    connectors = SubElement(component, f"{{{SSD}}}Connectors") if part.ports else component
    for port in part.ports:
        connector = SubElement(connectors, f"{{{SSD}}}Connector", name=port.name, kind=port.causality)
        _type(connector, port, package)
    if part.values:
        _bind(component, _values_of(part))


def _bind(parent: Element, source: str) -> None:
    bindings = SubElement(parent, f"{{{SSD}}}ParameterBindings")
    SubElement(bindings, f"{{{SSD}}}ParameterBinding", type=PARAMETER_SET, source=source)


def _type(connector: Element, port: Port, package: Package) -> None:
    typed = SubElement(connector, f"{{{SSC}}}{KINDS.get(port.kind, 'Binary')}")
    if port.kind == "real" and port.unit in package.units:
        typed.set("unit", port.unit)


def _connections(parent: Element, package: Package) -> None:
    for link in package.wires:
        ends = {"startElement": link.source[0], "startConnector": link.source[1]}
        ends |= {"endElement": link.target[0], "endConnector": link.target[1]}
        connection = SubElement(parent, f"{{{SSD}}}Connection", ends)
        if link.target in package.linear:
            gain, offset = package.linear[link.target]
            scale = {"factor": repr(gain), "offset": repr(offset)}
            SubElement(connection, f"{{{SSC}}}LinearTransformation", scale)


def _units(root: Element, namespace: str, package: Package, used: set[str]) -> None:
    """Add the definitions of the units that are used; the standard allows no empty list."""
    names = sorted(used & set(package.units))
    units = SubElement(root, f"{{{namespace}}}Units") if names else root
    for name in names:
        one = package.units[name]
        scale = {"factor": repr(one.factor)} if one.factor != 1.0 else {}
        scale |= {"offset": repr(one.offset)} if one.offset != 0.0 else {}
        unit = SubElement(units, f"{{{SSC}}}Unit", name=name)
        SubElement(unit, f"{{{SSC}}}BaseUnit", {base: str(n) for base, n in one.exponents.items()} | scale)


def _annotation(parent: Element, package: Package) -> None:
    """Add what the standard has no place for: step, master, notes."""
    annotation = SubElement(parent, f"{{{SSC}}}Annotation", type=ANNOTATION)
    simulation = package.simulation
    about = {"macroStep": repr(simulation.macro_step), "master": simulation.master}
    coupling = SubElement(annotation, f"{{{LINE_LANDING}}}Coupling", about)
    for part in package.parts:
        if part.steps > 1:
            SubElement(coupling, f"{{{LINE_LANDING}}}Steps", component=part.name, count=str(part.steps))
    for note in package.notes:
        SubElement(coupling, f"{{{LINE_LANDING}}}Note").text = note


def parameter_set(package: Package, parts: Sequence[Part], prefix: str) -> Element:
    """Return the parameter set of some components: parameters and held inputs, their names after a `prefix`."""
    root = Element(f"{{{SSV}}}ParameterSet", version="1.0", name=package.name, generationTool=TOOL)
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for part in parts:
        _parameters(parameters, part, package, prefix.format(part.name))
    _units(root, SSV, package, {unit for part in parts for unit in part.units.values()})
    return root


def _parameters(parent: Element, part: Part, package: Package, prefix: str) -> None:
    for name, value in part.values.items():
        parameter = SubElement(parent, f"{{{SSV}}}Parameter", name=prefix + name)
        kind, unit = part.kinds[name], part.units[name]
        typed = SubElement(parameter, f"{{{SSV}}}{KINDS[kind]}", value=text_of(value))
        if kind == "real" and unit in package.units:
            typed.set("unit", unit)
