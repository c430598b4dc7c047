"""A landing resolved: all that a run needs to know of cable, robot, contact and start, found once.

A robot or a cable from elsewhere is placed by the parameters that it shares with our own modules.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmus.cable.mesh import TOLERANCE
from fmus.cable.module import Cable
from fmus.contact.module import Contact
from fmus.module import registry
from fmus.module.recipe import Module
from fmus.module.variables import ModuleError, Value, Variable, VariableTable
from fmus.robot.module import Robot
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.robot_spec import RobotSpec, load_robot
from orchestrator.coupling.course import Course
from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.contract import BREAKS, check_variables
from orchestrator.landing.line_state import Rest, parameters_now, rest_of
from orchestrator.landing.mesh import Mesh, mesh_of
from orchestrator.landing.placement import Placement, place, wheels_along
from orchestrator.scenario.isolation import isolation
from orchestrator.scenario.over_time import courses, held
from orchestrator.scenario.types import LandingScenario

Variables = Mapping[str, Variable]
MOST_WHEELS = 4
MESH_TOLERANCE = "mesh_tolerance"
FOR_THE_MESH = 0.5
"""Part of a tolerance that is left to the mesh."""
SAMPLE_TIME = "sample_time"
"""Parameter of a controller that samples, s."""
WHOLE = 1e-9
"""Relative; how far the sample time by the macro step may be from a whole number."""
FLOWN = ("mass", "gravity", "inertia.xx", "inertia.yy", "inertia.zz")
"""Parameters of the robot that a controller is given where it has them."""
MESH_KEYS = ("n_elements", "grading", "grading_position")
"""Parameters of the cable that give its mesh; without n_elements it is found from where the wheels land."""


@dataclass(frozen=True)
class Sources:
    """What is read from files.

    Attributes
    ----------
    spec : the robot of the catalogue; None for a foreign one
    variables : of cable, robot, contact and controller, as a foreign FMU's model description or our table has them
    n_wheels : of the robot
    mounts : where a foreign robot has its wheels, if it says so by its outputs alone
    line : parameters of the cable that follow from the state of the line
    """

    spec: RobotSpec | None
    variables: Mapping[str, Variables]
    n_wheels: int
    mounts: Mapping[str, Value] = field(default_factory=dict)
    line: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Part:
    """Cable, robot, contact or controller of a landing.

    Attributes
    ----------
    foreign : the FMU that the scenario names; None for one of ours
    steps : steps that the FMU makes in each step of the master
    settings : parameters and held inputs that the FMU is given
    module : those of our module, where it stands for the FMU
    courses : inputs that follow a course over time
    """

    foreign: Path | None
    steps: int
    settings: Mapping[str, Value]
    module: Mapping[str, Value]
    courses: Mapping[str, Course] = field(default_factory=dict)


@dataclass(frozen=True)
class Landing:
    """A landing resolved: graph of FMUs, monolithic problem, estimate and fields are made from this alone.

    Attributes
    ----------
    contact : of every wheel; the arc length under it is in `placement`
    placement : the start of the robot, and the arc length under each wheel
    mesh, rest : of our cable, the latter before the robot comes; None of a foreign one
    controller : what flies the robot; None where nothing does
    """

    scenario: LandingScenario
    sources: Sources
    placement: Placement
    mesh: Mesh | None
    rest: Rest | None
    cable: Part
    robot: Part
    contact: Part
    controller: Part | None = None

    @property
    def n_wheels(self) -> int:
        """Number of wheels, and of contacts."""
        return self.sources.n_wheels

    def changed(self, scenario: LandingScenario) -> Landing:
        """Return the landing of a `scenario` that starts alike: with other steps or other options of the master."""
        return _landing(scenario, self.sources, self.placement, self.mesh, self.rest)

    def meshed(self, scenario: LandingScenario) -> Landing:
        """Return the landing of a `scenario` in which the mesh alone is another."""
        return _landing(scenario, self.sources, *_placed(scenario, self.sources))


def resolve(scenario: LandingScenario) -> Landing:
    """Return the landing of `scenario`: each file is read once, the cable's equilibrium found, the robot placed over it.

    Raises
    ------
    InputError : a foreign FMU does not meet its contract, a parameter is out of bounds, the robot has no place
    """
    sources = _read(scenario)
    try:
        sources = replace(sources, mounts=_mounts(scenario, sources))
        sources = replace(sources, line=parameters_now(scenario, _cable(scenario, sources).module))
        return _landing(scenario, sources, *_placed(scenario, sources))
    except ModuleError as error:
        raise InputError(f"{scenario.path}: {error}") from None


# -- what is read ---------------------------------------------------------------------------------------------


def _read(scenario: LandingScenario) -> Sources:
    """Read the robot of the catalogue and the descriptions of foreign FMUs, and hold these against their contracts."""
    foreign = _foreign(scenario)
    known = {name: vocabulary.of_fmu(path) for name, path in foreign.items()}
    _require_contract(scenario, foreign, known)
    model = scenario.robot.model
    spec = load_robot(model) if model is not None else None
    n_wheels = spec.n_wheels if spec is not None else _wheels_of(foreign["robot"], known["robot"])
    tables = {"cable": Cable.table, "robot": Robot(n_wheels).table, "contact": Contact.table}
    ours = {name: {v.name: v for v in table.variables} for name, table in tables.items()}
    if scenario.controller is not None and scenario.controller.model is not None:
        ours["controller"] = vocabulary.of_module(scenario.controller.model)
    return Sources(spec, ours | known, n_wheels)


def _foreign(scenario: LandingScenario) -> dict[str, Path]:
    """Return the foreign FMUs of the scenario by component."""
    files = {"cable": scenario.cable.fmu, "robot": scenario.robot.fmu, "contact": scenario.contact.fmu}
    files["controller"] = scenario.controller.fmu if scenario.controller is not None else None
    return {name: Path(file) for name, file in files.items() if file is not None}


def _require_contract(scenario: LandingScenario, foreign: Mapping[str, Path], known: Mapping[str, Variables]) -> None:
    for kind, path in foreign.items():
        findings = check_variables(kind, dict(known[kind]))
        lines = [f"{kind}.fmu: {f.what} is {f.verdict}: {f.note}" for f in findings if f.verdict in BREAKS]
        if lines:
            lines.append(f"`orchestrator check {path}` shows the whole contract")
            raise InputError(f"{scenario.path}: {line}" for line in lines)


def _wheels_of(path: Path, known: Variables) -> int:
    most = MOST_WHEELS + 1
    n = next((k - 1 for k in range(1, most + 1) if f"wheel[{k}].position.x" not in known), most)
    if not 1 <= n <= MOST_WHEELS:
        raise InputError(f"{path}: has {n} wheels (outputs wheel[k].position.*); a landing takes a robot with 1 to 4")
    return n


def _mounts(scenario: LandingScenario, sources: Sources) -> dict[str, Value]:
    """Return where a foreign robot, initialised for the purpose, has its wheels, if no parameter says it."""
    wheels = range(1, sources.n_wheels + 1)
    known = sources.variables["robot"]
    if scenario.robot.fmu is None or all(f"wheel[{k}].mount.x" in known for k in wheels):
        return {}
    try:
        with Fmu(scenario.robot.fmu, "robot", isolate=isolation(scenario.robot, scenario.simulation)) as fmu:
            fmu.set_parameters(scenario.robot.parameters)
            fmu.enter_initialization(0.0)
            fmu.exit_initialization()  # many FMUs know their outputs only now
            return {f"wheel[{k}].mount.{axis}": _arm(fmu, k, axis) for k in wheels for axis in "xyz"}
    except FmuError as error:
        raise RunError(str(error), error.time) from None


def _arm(fmu: Fmu, k: int, axis: str) -> float:
    return float(fmu.read(f"wheel[{k}].position.{axis}")) - float(fmu.read(f"body.position.{axis}"))


# -- what follows from it -------------------------------------------------------------------------------------


def _landing(
    scenario: LandingScenario, sources: Sources, placement: Placement, mesh: Mesh | None, rest: Rest | None
) -> Landing:
    robot, known = _robot(scenario, sources), sources.variables["robot"]
    initial = {name: value for name, value in placement.initial.items() if name in known}
    settings = dict(scenario.robot.parameters) | initial | held(scenario.robot.inputs)
    robot = replace(robot, settings=settings, module=dict(robot.module) | placement.initial)
    cable, contact = _cable(scenario, sources), _contact(scenario, sources)
    controller = _controller(scenario, sources, robot)
    return Landing(scenario, sources, placement, mesh, rest, cable, robot, contact, controller)


def _cable(scenario: LandingScenario, sources: Sources) -> Part:
    section, shown = scenario.cable, _shown(scenario.cable.fmu, sources.variables["cable"], Cable.table)
    settings = _mesh(scenario, sources) | section.parameters | dict(sources.line)
    return Part(_path(section.fmu), section.steps, settings, shown | settings)


def _mesh(scenario: LandingScenario, sources: Sources) -> dict[str, Value]:
    """Return what a cable that finds its mesh by itself has to know: where wheels land, how heavy they are, how exactly.

    Half of the smallest tolerance is left to the mesh, and never more than what it leaves by default.
    """
    known, robot = sources.variables["cable"], robot_module(_robot(scenario, sources), sources.n_wheels)
    if scenario.cable.parameters.get("n_elements", 0) or "landing_load" not in known:
        return {}
    wheels = scenario.landing.position + wheels_along(robot)
    tolerance = min([TOLERANCE, *(FOR_THE_MESH * allowed for allowed in scenario.simulation.tolerances.values())])
    found: dict[str, Value] = {f"landing[{k + 1}].position": float(y) for k, y in enumerate(wheels)}
    return found | {"landing_load": _weight(robot), MESH_TOLERANCE: tolerance}


def _weight(robot: Robot) -> float:
    """Return the robot's weight, N."""
    return float(np.prod(robot.values[robot.table.indices(("mass", "gravity"))]))


