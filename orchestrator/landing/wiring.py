"""The graph of a landing: cable, robot, one contact a wheel, connected by the contract."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from orchestrator.catalogue import library
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.exchange import (
    EXCHANGES,
    MOVING,
    PARAMETER,
    Exchange,
    is_slope_of_load,
)
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import instance
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.graph.supply import Missing, Supply
from orchestrator.landing.resolve import Landing
from orchestrator.scenario.isolation import isolation

MOVED = ("s_rate", "curvature.x", "tangent_rate_mean.x")
"""What a port of the cable has that moves along within a step."""
CONTROLLER = "controller"
"""Component that flies the robot."""
LONGEST_ADAPTIVE = 2.5e-3
"""Longest inner step of our cable, s, where the master's steps are adaptive: long macro steps are then wanted, and the
local error does not tell that of the cable's inner steps (docs/notebook/adaptive.md)."""


def landing_graph(landing: Landing, exchange: str) -> Graph:
    """Return the graph of loaded FMUs: cable, robot, one contact a wheel, connected by the contract.

    `waveform` becomes `hermite` where a contact does not get all means, `point` where a load's slope is not taken.
    """
    components: dict[str, Fmu] = {}
    files, scenario = _files(landing), landing.scenario
    parts = {"cable": scenario.cable, "robot": scenario.robot, "contact": scenario.contact}
    if scenario.controller is not None:
        parts[CONTROLLER] = scenario.controller
    apart = {name: isolation(section, scenario.simulation) for name, section in parts.items()}
    try:
        components["cable"] = instance(files["cable"], "cable", landing.cable.steps, isolate=apart["cable"])
        inner = (
            {} if landing.cable.foreign is not None else {"integration_step": inner_step(landing, EXCHANGES[exchange])}
        )
        components["cable"].set_parameters(inner | dict(landing.cable.settings))
        components["robot"] = instance(files["robot"], "robot", landing.robot.steps, isolate=apart["robot"])
        components["robot"].set_parameters(landing.robot.settings)
        for k, s in enumerate(landing.placement.arc_lengths, start=1):
            components[f"contact{k}"] = Fmu(files["contact"], f"contact{k}", isolate=apart["contact"])
            components[f"contact{k}"].set_parameters({**landing.contact.settings, "initial.s": s})
        if landing.controller is not None:
            components[CONTROLLER] = Fmu(files[CONTROLLER], CONTROLLER, isolate=apart[CONTROLLER])
            components[CONTROLLER].set_parameters(landing.controller.settings)
        for fmu in components.values():  # the contract says so, whether or not a unit does
            fmu.declare(name for name in fmu.ports if is_slope_of_load(name))
        possible = _possible(EXCHANGES[exchange], components)
        for name, fmu in _contacts(components).items():
            fmu.set_parameters({PARAMETER: possible.name})
            if MOVING in fmu.ports:
                fmu.set_parameters({MOVING: _moves(landing, possible, components, name)})
        inputs = {f"robot.{name}": course for name, course in landing.robot.courses.items()}
        return Graph(components, _kept(_connections(components), possible), order=tuple(components), inputs=inputs)
    except BaseException:
        for fmu in components.values():
            fmu.close()
        raise


def _files(landing: Landing) -> dict[str, Path]:
    """Return the FMUs of cable, robot, contact and controller; those of ours that are missing are built side by side."""
    parts, spec = {"cable": landing.cable, "robot": landing.robot, "contact": landing.contact}, landing.sources.spec
    if landing.controller is not None:
        parts[CONTROLLER] = landing.controller
    foreign = {name: part.foreign for name, part in parts.items() if part.foreign is not None}
    ours = {name: library.module_recipe(name) for name in ("cable", "contact") if name not in foreign}
    if spec is not None:
        ours["robot"] = library.robot_recipe(spec)
    section = landing.scenario.controller
    if section is not None and section.model is not None:
        ours[CONTROLLER] = library.module_recipe(section.model)
    return foreign | dict(zip(ours, library.kept(ours.values()), strict=True))


