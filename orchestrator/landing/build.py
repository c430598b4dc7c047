"""From a landing scenario to what is solved: the graph of FMUs, or the modules of the monolithic reference.

A robot or a cable from elsewhere is placed by the parameters that it shares with our own modules. If it has all of
them, the monolithic reference takes them too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.cable.module import Cable
from fmus.contact.module import Contact
from fmus.module.variables import ModuleError, Value, VariableTable
from fmus.robot.module import Robot
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.robot_spec import RobotSpec, load_robot
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.monolithic import Problem
from orchestrator.landing.placement import Placement, place
from orchestrator.scenario.types import LandingScenario

NOT_NEEDED = ("initial.", ".braked", ".inertia", ".axle_direction", "integration_step", "n_wheels", "center_of_mass")
"""Robot parameters that a reference takes at their defaults where a foreign robot does not have them."""


@dataclass(frozen=True)
class Parts:
    """A landing resolved: parameters of every component, and the modules that stand for them."""

    cable: dict[str, Value]
    robot: dict[str, Value]
    contact: dict[str, Value]
    n_wheels: int
    spec: RobotSpec | None


def parts(scenario: LandingScenario) -> Parts:
    """Return the parameters of the scenario's components, the robot's catalogue entry included."""
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


def problem(scenario: LandingScenario) -> Problem:
    """Return the landing as initialised modules, for the monolithic solver."""
    made, placement = placed(scenario)
    made.robot.initialize(0.0)
    return Problem(made.cable, made.robot, [contact_at(scenario, s) for s in placement.arc_lengths])


def has_monolithic(scenario: LandingScenario) -> bool:
    """Return whether the monolithic solver can stand for the scenario's FMUs, foreign ones included."""
    if scenario.contact.fmu is not None:
        return False
    wanted = {scenario.cable.fmu: Cable.table, scenario.robot.fmu: Robot(parts(scenario).n_wheels).table}
    for path, table in wanted.items():
        known = vocabulary.of_fmu(Path(path)) if path is not None else {}
        names = [n for n in table.names("parameter") if not any(part in n for part in NOT_NEEDED)]
        if path is not None and not all(name in known for name in names):
            return False
    return True


def placed(scenario: LandingScenario) -> tuple[Problem, Placement]:
    """Return cable (initialised), robot and one contact with their parameters, and the robot's placement."""
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
        contact = contact_at(scenario, 0.0)
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


def contact_at(scenario: LandingScenario, s: float) -> Contact:
    """Return a contact module at arc length `s`."""
    contact = Contact()
    _assign(contact.table, contact.values, parts(scenario).contact | {"initial.s": s})
    return contact
