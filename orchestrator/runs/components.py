"""From a scenario to loaded FMUs, a master, and the signals worth keeping."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fmus.module.variables import ModuleError
from orchestrator.catalogue import library
from orchestrator.catalogue import modules as vocabulary
from orchestrator.coupling.errors import InputError, RunError, nearest
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import check_steps, instance
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS, Master
from orchestrator.coupling.run.results import Table
from orchestrator.landing.contract import BREAKS, check_variables
from orchestrator.landing.fields import cable_fields
from orchestrator.landing.wiring import landing_graph
from orchestrator.scenario.types import GraphScenario, LandingScenario, Scenario

HOLDING = ("held", "point")
"""Exchanges in which our modules neither give nor take slopes and means."""


def exchange_of(scenario: Scenario) -> str:
    """Return the exchange within a macro step: the scenario's, else what suits the master."""
    implicit = MASTERS[scenario.simulation.master].IMPLICIT
    return scenario.simulation.exchange or ("waveform" if implicit else "point")


@contextmanager
def opened(scenario: Scenario) -> Iterator[Graph]:
    """Give the scenario's graph of loaded FMUs; `InputError` if it cannot be made."""
    try:
        graph = _landing_graph(scenario) if isinstance(scenario, LandingScenario) else _general_graph(scenario)
        check_steps(graph.components, scenario.simulation.macro_step)  # type: ignore[arg-type]
    except (ModuleError, ValueError) as error:
        raise InputError(f"{scenario.path}: {line}" for line in str(error).splitlines()) from None
    except FmuError as error:
        raise RunError(str(error), error.time) from None
    try:
        yield graph
    finally:
        graph.close()


def _landing_graph(scenario: LandingScenario) -> Graph:
    _require_contract(scenario)
    return landing_graph(scenario, exchange_of(scenario))


def _require_contract(scenario: LandingScenario) -> None:
    """Hold the foreign FMUs of a landing against their contracts."""
    sections = {"cable": scenario.cable, "robot": scenario.robot, "contact": scenario.contact}
    for kind, section in sections.items():
        if section.fmu is None:
            continue
        findings = check_variables(kind, vocabulary.of_fmu(Path(section.fmu)))
        lines = [f"{kind}.fmu: {f.what} is {f.verdict}: {f.note}" for f in findings if f.verdict in BREAKS]
        if lines:
            raise ValueError("\n".join([*lines, f"`orchestrator check {section.fmu}` shows the whole contract"]))


def _general_graph(scenario: GraphScenario) -> Graph:
    components: dict[str, Fmu] = {}
    try:
        for name, section in scenario.components.items():
            file = section.fmu or library.module_fmu(str(section.model))
            components[name] = instance(file, name, section.steps)
            own = _own_exchange(section.model, exchange_of(scenario))
            components[name].set_parameters({**own, **section.parameters, **section.inputs})
        connections = [_connection(text) for text in scenario.connections]
        holding = {name for name, fmu in components.items() if fmu.exchange in HOLDING}
        return Graph(components, [c for c in connections if not _serves_an_interval(c, holding)])
    except BaseException:
        for fmu in components.values():
            fmu.close()
        raise


def _own_exchange(model: str | None, exchange: str) -> dict[str, str]:
    """Return the exchange as a parameter of our own `model`: nothing where it has none, its default where it has not
    this one."""
    known = vocabulary.of_module(model).get("exchange") if model is not None else None
    return {"exchange": exchange} if known is not None and exchange in known.choices else {}


def _serves_an_interval(connection: Connection, holding: Container[str]) -> bool:
    """Return whether slopes or means go to or from one of the components that are `holding` values at an instant."""
    ends = {signal.partition(".")[0] for signal in (connection.source, connection.target)}
    between = re.search(r"_(rate|mean)(\.[xyz])?$", connection.source)
    return between is not None and any(name in holding for name in ends)


def _connection(text: str) -> Connection:
    source, arrow, target = (part.strip() for part in text.partition("->"))
    if not (source and arrow and target):
        raise ValueError(f'connections: {text!r} is not of the form "a.x -> b.u"')
    return Connection(source, target)


def master_of(scenario: Scenario, graph: Graph) -> Master:
    """Return the scenario's master for `graph`; `InputError` if it cannot couple these FMUs."""
    known = recorded(graph)
    missing = [name for name in scenario.simulation.tolerances if name not in known]
    if missing:
        raise InputError(
            f"{scenario.path}: simulation.tolerances.{n}: no such signal{nearest(n, known)}" for n in missing
        )
    try:
        return MASTERS[scenario.simulation.master](graph, **scenario.master)
    except (ValueError, TypeError) as error:
        raise InputError(f"{scenario.path}: {error}") from None


def recorded(graph: Graph) -> list[str]:
    """Return the signals worth keeping: outputs, without unused ports and what only serves the coupling."""
    contacts = sum(name.startswith("contact") for name in graph.components)
    return [
        f"{component}.{name}"
        for component, fmu in graph.components.items()
        for name, port in fmu.ports.items()
        if port.causality == "output" and port.is_number and not only_couples(name, contacts)
    ]


def only_couples(name: str, contacts: int) -> bool:
    """Whether an output is that of an unused port, or a mean or rate that only serves the coupling."""
    unused = re.match(r"(?:port|wheel)\[(\d+)\]", name)
    return bool(
        re.search(r"_(mean|rate)\.[xyz]$|\.rotation(_mean)?\.[xyz]$", name)
        or (unused and 0 < contacts < int(unused[1]))
    )


def split_fields(scenario: Scenario, table: Table) -> tuple[dict[str, np.ndarray], Table]:
    """Return the cable's shape and tension over time as arrays, and the table without them."""
    rest = {name: values for name, values in table.items() if not name.startswith("cable.shape[")}
    return cable_fields(scenario, table) if isinstance(scenario, LandingScenario) else {}, rest
