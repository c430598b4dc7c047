"""From a landing scenario to what is solved: the graph of FMUs, or the modules of the monolithic reference.

A robot or a cable from elsewhere is placed by the parameters that it shares with our own modules. If it has all of
them, the monolithic reference takes them too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.cable.module import N_SHAPE, Cable
from fmus.contact.module import Contact
from fmus.robot.module import Robot
from fmus.variables import ModuleError, Value, VariableTable
from orchestrator import library, vocabulary
from orchestrator.errors import InputError
from orchestrator.fmu import Fmu
from orchestrator.graph import Connection, Graph
from orchestrator.monolithic import Problem
from orchestrator.placement import Placement, place
from orchestrator.robots import RobotSpec, load_robot
from orchestrator.scenario import Scenario
from orchestrator.sub_steps import instance

NOT_NEEDED = ("initial.", ".braked", ".inertia", ".axle_direction", "integration_step", "n_wheels", "center_of_mass")
"""Robot parameters that a reference takes at their defaults where a foreign robot does not have them."""


INNER_STEPS = {"waveform": 4, "hermite": 4, "point": 1}
"""Inner steps of our cable in a macro step, where the scenario gives no `integration_step`. The error that they leave
shrinks with the macro step as that of the exchange does, and stays a tenth of it (docs/decisions.md)."""
LONGEST_ADAPTIVE = 2.5e-3
"""Longest such step, s, where the master's steps are adaptive: long macro steps are then wanted, and the local error does
not tell that of the cable's inner steps (docs/masters.md)."""


@dataclass(frozen=True)
class Parts:
    """A landing resolved: parameters of every component, and the modules that stand for them."""

    cable: dict[str, Value]
    robot: dict[str, Value]
    contact: dict[str, Value]
    n_wheels: int
    spec: RobotSpec | None


def parts(scenario: Scenario) -> Parts:
    """Return the parameters of the scenario's components, the robot's catalogue entry included."""
    assert scenario.cable is not None and scenario.robot is not None
    section = scenario.robot
    spec = load_robot(section.model) if section.model is not None else None
    robot = dict(spec.parameters) if spec is not None else {}
    contact = dict(spec.contact_parameters) if spec is not None else {}
    n_wheels = spec.n_wheels if spec is not None else _wheels_of(Path(str(section.fmu)))
    return Parts(
        dict(scenario.cable.parameters),
        robot | dict(section.parameters),
        contact | dict(scenario.contact.parameters),
        n_wheels,
        spec,
    )


def _wheels_of(path: Path) -> int:
    known = vocabulary.of_fmu(path)
    n = next((k - 1 for k in range(1, 6) if f"wheel[{k}].position.x" not in known), 5)
    if not 1 <= n <= 4:
        raise InputError(f"{path}: has {n} wheels (outputs wheel[k].position.*); a landing takes a robot with 1 to 4")
    return n


def problem(scenario: Scenario) -> Problem:
    """Return the landing as initialised modules, for the monolithic solver."""
    made, placement = _placed(scenario)
    made.robot.initialize(0.0)
    return Problem(made.cable, made.robot, [_contact(scenario, s) for s in placement.arc_lengths])


def has_monolithic(scenario: Scenario) -> bool:
    """Return whether the monolithic solver can stand for the scenario's FMUs, foreign ones included."""
    assert scenario.cable is not None and scenario.robot is not None
    if scenario.contact.fmu is not None:
        return False
    wanted = {scenario.cable.fmu: Cable.table, scenario.robot.fmu: Robot(parts(scenario).n_wheels).table}
    for path, table in wanted.items():
        known = vocabulary.of_fmu(Path(path)) if path is not None else {}
        names = [n for n in table.names("parameter") if not any(part in n for part in NOT_NEEDED)]
        if path is not None and not all(name in known for name in names):
            return False
    return True


