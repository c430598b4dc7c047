"""A package as SSP 1.0: the description of the system, its parameter set, the FMUs, in one archive."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import orchestrator
from orchestrator.coupling.fmu.description import Port
from orchestrator.export.baked import text_of
from orchestrator.export.package import Package, Part
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
TOOL = f"line-landing {orchestrator.__version__}"


def files(package: Package) -> dict[str, bytes]:
    """Return what stands in the archive, name → content, without the FMUs."""
    return {DEFAULT_SSD: text(description(package)), VALUES: text(parameter_set(package))}


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
    bindings = SubElement(system, f"{{{SSD}}}ParameterBindings")
    SubElement(bindings, f"{{{SSD}}}ParameterBinding", type=PARAMETER_SET, source=VALUES)
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


def parameter_set(package: Package) -> Element:
    """Return the parameter set: parameters and held inputs, ``component.variable``."""
    root = Element(f"{{{SSV}}}ParameterSet", version="1.0", name=package.name, generationTool=TOOL)
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for parameter in _parameters(package):
        parameters.append(parameter)
    _units(root, SSV, package, {unit for part in package.parts for unit in part.units.values()})
    return root


def _parameters(package: Package) -> Iterator[Element]:
    for part in package.parts:
        for name, value in part.values.items():
            parameter = Element(f"{{{SSV}}}Parameter", name=f"{part.name}.{name}")
            kind, unit = part.kinds[name], part.units[name]
            typed = SubElement(parameter, f"{{{SSV}}}{KINDS[kind]}", value=text_of(value))
            if kind == "real" and unit in package.units:
                typed.set("unit", unit)
            yield parameter
