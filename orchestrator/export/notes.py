"""What our engine does and another one may not: said when a system is exported, and in the package."""

from __future__ import annotations

from collections.abc import Iterator

from orchestrator.coupling.errors import digits
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Link
from orchestrator.export.package import Package, Part
from orchestrator.scenario.types import Scenario


def notes(package: Package, graph: Graph, asked: Scenario) -> tuple[str, ...]:
    """Return the notes on a package, a line each; `asked` is the scenario before a master of other engines took its place."""
    told = (
        *_master(package, asked),
        *_step(package),
        *_late(graph),
        *_start(graph),
        *_versions(graph),
        *_units(package),
        *_values(package),
    )
    return tuple(told)


def _master(package: Package, asked: Scenario) -> Iterator[str]:
    master, before = package.simulation.master, asked.simulation.master
    if master != before:
        yield f"{before} iterates within a step, other engines do not: the system is the one that {master} would run here"
    chosen = {f"{p.name} {p.values['exchange']}" for p in package.parts if "exchange" in p.values}
    if chosen:
        yield f"exchange within a step: {', '.join(sorted(chosen))}; a slope that nothing feeds stays zero"


def _step(package: Package) -> Iterator[str]:
    step = digits(package.simulation.macro_step)
    yield f"macro step {step} s: SSP has no place for it, give it to the engine; OSP has it as BaseStepSize"
    several = [f"{part.name} {part.steps}" for part in package.parts if part.steps > 1]
    if several:
        yield f"steps within each macro step ({', '.join(several)}) are made by our engine alone; give the engine a finer step"


def _late(graph: Graph) -> Iterator[str]:
    """Say which connections our masters refresh after a step, and others read as they were in it."""
    late = {node.name for stage in graph.stages[1:] for node in stage}
    late |= {node.name for node in graph.nodes if node.feedthrough}
    given = [link for link in graph.links if link.source[0] in late]
    if given:
        names = ", ".join(sorted({link.source[0] for link in given}))
        yield (
            f"outputs of {names} follow from inputs without a step: our masters read them anew once the new inputs are set, "
            "an engine that does not is a step behind there"
        )


def _start(graph: Graph) -> Iterator[str]:
    if graph.loop.places.size:
        yield (
            f"{graph.loop.places.size} inputs are in an algebraic loop at the start, which our engine solves; "
            "another may start from values that contradict one another"
        )
    yield (
        "our start-up moves values along the connections until they stay; an engine that makes its first step with zeros "
        "begins with other forces, an error of the order of its step"
    )


def _versions(graph: Graph) -> Iterator[str]:
    newer = [name for name, fmu in graph.components.items() if str(fmu.description.fmiVersion).startswith("3")]
    if newer:
        yield f"FMUs of FMI 3.0 ({', '.join(newer)}), of which SSP 1.0 and OSP do not speak: not every engine takes them"


def _units(package: Package) -> Iterator[str]:
    scaled = [link for link in package.wires if (link.gain, link.offset) != (1.0, 0.0)]
    if scaled:
        shown = ", ".join(f"{link} (× {link.gain:g}{_offset(link)})" for link in scaled)
        yield f"units are converted: {shown}; in SSP by the units of the connectors, in OSP by functions"


def _offset(link: Link) -> str:
    return f" + {link.offset:g}" if link.offset else ""


def _values(package: Package) -> Iterator[str]:
    for part in package.parts:
        if part.strange:
            yield _strange(part)


def _strange(part: Part) -> str:
    more = f" and {len(part.strange) - 3} more" if len(part.strange) > 3 else ""
    names = ", ".join(part.strange[:3]) + more
    return (
        f"{part.name}: the FMU does not start from {names} of its own description; the engine has to set them, from the "
        "parameter set (SSP) or the initial values (OSP)"
    )