def _placed(scenario: Scenario) -> tuple[Problem, Placement]:
    """Return cable (initialised), robot and one contact with their parameters, and the robot's placement."""
    assert scenario.cable is not None and scenario.robot is not None and scenario.landing is not None
    resolved, landing = parts(scenario), scenario.landing
    try:
        cable = Cable()
        _assign(cable.table, cable.values, _shown(scenario.cable.fmu, cable.table) | resolved.cable)
        cable.initialize(0.0)
        robot = Robot(resolved.n_wheels)
        settings = resolved.robot | scenario.robot.inputs
        _assign(robot.table, robot.values, _shown(scenario.robot.fmu, robot.table) | settings)
        if scenario.robot.fmu is not None:
            _look_at(robot, Path(scenario.robot.fmu), resolved)
        contact = _contact(scenario, 0.0)
        contact.check_parameters()
        placement = place(cable, robot, contact, landing.position, landing.height, landing.velocity)
        robot.table.assign(robot.values, placement.initial)
        if scenario.robot.fmu is None:
            robot.initialize(0.0)
    except ModuleError as error:
        raise InputError(f"{scenario.path}: {error}") from None
    return Problem(cable, robot, [contact]), placement


def _assign(table: VariableTable, values: np.ndarray, settings: Mapping[str, Value]) -> None:
    table.assign(values, {name: value for name, value in settings.items() if name in table.index})


def _shown(path: str | None, table: VariableTable) -> dict[str, Value]:
    """Return the start values of those parameters of a foreign FMU that `table` has as well."""
    if path is None:
        return {}
    known = vocabulary.of_fmu(Path(path))
    shared = [n for n in table.names("parameter") if n in known and known[n].start != "" and n != "n_wheels"]
    return {name: known[name].start for name in shared}


def _look_at(robot: Robot, path: Path, resolved: Parts) -> None:
    """Take from a foreign robot, initialised for the purpose, where its wheels are, if no parameter says it."""
    known = vocabulary.of_fmu(path)
    if all(f"wheel[{k + 1}].mount.x" in known for k in range(resolved.n_wheels)):
        return
    fmu = Fmu(path, "robot")
    try:
        fmu.set_parameters(resolved.robot)
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()  # many FMUs know their outputs only now
        for k in range(resolved.n_wheels):
            for axis in "xyz":
                arm = float(fmu.read(f"wheel[{k + 1}].position.{axis}")) - float(fmu.read(f"body.position.{axis}"))
                robot.values[robot.table.index[f"wheel[{k + 1}].mount.{axis}"]] = arm
    finally:
        fmu.close()


def _contact(scenario: Scenario, s: float) -> Contact:
    """Return a contact module at arc length `s`."""
    contact = Contact()
    _assign(contact.table, contact.values, parts(scenario).contact | {"initial.s": s})
    return contact


def graph(scenario: Scenario, exchange: str) -> Graph:
    """Return the graph of loaded FMUs: cable, robot, one contact a wheel, connected by the contract.

    `waveform` becomes `hermite` where cable or robot does not give its means, `point` where one takes no slopes.
    """
    assert scenario.cable is not None and scenario.robot is not None
    resolved, (_, placement) = parts(scenario), _placed(scenario)
    components: dict[str, Fmu] = {}
    try:
        components["cable"] = instance(scenario.cable.fmu or library.cable_fmu(), "cable", scenario.cable.steps)
        components["cable"].set_parameters(_inner_step(scenario, exchange) | resolved.cable)
        robot = library.robot_fmu(resolved.spec) if resolved.spec is not None else Path(str(scenario.robot.fmu))
        components["robot"] = instance(robot, "robot", scenario.robot.steps)
        initial = {n: v for n, v in placement.initial.items() if n in components["robot"].ports}
        if not all(f"initial.position.{axis}" in initial for axis in "yz"):
            raise InputError(f"{robot}: has no parameters initial.position.*: the robot cannot be placed")
        components["robot"].set_parameters(dict(scenario.robot.parameters) | initial | scenario.robot.inputs)
        exchange = _possible(exchange, components)
        for k, s in enumerate(placement.arc_lengths, start=1):
            contact = Fmu(scenario.contact.fmu or library.contact_fmu(), f"contact{k}")
            components[f"contact{k}"] = contact
            contact.set_parameters(resolved.contact | {"initial.s": s, "exchange": exchange})
        return Graph(components, _connections(components, exchange), order=tuple(components))
    except BaseException:
        for fmu in components.values():
            fmu.close()
        raise


def _inner_step(scenario: Scenario, exchange: str) -> dict[str, Value]:
    """Return the longest inner step of our own cable."""
    assert scenario.cable is not None
    step = scenario.simulation.macro_step / INNER_STEPS[exchange]
    if scenario.master.get("local_tolerance"):
        step = min(step, LONGEST_ADAPTIVE)
    return {"integration_step": step} if scenario.cable.fmu is None else {}