def inner_step(landing: Landing, exchange: Exchange) -> float:
    """Return the longest inner step (s) of our own cable where the scenario gives none."""
    step = exchange.inner_step(landing.scenario.simulation.macro_step)
    return min(step, LONGEST_ADAPTIVE) if landing.scenario.master.get("local_tolerance") else step


def lacking(components: Mapping[str, Fmu]) -> Iterator[Missing]:
    """Yield what each contact lacks of slopes and means when all is connected for which both sides have the variable."""
    supply = Supply(components, _connections(components))
    yield from (supply.missing(name) for name in _contacts(components))


def _contacts(components: Mapping[str, Fmu]) -> dict[str, Fmu]:
    return {name: fmu for name, fmu in components.items() if name.startswith("contact")}


def _possible(exchange: Exchange, components: Mapping[str, Fmu]) -> Exchange:
    """Return `exchange`, or the best for which every contact has what it needs.

    Without inputs for slopes only `point` is left: a mean force that is held feeds the contact's vibration.
    """
    for lacks in lacking(components):
        exchange = lacks.best(exchange)
    return exchange


def _moves(landing: Landing, exchange: Exchange, components: Mapping[str, Fmu], contact: str) -> bool:
    """Return whether a contact's port moves within a step: where the cable can do that, unless the scenario holds it.

    Raises
    ------
    InputError : the scenario asks for what cannot be
    """
    port, ports = f"port[{contact.removeprefix('contact')}]", components["cable"].ports
    lacking = [f"{port}.{name}" for name in MOVED if f"{port}.{name}" not in ports]
    asked = landing.contact.settings.get(MOVING)
    if asked and (lacking or not exchange.slopes):
        why = (
            f"the cable has no {lacking[0]}" if lacking else f"exchange = {exchange.name} has no motion within the step"
        )
        raise InputError(f"contact.parameters.{MOVING} = true: {why}; leave it out")
    return bool(asked is not False and not lacking and exchange.slopes)


def _connections(components: Mapping[str, Fmu]) -> list[Connection]:
    """Return all connections of the contract for which both sides have the variable."""
    found: list[Connection] = []
    for name in _contacts(components):
        k = name.removeprefix("contact")
        for side, partner in (("cable", f"cable.port[{k}]"), ("wheel", f"robot.wheel[{k}]")):
            found += _links(components, f"{name}.{side}", partner)
    return [*found, *(_flight(components) if CONTROLLER in components else ())]


def _flight(components: Mapping[str, Fmu]) -> Iterator[Connection]:
    """Yield the connections of the controller: with the robot by names, from contact k as ``contact[k].NAME``."""
    robot = components["robot"].ports
    for name, variable in components[CONTROLLER].ports.items():
        there, of = "robot", name
        if felt := re.fullmatch(r"contact\[(\d+)\]\.(.+)", name):
            there, of = f"contact{felt[1]}", felt[2]
        ports = components[there].ports if there in components else {}
        if variable.causality == "input" and of in ports and ports[of].causality == "output":
            yield Connection(f"{there}.{of}", f"{CONTROLLER}.{name}")
        elif variable.causality == "output" and name in robot and robot[name].causality == "input":
            yield Connection(f"{CONTROLLER}.{name}", f"robot.{name}")


def _kept(connections: list[Connection], exchange: Exchange) -> list[Connection]:
    """Return the connections that serve `exchange`.

    `point` gives no slopes: left open, the masters set them by joining or extrapolating the forces of the ends.
    """
    return [c for c in connections if exchange.slopes or not is_slope_of_load(c.source)]


def _links(components: Mapping[str, Fmu], contact: str, partner: str) -> Iterator[Connection]:
    """Yield the connections between one side of a contact and its partner, both ways."""
    (name, side), (other, port) = contact.split(".", 1), partner.split(".", 1)
    for full, variable in components[name].ports.items():
        if not full.startswith(f"{side}."):
            continue
        there = port + full.removeprefix(side)
        partner_port = components[other].ports.get(there)
        if partner_port is None:
            continue
        if variable.causality == "input" and partner_port.causality == "output":
            yield Connection(f"{other}.{there}", f"{name}.{full}")
        elif variable.causality == "output" and partner_port.causality == "input":
            yield Connection(f"{name}.{full}", f"{other}.{there}")
