"""The system about a state of rest: its equilibrium, and the matrices of small motions.

Forces are those of the monolithic solver: the cable's analytic tangent, and the contacts with the robot by central
differences of the solver's own kernels, wheels' feet following and bristles stretching as they do in a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.cable.assembly import (
    HALF_BANDWIDTH,
    Model,
    constrain_vector,
    element_work,
    internal_force,
    iteration_matrix,
    locate,
)
from fmus.contact import law
from fmus.contact import places as at
from fmus.kernels.rotations import turn
from fmus.module.variables import ModuleError
from fmus.robot import rigid_body as rb
from fmus.robot.module import initial_state
from orchestrator.landing.monolithic.contacts import cable_points, follow, loads, walls
from orchestrator.landing.monolithic.robot import perturb
from orchestrator.landing.monolithic.solve import Integrator, Problem
from orchestrator.landing.monolithic.state import ARC, N_ROBOT, OK, SPIN, TURN

RATE_STEP, STEP = 1e-4, 3e-3
"""Steps of the central differences: m/s and rad/s; by the penetration, m and rad.

The contact is 1e7 N/m stiff, a pendulum 1e3: round-off of a place (3e-14 m of 200) over a step must be small against
their ratio. So the step is long and the differences are of fourth order.
"""
SLIDE = 0.05
"""The same, by the elongation at which bristles begin to slide."""
STEPS = (1e-9, 2e-5)
"""Shortest and longest of the latter, m and rad."""
FOURTH_ORDER = {1: 8.0 / 12.0, -1: -8.0 / 12.0, 2: -1.0 / 12.0, -2: 1.0 / 12.0}
"""Weights of the values that many steps away, over the step."""
MAX_ITERATIONS, TOLERANCE = 150, 1e-11
"""Of the search for rest; the tolerance is that of a coordinate, m and rad."""
FIRST, FASTER, LARGEST = 1e-4, 1.5, 0.05
"""First pseudo time step, s, in which the robot falls 1 mm; its growth while what is out of balance stays as it is; largest
change of a coordinate in an iteration, m and rad."""
AWAY = 1.0
"""m; a robot that moves so far along the line has no rest where it lands."""
MOVES = (
    "modes: the robot has no rest where it lands, it rolls or slides along the line; brake its wheels "
    "(robot.parameters.wheel[k].braked = true), or land it at the lowest point"
)
CURE = "check the contact's stiffness, exponent and friction, and the robot's pose"


@dataclass(frozen=True)
class Linear:
    """M x'' + C x' + K x = 0 about rest; x are the cable's n coordinates, then the robot's ten (see `state.N_ROBOT`).

    Attributes
    ----------
    model : of the cable
    q : (n,) coordinates of the cable at rest
    robot : (21,) state of the robot at rest
    arcs, bristles : (n_wheels,) and (n_wheels, 2) arc length under each wheel and elongation of its bristles, m
    mass, damping, stiffness : (n + 10, n + 10); the robot's rows are accelerations, so that its mass matrix is 1
    inertia : (6, 6) mass and inertia of the robot in the inertial frame, kg and kg m²
    free_wheels : (4,) whether there is such a wheel, and it is free to spin
    slides : whether friction does not hold the robot where it stands
    """

    model: Model
    q: np.ndarray
    robot: np.ndarray
    arcs: np.ndarray
    bristles: np.ndarray
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    inertia: np.ndarray
    free_wheels: np.ndarray
    slides: bool


class _Contacts:
    """What the contacts and the weight do to cable and robot, at rest and near it."""

    def __init__(self, problem: Problem):
        integrator = Integrator(problem)
        self.system, self.space, self.shape = integrator.system, integrator.space, integrator.work.shape
        self.control = integrator.loads.in_the_end
        self.memory = integrator.state.contacts
        self.arcs = self.memory[:, ARC].copy()
        self.feet = self.arcs
        self.bristles = np.zeros((self.arcs.size, 2))
        self.out = self.space.out[0]

    def forces(self, q: np.ndarray, v: np.ndarray, robot: np.ndarray, bristles: np.ndarray) -> np.ndarray:
        """Return the generalised forces on the cable and the robot's accelerations: (n + 10,)."""
        system, space, arcs = self.system, self.space, self.arcs.copy()
        follow(system, q, robot, arcs, space, self.shape)
        cable_points(system, q, v, arcs, space.cable_point, self.shape)
        if walls(system, robot, space.cable_point, self.memory, self.out, space) != OK:
            raise ModuleError("modes: the contact law fails on the way to rest; check the pose of the robot")
        given = self.memory, self.out, space.generalized
        loads(system, self.control, robot, space.cable_point, bristles, *given, space)
        self.feet = arcs
        found = np.zeros(q.size + N_ROBOT)
        found[q.size :] = space.generalized[6 * arcs.size :]
        for k, s in enumerate(arcs):
            first, on_point = 6 * locate(system.model, s, self.shape), space.generalized[6 * k : 6 * k + 6]
            spread = np.outer(self.shape[:4], on_point[:3]) + np.outer(self.shape[4:], on_point[3:])
            found[first : first + 12] += spread.ravel()
        return found

    @property
    def slip_velocities(self) -> np.ndarray:
        """Those of the last evaluation, (n_wheels, 2) m/s."""
        return self.out[:, at.SLIP_VELOCITY : at.SLIP_VELOCITY + 2].copy()

    def derivatives(self, q: np.ndarray, robot: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the derivatives of `forces` by coordinates and by rates, and those of the slips by coordinates.

        A displacement stretches the bristles by the slip that its rate would be.
        """
        n, columns = q.size, self._columns(q.size)
        self.forces(q, np.zeros(n), robot, self.bristles)
        step = self._step()
        by_place, by_rate = np.zeros((n + N_ROBOT, n + N_ROBOT)), np.zeros((n + N_ROBOT, n + N_ROBOT))
        slips = np.zeros((self.arcs.size, 2, n + N_ROBOT))
        for column in columns:
            ends = []
            for change in (RATE_STEP, -RATE_STEP):
                force = self._moved(q, robot, column, change, True, self.bristles)
                ends.append((force, self.slip_velocities))
            by_rate[:, column] = (ends[0][0] - ends[1][0]) / (2.0 * RATE_STEP)
            slips[:, :, column] = (ends[0][1] - ends[1][1]) / (2.0 * RATE_STEP)
            for many, weight in FOURTH_ORDER.items():
                bristles = self.bristles + many * step * slips[:, :, column]
                moved = self._moved(q, robot, column, many * step, False, bristles)
                by_place[:, column] += weight / step * moved
        return by_place, by_rate, slips

    def _step(self) -> float:
        """Return the step of the differences by coordinates: small against penetration, and bristles do not slide."""
        prm = self.system.contacts
        slides = prm[:, at.FRICTION_COEFFICIENT] * self.out[:, at.NORMAL] / prm[:, at.TANGENTIAL_STIFFNESS]
        lengths = np.minimum(STEP * self.out[:, at.DEEPEST], SLIDE * slides)
        return float(np.clip(np.min(lengths, where=lengths > 0.0, initial=np.inf), *STEPS))

    def _columns(self, n: int) -> list[int]:
        """Return the coordinates on which the contacts depend: of the elements at the wheels, and the robot's."""
        found = set(range(n, n + N_ROBOT))
        for s in self.arcs:
            first = 6 * locate(self.system.model, s, self.shape)
            found |= set(range(max(first - 6, 0), min(first + 18, n)))
        return sorted(found)

    def _moved(
        self, q: np.ndarray, robot: np.ndarray, column: int, step: float, rate: bool, bristles: np.ndarray
    ) -> np.ndarray:
        """Return `forces` with one coordinate, or its rate, changed by `step`."""
        place, v, moved = q.copy(), np.zeros(q.size), robot.copy()
        if column >= q.size:
            perturb(robot, column - q.size, step, rate, moved, self.space.quaternions)
        else:
            (v if rate else place)[column] += step
        return self.forces(place, v, moved, bristles)


def at_rest(problem: Problem) -> Linear:
    """Return the system about its rest: the robot hangs on the line, or stands on it.

    Rest is found by pseudo time steps of a motion without inertia, whose length grows until they are Newton's. It need
    not be stable.

    Raises
    ------
    ModuleError : there is none near the place where the robot lands
    """
    search = _Search(problem)
    for _ in range(MAX_ITERATIONS):
        change = search.step()
        if np.abs(search.contacts.arcs - search.start).max() > AWAY:
            raise ModuleError(MOVES)
        if change < TOLERANCE and search.pace > 1.0:
            return _linear(search)
    free = np.any(_free_wheels(search.contacts.system.robot))
    raise ModuleError(MOVES if free else f"modes: no rest of robot and line was found; {CURE}")


class _Search:
    """The search for rest: where it is, and the length of its next pseudo time step."""

    def __init__(self, problem: Problem):
        self.contacts, self.model = _Contacts(problem), problem.cable.model
        self.n = self.model.weight.size
        self.q, self.robot = problem.cable.state[: self.n].copy(), _still(problem)
        self.weight = float(problem.robot.values[problem.robot.table.index["mass"]])
        self.mass = _bordered(_matrix(self.model, self.q, 1.0, 0.0), np.eye(N_ROBOT))
        self.start = self.contacts.arcs.copy()
        self.pace, self.before = FIRST, np.inf

    def step(self) -> float:
        """Make one step; return the largest change of a coordinate, m or rad."""
        contacts, n = self.contacts, self.n
        residual = _residual(self.model, self.q, contacts.forces(self.q, np.zeros(n), self.robot, contacts.bristles))
        contacts.arcs[:] = contacts.feet
        by_place, _, slips = contacts.derivatives(self.q, self.robot)
        stiffness = _bordered(_matrix(self.model, self.q, 0.0, 1.0)) - _held(self.model, by_place)
        self._adapt(float(np.abs(residual[n:]).max() + np.abs(residual[:n]).max() / self.weight))
        change = -np.linalg.solve(self.mass / self.pace + stiffness, residual)
        change *= min(1.0, LARGEST / max(float(np.abs(change).max()), 1e-300))
        self.q, self.robot = self.q + change[:n], _turned(self.robot, change[n:])
        contacts.forces(self.q, np.zeros(n), self.robot, contacts.bristles + slips @ change)
        contacts.bristles = contacts.out[:, at.ELONGATION : at.ELONGATION + 2].copy()
        return float(np.abs(change).max())

    def _adapt(self, size: float) -> None:
        """Make the pace faster as what is out of balance, `size`, gets less."""
        if size > 0.0:
            self.pace = min(self.pace * float(np.clip(FASTER * self.before / size, 0.5, 4.0)), 1e12)
        self.before = size


def _linear(search: _Search) -> Linear:
    """Return the system about the rest that has been found."""
    contacts, q, robot = search.contacts, search.q, search.robot
    contacts.forces(q, np.zeros(q.size), robot, contacts.bristles)
    there = contacts.feet, contacts.bristles
    slides = bool(np.any(contacts.out[:, at.STATUS] == law.SLIP))
    by_place, by_rate, _ = contacts.derivatives(q, robot)
    damping, stiffness = (_bordered(_matrix(search.model, q, 0.0, *one)) for one in ((0.0, 1.0), (1.0, 0.0)))
    prm = contacts.system.robot
    matrices = search.mass, damping - by_rate, stiffness - by_place
    return Linear(search.model, q, robot, *there, *matrices, _inertia(prm, robot), _free_wheels(prm), slides)


def _bordered(cable: np.ndarray, robot: np.ndarray | None = None) -> np.ndarray:
    """Return the matrix of the cable (n, n) and that of the robot, zero if there is none, as one: (n + 10, n + 10)."""
    n = len(cable)
    found = np.zeros((n + N_ROBOT, n + N_ROBOT))
    found[:n, :n] = cable
    if robot is not None:
        found[n:, n:] = robot
    return found


def _free_wheels(prm: np.ndarray) -> np.ndarray:
    """Return which wheels there are that are free to spin: (4,) bool."""
    free = [prm[rb.WHEELS + rb.WHEEL_STRIDE * k + rb.FREE] > 0.0 for k in range(rb.MAX_WHEELS)]
    return (np.arange(rb.MAX_WHEELS) < prm[rb.N_WHEELS]) & free


def _still(problem: Problem) -> np.ndarray:
    """Return the robot's state at its start, at rest."""
    robot = initial_state(problem.robot.values, problem.robot.table)
    robot[rb.VELOCITY : rb.SPIN_ANGLE] = robot[rb.SPIN : rb.RIGID] = 0.0
    return robot


def _matrix(model: Model, q: np.ndarray, cm: float, cq: float, cv: float = 0.0) -> np.ndarray:
    """Return cm M + cv C + cq K of the cable at rest, its supports applied: (n, n)."""
    n, width = q.size, 2 * HALF_BANDWIDTH + 1
    band, full = np.zeros((n, width)), np.zeros((n, n + width))
    iteration_matrix(model, q, np.zeros(n), cm, cv, cq, band, np.zeros((13, 12)), element_work())
    for i in range(n):
        full[i, i : i + width] = band[i]
    return full[:, HALF_BANDWIDTH : HALF_BANDWIDTH + n]


def _residual(model: Model, q: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return what is out of balance: of the cable N, of the robot m/s² and rad/s²; (n + 10,)."""
    found, n = -force, q.size
    inner = np.zeros(n)
    internal_force(model, q, np.zeros(n), inner, element_work())
    found[:n] += inner - model.weight
    constrain_vector(model, found[:n])
    return found


def _held(model: Model, by_place: np.ndarray) -> np.ndarray:
    """Return a copy whose rows the supports have been applied to."""
    found, n = by_place.copy(), model.weight.size
    found[0:3] = found[n - 6 : n - 3] = 0.0
    found[3:6], found[n - 3 : n] = model.ends[0] @ found[3:6], model.ends[1] @ found[n - 3 : n]
    return found


def _turned(robot: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the robot's state after a change of its ten coordinates."""
    found = robot.copy()
    found[rb.POSITION : rb.POSITION + 3] += step[:TURN]
    turn(robot[rb.ATTITUDE : rb.VELOCITY], step[TURN:SPIN], np.zeros(4), found[rb.ATTITUDE : rb.VELOCITY])
    found[rb.SPIN_ANGLE : rb.SPIN] += step[SPIN:]
    return found


def _inertia(prm: np.ndarray, robot: np.ndarray) -> np.ndarray:
    """Return mass and inertia about G in the inertial frame: (6, 6)."""
    w, x, y, z = robot[rb.ATTITUDE : rb.VELOCITY]
    R, found = Rotation.from_quat([x, y, z, w]).as_matrix(), prm[rb.MASS] * np.eye(6)
    found[3:, 3:] = R @ prm[rb.INERTIA : rb.INERTIA + 9].reshape(3, 3) @ R.T
    return found