def _robot(scenario: LandingScenario, sources: Sources) -> Part:
    """Return the robot before it is placed."""
    section, table = scenario.robot, Robot(sources.n_wheels).table
    shown = _shown(section.fmu, sources.variables["robot"], table)
    stated = sources.spec.parameters if sources.spec is not None else {}
    constant = section.parameters | held(section.inputs)
    module = shown | stated | constant | dict(sources.mounts)
    return Part(_path(section.fmu), section.steps, constant, module, courses(section.inputs))


def _contact(scenario: LandingScenario, sources: Sources) -> Part:
    section = scenario.contact
    stated = sources.spec.contact_parameters if sources.spec is not None else {}
    settings = stated | section.parameters
    return Part(_path(section.fmu), 1, settings, settings)


def _controller(scenario: LandingScenario, sources: Sources, robot: Part) -> Part | None:
    """Return what flies the robot: it knows the robot's mass, inertia and rotors, where it has parameters of these names."""
    section = scenario.controller
    if section is None:
        return None
    known, module = sources.variables["controller"], robot_module(robot, sources.n_wheels)
    flown = {name: float(module.values[module.table.index[name]]) for name in FLOWN}
    if sources.spec is not None and sources.spec.rotors is not None:
        flown["max_thrust"] = sources.spec.rotors.max_thrust.value
    settings = {name: value for name, value in flown.items() if name in known} | section.parameters
    part = Part(_path(section.fmu), 1, settings, settings)
    _require_instants(scenario, part, known)
    return part


