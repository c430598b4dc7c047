"""Drive the monolithic solver: step control, output, and an estimate of its own error."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fmus.cable.module import N_SHAPE, Cable
from fmus.cable.state import make_work
from fmus.contact.law import law_parameters
from fmus.contact.module import Contact
from fmus.kernels.time_integration import collocation
from fmus.module.recipe import Module
from fmus.module.variables import ModuleError, VariableTable
from fmus.robot.module import Robot, body_parameters, initial_state
from orchestrator.coupling.course import Course
from orchestrator.coupling.exchange import only_couples
from orchestrator.landing.monolithic import control as steps
from orchestrator.landing.monolithic.control_loads import ControlLoads
from orchestrator.landing.monolithic.entry import CONTACT, Shown, advance_straight, begin, make_shown, show
from orchestrator.landing.monolithic.pilot import Pilot
from orchestrator.landing.monolithic.state import (
    ARC,
    AXLE_ALONG,
    N_CONTACT,
    N_ROBOT,
    OFF_CABLE,
    OK,
    State,
    System,
    make_space,
)

LONGEST = 9.4e-4
"""s; longest step at the default tolerance, it resolves the cable's waves (docs/verification.md)."""
EVENT = 2.7e-5
"""s; longest step at the default tolerance in which a contact may open, close, begin or cease to slide.

What such a step gets wrong depends on where in it the event falls. For the estimate it shrinks faster than the other
steps do, so that the coarser solution, whatever the chance, is the one that is wrong.
"""
TOLERANCE = 2e-10
"""m, local error of the robot's position a step allowed by default: leaves 6e-9 of the flagship's range."""
NEWTON = 1e-12


@dataclass
class Problem:
    """Initialised modules that make one system; one contact a wheel, in the order of the wheels.

    `courses`: inputs of the robot that follow a course over time; the others keep their values. `controller`: what flies it,
    not initialised.
    """

    cable: Cable
    robot: Robot
    contacts: list[Contact]
    courses: Mapping[str, Course] = field(default_factory=dict)
    controller: Module | None = None


@dataclass
class Solution:
    """Signals of a monolithic run at the output times.

    Attributes
    ----------
    time : (n,) s
    signals : ``component.variable`` → (n,); components are cable, robot, contact1 …
    wall_s : wall time of the solution returned, warm
    steps : number of steps
    tolerance : local tolerance, m
    estimated_error : signal → largest difference from the solution with steps twice as long, unit of the signal
    """

    time: np.ndarray
    signals: dict[str, np.ndarray]
    wall_s: float
    steps: int
    tolerance: float
    estimated_error: dict[str, float] = field(default_factory=dict)


class Integrator:
    """The system's state and the steps that advance it.

    Parameters
    ----------
    refinement : the intervals between output times are divided into at least so many steps, or a multiple of it
    start_time : s; None: not begun, to be packed alone (`starts.py`)
    """

    def __init__(
        self,
        problem: Problem,
        tolerance: float = TOLERANCE,
        refinement: int = 1,
        start_time: float | None = 0.0,
    ):
        self.problem = problem
        cable, robot = problem.cable, problem.robot
        self.method = collocation(cable["spectral_radius"])
        n_wheels = len(problem.contacts)
        prm = body_parameters(robot.values, robot.table)
        contacts = np.stack([law_parameters(c.values, c.table) for c in problem.contacts])
        self.loads = ControlLoads(robot, problem.courses)
        self.system = System(cable.model, self.method, prm, contacts, self.loads.values)
        memory = np.zeros((n_wheels, N_CONTACT))
        memory[:, ARC] = [c.values[c.table.index["initial.s"]] for c in problem.contacts]
        start = initial_state(robot.values, robot.table)
        self.state = State(cable.state.copy(), start, np.zeros((2, N_ROBOT)), memory, np.zeros(1))
        self.work = make_work(cable.model.weight.size, cable.state.size)
        self.space = make_space(cable.model.weight.size, n_wheels)
        longest = LONGEST * (tolerance / TOLERANCE) ** 0.25
        event = EVENT * (tolerance / TOLERANCE) ** 0.5
        self.options = np.array([0.0, 0.0, longest, float(refinement)])
        self.control = np.array([0.02 * longest, longest, tolerance, event, NEWTON, 0.0, 0.0, 0.0, 0.0])
        self.pilot = Pilot(problem.controller, robot, self) if problem.controller is not None else None
        if start_time is not None and begin(self.system, self.state, start_time, self.space, self.work) != OK:
            raise ModuleError("monolithic: the contact law fails at the start; check the initial pose of the robot")
        if start_time is not None and self.pilot is not None:
            self.pilot.start(start_time)

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return int(self.control[steps.STEPS])

    def advance(self, t: float, end: float) -> None:
        """Integrate from `t` to `end` with controlled steps, which end where an input has a kink or the controller samples.

        Raises
        ------
        ModuleError : no step is short enough
        """
        for first, last in pairwise([t, *self._stops(t, end), end]):
            self.loads.set(first, last)
            self._advance(first, last)
            if self.pilot is not None:
                self.pilot.reach(last)

    def _stops(self, t: float, end: float) -> list[float]:
        """Return the times within (`t`, `end`) at which the loads are not straight."""
        kinks = self.loads.kinks(t, end)
        return kinks if self.pilot is None else sorted({*kinks, *self.pilot.instants(t, end)})

    def _advance(self, t: float, end: float) -> None:
        """Integrate over a time in which the control loads are straight."""
        status, reached = advance_straight(
            self.system, self.state, self.control, self.options, t, end, self.space, self.work
        )
        if status == OFF_CABLE:
            raise ModuleError(
                f"monolithic: a wheel has run past a support, off the cable, at t = {reached:g} s; "
                "stop the run earlier, or brake the robot"
            )
        if status == AXLE_ALONG:
            raise ModuleError(
                f"monolithic at t = {reached:g} s: the cable presses on a groove wall and is steeper to the wheel's plane "
                "than the wall: the axle lies along the cable, which the law does not cover; turn the robot's yaw, or "
                "stop the run earlier"
            )
        if status != OK:
            raise ModuleError(
                f"monolithic: no step is short enough at t = {reached:g} s; check stiffness and damping of the contact"
            )


