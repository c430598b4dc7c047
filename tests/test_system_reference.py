"""The monolithic reference held against an independent integration, and its error estimate against its true error."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.cable.assembly import add_inertia, add_load, constrain_vector, element_work, internal_force, interpolate
from fmus.contact import places as at
from fmus.contact.law import contact_wrench, law_parameters
from fmus.kernels.rotations import normalize, quaternion_rate
from fmus.robot import rigid_body as rb
from fmus.robot.module import body_parameters, initial_state
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import integrate, solve
from tests.scenarios import scenario

pytestmark = pytest.mark.portable


class Independent:
    """The same physics as one explicit system of differential equations, y' = f(t, y).

    y holds q and v of the cable, the robot's position, quaternion, velocity, angular velocity, and the bristle. It
    shares the physics with the reference (forces of cable, contact and robot), but neither its time integration, nor
    its Newton matrix, nor how it couples. Friction must stick, so that the bristle follows ż = slip velocity.
    """

    def __init__(self, problem):
        cable, robot, contact = problem.cable, problem.robot, problem.contacts[0]
        self.model, self.n = cable.model, cable.model.weight.size
        self.work = element_work()
        self.robot = body_parameters(robot.values, robot.table)
        self.contact = law_parameters(contact.values, contact.table)
        self.s = float(contact.values[contact.table.index["initial.s"]])
        self.start = np.concatenate(
            [cable.state[: 2 * self.n], initial_state(robot.values, robot.table)[:13], np.zeros(2)]
        )
        self.mass = self._mass_matrix()

    def _mass_matrix(self):
        """M with the supports held: their rows and columns are those of the identity."""
        columns = []
        for i in range(self.n):
            force, unit = np.zeros(self.n), np.eye(self.n)[i]
            constrain_vector(self.model, unit)
            add_inertia(self.model, unit, force, self.work)
            constrain_vector(self.model, force)
            columns.append(force)
        mass = np.array(columns).T
        held = np.flatnonzero(np.diag(mass) == 0.0)
        mass[held, held] = 1.0
        return mass

    def _foot(self, q, wheel):
        """Arc length of the wheel's foot on the cable, by Newton's method."""
        s, point = self.s, np.zeros(6)
        for _ in range(8):
            interpolate(self.model, q, s, np.zeros(8), point)
            s += (wheel[:3] - point[:3]) @ point[3:] / (point[3:] @ point[3:])
        self.s = s
        return s

    def rates(self, t, y):
        n = self.n
        q, v, body, z = y[:n], y[n : 2 * n], np.zeros(rb.RIGID), y[2 * n + 13 :]
        body[:13] = y[2 * n : 2 * n + 13]
        normalize(body[3:7])
        motion, out, external = np.zeros(at.MOTION_SIZE), np.zeros(at.OUT_SIZE), np.zeros(n)
        rb.wheel_motion(self.robot, body, 0, motion[at.CENTRE : at.MOTION_SIZE])
        s = self._foot(q, motion[at.CENTRE : at.MOTION_SIZE])
        interpolate(self.model, q, s, np.zeros(8), motion[at.POINT : at.POINT_RATE])
        interpolate(self.model, v, s, np.zeros(8), motion[at.POINT_RATE : at.CENTRE])
        contact_wrench(self.contact, motion, z.copy(), out)
        force, moment = out[at.CABLE_FORCE : at.CABLE_MOMENT], out[at.CABLE_MOMENT : at.WHEEL_FORCE]
        add_load(self.model, q, s, force, moment, np.zeros(8), external)
        force = np.zeros(n)
        internal_force(self.model, q, v, force, self.work)
        load = self.model.weight + external - force
        constrain_vector(self.model, load)
        loads = np.zeros(rb.BODY_LOADS + rb.WHEEL_LOADS)
        loads[rb.BODY_LOADS : rb.BODY_LOADS + 6] = out[at.WHEEL_FORCE : at.NORMAL]
        resultant, moment, torque, acceleration = np.zeros(3), np.zeros(3), np.zeros(4), np.zeros(10)
        rb.resultants(self.robot, body, loads, resultant, moment, torque)
        rb.accelerations(self.robot, body, resultant, moment, torque, acceleration)
        turn = np.zeros(4)
        quaternion_rate(body[3:7], *body[10:13], turn)
        accelerations = np.linalg.solve(self.mass, load)
        slip = out[at.SLIP_VELOCITY : at.CONTACT_LENGTH]
        if out[at.NORMAL] <= 0.0:
            slip = -1e3 * z  # in the air the bristle relaxes
        return np.concatenate([v, accelerations, body[7:10], turn, acceleration[:6], slip])


def pressed(one):
    """The problem of a scenario with the robot 0.2 mm lower than touching: its friction can hold from the start."""
    problem = landing.problem(one)
    problem.robot.values[problem.robot.table.index["initial.position.z"]] -= 2e-4
    problem.robot.initialize(0.0)
    return problem


def test_against_an_independent_stiff_integrator():
    """Radau IIA of order 5 in SciPy on a cable of four elements, with roll, pitch and yaw; friction that never slides.

    The reference is as accurate as its own estimate says, SciPy as its tolerance: 1e-9 m a step.
    """
    settings = {"cable.parameters.n_elements": 4, "cable.parameters.grading": 1.0}
    settings |= {"contact.parameters.friction_coefficient": 1e6, "robot.parameters.initial.roll": 0.05}
    settings |= {"robot.parameters.initial.pitch": 0.05, "robot.parameters.initial.yaw": 0.1}
    one = scenario("rig_10m", 0.08, **settings)
    times = np.linspace(0.0, 0.08, 17)
    reference = solve(lambda: pressed(one), times, 1e-11)
    system = Independent(pressed(one))
    found = solve_ivp(system.rates, (0.0, times[-1]), system.start, "Radau", times, rtol=1e-8, atol=1e-9)
    assert found.success
    body = found.y[2 * system.n :]
    robot, problem = np.zeros(rb.RIGID), pressed(one)
    positions = []
    for i in range(times.size):
        robot[:13] = body[:13, i]
        normalize(robot[3:7])
        out = np.zeros(6)
        rb.body_motion(system.robot, robot, out)
        positions.append(out[:3].copy())
    assert problem.robot.n_wheels == 1
    for k, axis in enumerate("xyz"):
        name = f"robot.body.position.{axis}"
        error = np.max(np.abs(np.array(positions)[:, k] - reference.signals[name]))
        assert error < reference.estimated_error[name] + 1e-9, name
    assert np.ptp(reference.signals["robot.body.position.z"]) > 0.02
    assert np.max(np.abs(reference.signals["contact1.normal_force"])) > 100.0


@pytest.mark.parametrize(("name", "stop"), [("drop_5cm", 0.3), ("landing_200m_point9_physical", 0.1)])
def test_the_estimate_bounds_the_true_error(name, stop):
    """True error: against a hundredth of the tolerance. Both begin with sliding and come to stick: the estimate holds
    because steps across a kink of the friction are cut short, wherever in a step it falls."""
    one = scenario(name, stop)
    times = np.linspace(0.0, stop, round(stop / 0.005) + 1)
    solution = solve(lambda: landing.problem(one), times)
    truth = integrate(lambda: landing.problem(one), times, 0.01 * solution.tolerance).signals
    for signal, values in solution.signals.items():
        if signal.endswith("status") or np.ptp(truth[signal]) < 1e-9 * (1.0 + np.max(np.abs(truth[signal]))):
            continue
        error = np.max(np.abs(values - truth[signal]))
        round_off = 1e-12 * np.max(np.abs(truth[signal]))
        if signal.endswith("touch_time"):  # rounding leaves a gap of 1e-15 m or none: fallen through in 1.4e-8 s
            round_off = np.sqrt(2.0 * 1e-15 / 9.8)
        assert error <= 1.1 * solution.estimated_error[signal] + round_off, signal