def _possible(exchange: str, components: Mapping[str, Fmu]) -> str:
    """Return `exchange`, or the best that cable and robot admit.

    Without inputs for slopes only `point` is left: a mean force that is held feeds the contact's vibration.
    """
    cable, robot = components["cable"].ports, components["robot"].ports
    if not ("port[1].force_rate.x" in cable and "wheel[1].force_rate.x" in robot):
        return "point"
    means = "port[1].position_mean.x" in cable and "wheel[1].rotation_mean.x" in robot
    return "hermite" if exchange == "waveform" and not means else exchange


def _connections(components: Mapping[str, Fmu], exchange: str) -> list[Connection]:
    """Return all connections of the contract for which both sides have the variable.

    `point` gives no slopes: left open, the masters set them by joining or extrapolating the forces of the ends.
    """
    found: list[Connection] = []
    for name in components:
        if not name.startswith("contact"):
            continue
        k = name.removeprefix("contact")
        for side, partner in (("cable", f"cable.port[{k}]"), ("wheel", f"robot.wheel[{k}]")):
            found += _links(components, f"{name}.{side}", partner)
    slopes = ("force_rate.", "moment_rate.")
    return [c for c in found if exchange != "point" or not any(slope in c.source for slope in slopes)]


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


def cable_fields(scenario: Scenario, table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return shape and tension of the cable over time from its signals; empty if it does not show them.

    Returns
    -------
    time (n,) s, arc_length (m,) m, position (n, m, 3) m, tension (n, m) N
    """
    if "cable.shape[1].position.x" not in table:
        return {}
    points = range(1, N_SHAPE + 1)
    position = np.stack(
        [np.stack([table[f"cable.shape[{i}].position.{axis}"] for axis in "xyz"], axis=-1) for i in points], axis=1
    )
    tension = np.stack([table[f"cable.shape[{i}].tension"] for i in points], axis=1)
    assert scenario.cable is not None
    length = float(scenario.cable.parameters.get("unstretched_length", Cable.table["unstretched_length"].start))
    return {
        "time": np.asarray(table["time"]),
        "arc_length": np.linspace(0.0, length, N_SHAPE),
        "position": position,
        "tension": tension,
    }


def interface_balance(table: Mapping[str, np.ndarray], booked: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Return for every contact how well the energies on both sides of its two interfaces agree.

    Parameters
    ----------
    table : signals over time
    booked : load (``robot.wheel[1].force``) → work done through it over time, J; serves where an FMU books none itself

    Returns
    -------
    contact → `exchanged_J`, the energy that went to and fro on cable and wheel; `cable_residual_J`,
    `wheel_residual_J`, the largest difference between the work that component and contact have booked;
    `law_residual_J`, the largest difference between the contact's work and what it stores and dissipates;
    `relative`, the largest of the three by the energy exchanged
    """
    contacts = sorted(name.removesuffix(".work_cable") for name in table if name.endswith(".work_cable"))
    return {contact: _balance(table, booked, contact) for contact in contacts}


def _balance(table: Mapping[str, np.ndarray], booked: Mapping[str, np.ndarray], contact: str) -> dict[str, float]:
    k = contact.removeprefix("contact")
    work = {side: table[f"{contact}.work_{side}"] for side in ("cable", "wheel")}
    residuals = {}
    for side, port in (("cable", f"cable.port[{k}]"), ("wheel", f"robot.wheel[{k}]")):
        theirs = table.get(f"{port}.work")
        if theirs is None:
            theirs = sum((values for name, values in booked.items() if name.startswith(f"{port}.")), np.zeros(1))
        residuals[f"{side}_residual_J"] = float(np.max(np.abs(theirs - work[side])))
    kept = table[f"{contact}.strain_energy"] + table[f"{contact}.dissipated_energy"]
    law = work["cable"] + work["wheel"] + kept
    residuals["law_residual_J"] = float(np.max(np.abs(law - law[0])))
    exchanged = float(sum(np.sum(np.abs(np.diff(values))) for values in work.values()))
    largest = max(residuals.values())
    return {"exchanged_J": exchanged, **residuals, "relative": largest / exchanged if exchanged else largest}