class _Recorder:
    """Writes the modules' own outputs at the output times."""

    def __init__(self, integrator: Integrator, n: int):
        self.integrator = integrator
        problem = integrator.problem
        self.shown = shown_of(problem)
        self.cable_names, self.cable_at = recorded(problem.cable.table)
        self.robot_names, self.robot_at = recorded(problem.robot.table)
        self.cable_rows = np.zeros((n, len(self.cable_names)))
        self.robot_rows = np.zeros((n, len(self.robot_names)))
        self.contact_rows = np.zeros((n, len(problem.contacts), len(CONTACT)))
        self.pilot_names = integrator.pilot.outputs if integrator.pilot is not None else []
        self.pilot_rows = np.zeros((n, len(self.pilot_names)))

    def record(self, i: int) -> None:
        """Write row `i` from the present state."""
        one, shown = self.integrator, self.shown
        show(one.system, one.state, shown, one.space, one.work)
        nodes = one.problem.cable.nodes_at(one.state.cable)
        cable = np.concatenate([part.ravel() for part in (shown.ports, shown.cable, shown.shape, nodes)])
        self.cable_rows[i], self.robot_rows[i] = cable[self.cable_at], shown.robot[self.robot_at]
        self.contact_rows[i] = shown.contacts[:, : len(CONTACT)]
        if one.pilot is not None:
            self.pilot_rows[i] = one.pilot.values()

    def signals(self) -> dict[str, np.ndarray]:
        """Return every signal by name."""
        found = {f"cable.{name}": self.cable_rows[:, j] for j, name in enumerate(self.cable_names)}
        found |= {f"robot.{name}": self.robot_rows[:, j] for j, name in enumerate(self.robot_names)}
        found |= {f"controller.{name}": self.pilot_rows[:, j] for j, name in enumerate(self.pilot_names)}
        for k in range(self.contact_rows.shape[1]):
            found |= {f"contact{k + 1}.{name}": self.contact_rows[:, k, j] for j, name in enumerate(CONTACT)}
        return found


def shown_of(problem: Problem) -> Shown:
    """Return new room for what is shown of a problem."""
    return make_shown(problem.robot.state, len(problem.contacts), N_SHAPE)


def recorded(table: VariableTable) -> tuple[list[str], list[int]]:
    """Return the outputs that are no companions of others and no work of the coupling, and their places among all."""
    outputs = table.names("output")
    places = [i for i, name in enumerate(outputs) if not (only_couples(name) or ".work" in name)]
    return [outputs[i] for i in places], places


def integrate(
    make: Callable[[], Problem],
    times: np.ndarray,
    tolerance: float = TOLERANCE,
    progress: Callable[[float], None] | None = None,
    refinement: int = 1,
) -> Solution:
    """Solve once.

    Parameters
    ----------
    make : returns the initialised problem
    times : (n,) ascending output times, s; the first one is the start
    tolerance : local error of the robot's position allowed a step, m
    progress : called with the time reached
    refinement : see `Integrator`
    """
    integrator = Integrator(make(), tolerance, refinement, float(times[0]))
    recorder = _Recorder(integrator, len(times))
    recorder.record(0)
    integrator.advance(float(times[0]), float(times[0]))  # compiles, or loads what is compiled: not part of the cost
    start = clock.perf_counter()
    for i in range(1, len(times)):
        integrator.advance(float(times[i - 1]), float(times[i]))
        recorder.record(i)
        if progress is not None:
            progress(float(times[i]))
    wall = clock.perf_counter() - start
    signals = recorder.signals() | _inputs(integrator.problem, times)
    return Solution(np.asarray(times), signals, wall, integrator.steps, tolerance)


def _inputs(problem: Problem, times: np.ndarray) -> dict[str, np.ndarray]:
    """Return the inputs that follow a course over time, at the output times."""
    return {f"robot.{n}": np.array([c.reached(t) for t in times.tolist()]) for n, c in problem.courses.items()}


def solve(
    make: Callable[[], Problem],
    times: np.ndarray,
    tolerance: float = TOLERANCE,
    estimate: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Solution:
    """Solve, and estimate the error by a second solution whose steps are twice as long.

    The tolerance alone would not tell: where the cable's waves or the output times limit the steps, both solutions
    would take the same ones. So the finer one divides every interval into an even number, of which the coarser one
    takes half, at a tolerance 2⁴ times as wide (the local error is of fourth order). The estimate is the whole
    difference of the two. With the order p of convergence the true error is 1/(2^p - 1) of it: a bound for p >= 1.
    Parameters as in `integrate`.
    """
    fine = integrate(make, times, tolerance, progress, refinement=2)
    if not estimate:
        return fine
    coarse = integrate(make, times, 16.0 * tolerance, progress)
    fine.estimated_error = {
        name: float(np.max(np.abs(values - coarse.signals[name]))) for name, values in fine.signals.items()
    }
    return fine
