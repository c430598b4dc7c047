"""A package as the Open Simulation Platform reads it: OspSystemStructure.xml beside the FMUs."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from orchestrator.coupling.graph.links import Link
from orchestrator.export.baked import text_of
from orchestrator.export.package import Package, Part
from orchestrator.scenario.ssp.names import KINDS, OSP, OSP_FILE


def files(package: Package) -> dict[str, bytes]:
    """Return what stands in the folder, name → content, without the FMUs."""
    root = structure(package)
    ElementTree.indent(root)
    return {OSP_FILE: ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"}


def structure(package: Package) -> Element:
    """Return OspSystemStructure.xml; its names need no prefix."""
    simulation = package.simulation
    root = Element("OspSystemStructure", xmlns=OSP, version="0.1")
    SubElement(root, "StartTime").text = repr(simulation.start_time)
    SubElement(root, "EndTime").text = repr(simulation.stop_time)
    SubElement(root, "BaseStepSize").text = repr(simulation.macro_step)
    SubElement(root, "Algorithm").text = "fixedStep"
    simulators = SubElement(root, "Simulators")
    for part in package.parts:
        _simulator(simulators, part, simulation.macro_step)
    scaled = [link for link in package.wires if is_scaled(link)]
    if scaled:
        functions = SubElement(root, "Functions")
        for link in scaled:
            scale = {"name": function_of(link), "factor": repr(link.gain), "offset": repr(link.offset)}
            SubElement(functions, "LinearTransformation", scale)
    if package.wires:
        connections = SubElement(root, "Connections")
        for link in package.wires:
            _connect(connections, link)
    return root


def _simulator(parent: Element, part: Part, step: float) -> None:
    simulator = SubElement(parent, "Simulator", name=part.name, source=part.file, stepSize=repr(step))
    initial = SubElement(simulator, "InitialValues")
    for name, value in part.values.items():
        one = SubElement(initial, "InitialValue", variable=name)
        SubElement(one, KINDS[part.kinds[name]], value=text_of(value))


def is_scaled(link: Link) -> bool:
    """Return whether a connection converts units."""
    return (link.gain, link.offset) != (1.0, 0.0)


def function_of(link: Link) -> str:
    """Return the name of the function that converts the units of a connection."""
    return f"to {'.'.join(link.target)}"


def _connect(parent: Element, link: Link) -> None:
    if not is_scaled(link):
        connection = SubElement(parent, "VariableConnection")
        for simulator, name in (link.source, link.target):
            SubElement(connection, "Variable", simulator=simulator, name=name)
        return
    for (simulator, name), signal in ((link.source, "in"), (link.target, "out")):
        connection = SubElement(parent, "SignalConnection")
        SubElement(connection, "Variable", simulator=simulator, name=name)
        SubElement(connection, "Signal", function=function_of(link), name=signal)