def _require_instants(scenario: LandingScenario, controller: Part, known: Variables) -> None:
    """Raise `InputError` where macro steps do not end at every sampling instant: coupled and monolithic would fly otherwise."""
    given = controller.settings.get(SAMPLE_TIME, known[SAMPLE_TIME].start if SAMPLE_TIME in known else 0.0)
    period, step = float(given or 0.0), scenario.simulation.macro_step
    count = max(1.0, round(period / step))
    if period > 0.0 and abs(period / step - count) > WHOLE * count:
        raise InputError(
            f"{scenario.path}: simulation.macro_step: {step:g} s does not divide the controller's {SAMPLE_TIME}, "
            f"{period:g} s: it would sample at other times than it says; {period / count:g} s does, or give "
            f"controller.parameters.{SAMPLE_TIME}"
        )


def _path(file: str | None) -> Path | None:
    return Path(file) if file is not None else None


def _shown(file: str | None, known: Variables, table: VariableTable) -> dict[str, Value]:
    """Return the start values of those parameters of a foreign FMU that `table` has as well."""
    if file is None:
        return {}
    shared = [n for n in table.names("parameter") if n in known and known[n].start != "" and n != "n_wheels"]
    return {name: known[name].start for name in shared}


def _placed(scenario: LandingScenario, sources: Sources) -> tuple[Placement, Mesh | None, Rest | None]:
    """Return the start of the robot over the cable at rest, and the mesh of our cable, and what it is like at rest."""
    cable = cable_module(_cable(scenario, sources))
    robot = robot_module(_robot(scenario, sources), sources.n_wheels)
    contact = contact_module(_contact(scenario, sources), 0.0)
    contact.check_parameters()
    landing = scenario.landing
    placement = place(cable, robot, contact, landing.position, landing.height, landing.velocity)
    if scenario.robot.fmu is None:
        robot.table.assign(robot.values, placement.initial)
        robot.initialize(0.0)  # its mass and inertia are looked at before anything is run
    if scenario.cable.fmu is not None:
        return placement, None, None
    mesh = mesh_of(cable, _weight(robot), landing.position, placement.arc_lengths)
    return placement, mesh, rest_of(cable, scenario)


# -- our modules ----------------------------------------------------------------------------------------------


def cable_module(part: Part) -> Cable:
    """Return our cable with the parameters of `part`, at rest."""
    cable = cable_as_given(part)
    cable.initialize(0.0)
    return cable


def cable_as_given(part: Part) -> Cable:
    """Return our cable with the parameters of `part`; it is not initialised."""
    cable = Cable()
    _assign(cable.table, cable.values, part.module)
    return cable


def robot_module(part: Part, n_wheels: int) -> Robot:
    """Return our robot with the parameters of `part`; it is not initialised."""
    robot = Robot(n_wheels)
    _assign(robot.table, robot.values, part.module)
    return robot


def contact_module(part: Part, s: float) -> Contact:
    """Return our contact with the parameters of `part` at arc length `s` (m)."""
    contact = Contact()
    _assign(contact.table, contact.values, {**part.module, "initial.s": s})
    return contact


def controller_module(landing: Landing) -> Module:
    """Return the module that flies the robot of a landing; it is not initialised."""
    section, part = landing.scenario.controller, landing.controller
    assert section is not None and section.model is not None and part is not None
    module = registry.find(section.model).recipe().make_module()
    module.table.assign(module.values, part.module)
    return module


def _assign(table: VariableTable, values: np.ndarray, settings: Mapping[str, Value]) -> None:
    table.assign(values, {name: value for name, value in settings.items() if name in table.index})
