"""The robot against closed forms, invariants and an independent integration by SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from fmus.kernels.rotations import quaternion_rate
from fmus.module.variables import ModuleError
from fmus.robot import rigid_body
from fmus.robot.module import Robot, body_parameters, initial_state, robot_table

pytestmark = pytest.mark.portable

EPS = np.finfo(float).eps
GENERAL = {
    "mass": 7.0,
    "inertia.xx": 1.1,
    "inertia.yy": 1.7,
    "inertia.zz": 2.3,
    "inertia.xy": 0.12,
    "inertia.xz": -0.2,
    "inertia.yz": 0.07,
    "wheel[1].inertia": 0.05,
    "wheel[2].braked": False,
    "wheel[2].inertia": 0.2,
    "initial.roll": 0.3,
    "initial.pitch": -0.4,
    "initial.yaw": 1.2,
    **dict(zip(("center_of_mass.x", "center_of_mass.y", "center_of_mass.z"), (0.05, -0.1, -0.2), strict=True)),
}
"""A body without any symmetry: wheel 1 braked, wheel 2 free on an oblique axle."""


def components(name, vector):
    return {f"{name}.{axis}": float(value) for axis, value in zip("xyz", vector, strict=True)}


GENERAL |= components("wheel[1].mount", (0.3, 0.1, 0.4)) | components("wheel[2].mount", (-0.2, 0.5, 0.1))
GENERAL |= components("wheel[2].axle_direction", (1.0, 2.0, -0.5))
GENERAL |= components("initial.position", (0.4, 80.0, -1.5)) | components("initial.velocity", (0.5, -0.2, 0.1))
GENERAL |= components("initial.angular_velocity", (0.9, -1.4, 1.1))

LOADS = {"thrust": 50.0, "thrust_rate": 90.0} | components("torque", (1.0, -2.0, 0.5))
LOADS |= components("torque_rate", (4.0, 3.0, -2.0))
LOADS |= components("wheel[1].force", (10.0, -5.0, 40.0)) | components("wheel[1].force_rate", (100.0, 60.0, -200.0))
LOADS |= components("wheel[1].moment", (1.0, 3.0, -2.0)) | components("wheel[1].moment_rate", (20.0, -30.0, 10.0))
LOADS |= components("wheel[2].force", (-4.0, 6.0, 20.0)) | components("wheel[2].force_rate", (50.0, -80.0, 30.0))
LOADS |= components("wheel[2].moment", (0.5, -1.0, 1.5)) | components("wheel[2].moment_rate", (-9.0, 12.0, 7.0))
LOADS |= {"wheel[2].drive_torque": 0.8, "wheel[2].drive_torque_rate": -1.5}


def make(n_wheels=1, /, **settings):
    """Return an initialised robot; keys are written with the names of the table."""
    robot = Robot(n_wheels)
    robot.table.assign(robot.values, settings)
    robot.initialize(0.0)
    return robot


def scalar(robot, name):
    return robot.values[robot.table.index[name]]


def vector(robot, name):
    return robot.values[robot.table.indices(f"{name}.{axis}" for axis in "xyz")]


def run(robot, stop, h):
    for i in range(round(stop / h)):
        robot.step(i * h, h)


def angular_momentum(robot):
    """Return the inertial angular momentum about G, from the state and SciPy's rotations."""
    rotation = Rotation.from_quat(robot.state[3:7], scalar_first=True)
    w_B = rotation.inv().apply(robot.state[10:13])
    return rotation.apply(rigid_body.angular_momentum_B(robot._prm, robot.state, *w_B))


# An independent integration: momenta instead of velocities, a rotation matrix instead of a quaternion.


class Reference:
    """The same robot as balances of momentum, integrated by DOP853 at 1e-13.

    y : (46,) x_G, R_IB, linear and angular momentum, axial momentum of wheel 2, work of control and wheels,
    integrals of both wheels' (position, axle), of their angular velocities, and of the latter's integrals
    """

    def __init__(self, settings, loads):
        values = {v.name: v.start for v in robot_table(2).variables} | settings | loads
        self.values = values
        self.J = np.array([[values[f"inertia.{''.join(sorted(a + b))}"] for a in "xyz"] for b in "xyz"])
        self.G = self.get("center_of_mass")
        self.mounts = [self.get(f"wheel[{k}].mount") - self.G for k in (1, 2)]
        axle = self.get("wheel[2].axle_direction")
        self.axle, self.spin_inertia = axle / np.linalg.norm(axle), values["wheel[2].inertia"]
        self.core = np.linalg.inv(self.J - self.spin_inertia * np.outer(self.axle, self.axle))

    def get(self, name):
        return np.array([self.values[f"{name}.{axis}"] for axis in "xyz"])

    def velocities(self, R, L, axial):
        """Return w_IB and spin rate from the momenta: L_B = (J - I a aᵀ) w_B + (axial momentum) a."""
        w_B = self.core @ (R.T @ L - axial * self.axle)
        return R @ w_B, axial / self.spin_inertia - self.axle @ w_B

    def rates(self, since_middle, y):
        R, p, L, axial = y[3:12].reshape(3, 3), y[12:15], y[15:18], y[18]
        w, spin = self.velocities(R, L, axial)
        v = p / self.values["mass"]
        lift = self.values["thrust"] + since_middle * self.values["thrust_rate"]
        drive = self.values["wheel[2].drive_torque"] + since_middle * self.values["wheel[2].drive_torque_rate"]
        thrust, torque = R @ [0, 0, lift], R @ (self.get("torque") + since_middle * self.get("torque_rate"))
        force, moment = thrust - [0, 0, 9.8 * self.values["mass"]], np.cross(-R @ self.G, thrust) + torque
        v_b = v + np.cross(w, -R @ self.G)
        power = [thrust @ v_b + torque @ w + drive * spin]
        poses, turns, running = [], [], []
        for k, arm in enumerate(self.mounts, start=1):
            F = self.get(f"wheel[{k}].force") + since_middle * self.get(f"wheel[{k}].force_rate")
            M = self.get(f"wheel[{k}].moment") + since_middle * self.get(f"wheel[{k}].moment_rate")
            force, moment = force + F, moment + M + np.cross(R @ arm, F)
            w_wheel = w + (k == 2) * spin * (R @ self.axle)
            power.append(F @ (v + np.cross(w, R @ arm)) + M @ w_wheel)
            poses += [y[0:3] + R @ arm, R @ (self.axle if k == 2 else np.array([1.0, 0.0, 0.0]))]
            turns.append(w_wheel)
            running.append(y[34 + 3 * (k - 1) : 37 + 3 * (k - 1)])
        axial_rate = (R @ self.axle) @ M + drive
        turn = np.cross(w, R, axisb=0, axisc=0)
        return np.concatenate([v, turn.ravel(), force, moment, [axial_rate], power, *poses, *turns, *running])

    def solve(self, H):
        """Return the outputs after one macro step, by name."""
        R = Rotation.from_euler("ZYX", [self.values[f"initial.{a}"] for a in ("yaw", "pitch", "roll")]).as_matrix()
        w, v_b = self.get("initial.angular_velocity"), self.get("initial.velocity")
        v = v_b + np.cross(w, R @ self.G)
        L = R @ self.J @ R.T @ w
        axial = self.spin_inertia * (R @ self.axle) @ w
        start = np.concatenate([self.get("initial.position") + R @ self.G, R.ravel(), self.values["mass"] * v, L])
        y0 = np.concatenate([start, [axial], np.zeros(3 + 12 + 6 + 6)])
        y = solve_ivp(self.rates, (-H / 2, H / 2), y0, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        return self.outputs(y, H)

    def outputs(self, y, H):
        R = y[3:12].reshape(3, 3)
        w, spin = self.velocities(R, y[15:18], y[18])
        v = y[12:15] / self.values["mass"]
        found = {"body.position": y[0:3] - R @ self.G, "body.velocity": v - np.cross(w, R @ self.G)}
        found |= {"body.angular_velocity": w, "control_work": y[19]}
        found["angles"] = Rotation.from_matrix(R).as_euler("ZYX")[::-1]
        for k, arm in enumerate(self.mounts, start=1):
            axle = R @ (self.axle if k == 2 else [1.0, 0.0, 0.0])
            found |= {f"wheel[{k}].position": y[0:3] + R @ arm, f"wheel[{k}].axle": axle}
            found[f"wheel[{k}].velocity"] = v + np.cross(w, R @ arm)
            found[f"wheel[{k}].angular_velocity"] = w + (k == 2) * spin * axle
            found[f"wheel[{k}].position_mean"] = y[22 + 6 * (k - 1) :][:3] / H
            found[f"wheel[{k}].axle_mean"] = y[25 + 6 * (k - 1) :][:3] / H
            found[f"wheel[{k}].rotation"] = y[34 + 3 * (k - 1) :][:3]
            found[f"wheel[{k}].rotation_mean"] = y[40 + 3 * (k - 1) :][:3] / H
            found[f"wheel[{k}].work"] = y[19 + k]
        return found


@pytest.fixture(scope="module")
def one_macro_step():
    """Outputs of one macro step of 0.4 s: the reference's, and ours with 32, 64 and 128 inner steps."""
    H = 0.4
    expected = Reference(GENERAL, LOADS).solve(H)
    ours = []
    for n in (32, 64, 128):
        robot = make(2, **GENERAL, integration_step=H / n)
        robot.table.assign(robot.values, LOADS)
        robot.step(0.0, H)
        ours.append(robot)
    return expected, ours


SIGNALS = ["angles", "control_work"] + [f"body.{s}" for s in ("position", "velocity", "angular_velocity")]
SIGNALS += [
    f"wheel[{k}].{s}"
    for k in (1, 2)
    for s in ("position", "axle", "velocity", "angular_velocity", "position_mean", "axle_mean", "rotation",
              "rotation_mean", "work")
]  # fmt: skip


def signal(robot, name):
    if name == "angles":
        return np.array([scalar(robot, a) for a in ("roll", "pitch", "yaw")])
    return scalar(robot, name) if name in robot.table.index else vector(robot, name)


@pytest.mark.parametrize("name", SIGNALS)
def test_order_four_under_every_load(one_macro_step, name):
    """Thrust, torque, drive, forces and moments with slopes, a free oblique wheel: all of order 4.

    Some signals come close to their slope only at the finest pair, where errors (1e-10 and more) are still
    clear of the reference's own (1e-12 to 1e-11).
    """
    expected, ours = one_macro_step
    errors = np.array([np.linalg.norm(signal(robot, name) - expected[name]) for robot in ours])
    order = np.log2(errors[-2] / errors[-1])
    assert abs(order - 4.0) <= 0.2, (errors, order)


def test_work_booked_is_energy_gained(one_macro_step):
    """Energy after minus energy before is the work of wheels and control, to the integration's order."""
    before = make(2, **GENERAL)
    residuals = []
    for robot in one_macro_step[1]:
        gained = sum(scalar(robot, e) - scalar(before, e) for e in ("kinetic_energy", "gravitational_energy"))
        booked = sum(scalar(robot, w) for w in ("wheel[1].work", "wheel[2].work", "control_work"))
        residuals.append(abs(gained - booked))
    assert np.log2(residuals[-2] / residuals[-1]) > 3.8, residuals
    assert residuals[-1] < 1e-7 * abs(gained)


# Closed forms


def flip(robot_step, stop=100.0):
    """Return the largest error of w_B against the elliptic-function solution, and the finished robot.

    Landau & Lifshitz, Mechanics, §37, with I1 < I2 < I3 and M² > 2 E I2. The motion passes close to the
    intermediate axis (k² = 0.99) and flips about it every half period.
    """
    inertia, start = np.array([1.0, 2.0, 2.6]), np.array([1.0, 0.0, 0.0])
    k2 = 0.99
    # k² = (I2 - I1) I1 w1² / ((I3 - I2) I3 w3²) for a start with w2 = 0.
    start[2] = math.sqrt((inertia[1] - inertia[0]) * inertia[0] / ((inertia[2] - inertia[1]) * inertia[2] * k2))
    settings = {f"inertia.{a}{a}": value for a, value in zip("xyz", inertia, strict=True)}
    settings |= components("initial.angular_velocity", start)
    robot = make(1, **settings, gravity=0.0, integration_step=robot_step)
    E2, M2 = inertia @ start**2, (inertia * start) @ (inertia * start)
    scale = math.sqrt((inertia[2] - inertia[1]) * (M2 - E2 * inertia[0]) / np.prod(inertia))
    largest = 0.0
    for i in range(round(stop / 0.1)):
        robot.step(0.1 * i, 0.1)
        sn, cn, dn, _ = ellipj(scale * 0.1 * (i + 1), k2)
        w2 = math.sqrt((E2 * inertia[2] - M2) / (inertia[1] * (inertia[2] - inertia[1])))
        exact = np.array([start[0] * cn, w2 * sn, start[2] * dn])
        w_B = Rotation.from_quat(robot.state[3:7], scalar_first=True).inv().apply(robot.state[10:13])
        largest = max(largest, np.abs(w_B - exact).max())
    return largest, robot


def test_torque_free_asymmetric_body():
    """Over 100 s: fourth order against the exact solution; energy and momentum stay to round-off."""
    coarse, _ = flip(0.01)
    fine, _ = flip(0.005)
    assert abs(np.log2(coarse / fine) - 4.0) <= 0.2
    largest, robot = flip(1e-3)
    assert largest < 2.0 * fine / 5**4 + 1e-10  # order 4 from h = 0.005; 1e5 steps of round-off
    start = make(1, **{v: scalar(robot, v) for v in robot.table.names("parameter") if v != "n_wheels"})
    energy, energy_0 = scalar(robot, "kinetic_energy"), scalar(start, "kinetic_energy")
    assert abs(energy / energy_0 - 1.0) < 1e-12
    L, L_0 = angular_momentum(robot), angular_momentum(start)
    assert np.linalg.norm(L - L_0) < 1e-12 * np.linalg.norm(L_0)


def hung_up(prm, state):
    """Return the accelerations (6,) of the body with wheel 1 held at a fixed point by a force."""

    def respond(force):
        loads = np.concatenate([np.zeros(4), force, np.zeros(4)])
        F, M, torque, out, motion = np.zeros(3), np.zeros(3), np.zeros(4), np.zeros(10), np.zeros(12)
        rigid_body.resultants(prm, state, loads, F, M, torque)
        rigid_body.accelerations(prm, state, F, M, torque, out)
        rigid_body.wheel_motion(prm, state, 0, motion)
        arm, w = motion[:3] - state[:3], state[10:13]
        return out, out[:3] + np.cross(out[3:6], arm) + np.cross(w, np.cross(w, arm))

    at_rest = respond(np.zeros(3))[1]
    compliance = np.column_stack([respond(unit)[1] - at_rest for unit in np.eye(3)])
    return respond(np.linalg.solve(compliance, -at_rest))[0]


@pytest.mark.parametrize("amplitude", [0.01, 1.0, 2.5])
def test_heavy_pendulum_period(amplitude):
    """Quarter period K(sin²(amplitude/2)) sqrt(I_P / (m g l)) about the fixed wheel centre."""
    arm, settings = 0.3152, {"mass": 38.0, "inertia.xx": 5.42, "initial.roll": amplitude}
    robot = Robot(1)
    robot.table.assign(robot.values, settings)
    prm, start = body_parameters(robot.values, robot.table), initial_state(robot.values, robot.table)

    def rates(_, y):
        state = np.concatenate([y, np.zeros(8)])
        dq = np.zeros(4)
        quaternion_rate(state[3:7], *state[10:13], dq)
        return np.concatenate([state[7:10], dq, hung_up(prm, state)[:6]])

    def bottom(_, y):
        return y[4]  # x component of the quaternion: half the roll's sine

    bottom.terminal = True
    found = solve_ivp(rates, (0.0, 10.0), start[:13], "RK45", rtol=1e-9, atol=1e-11, events=bottom)
    period = ellipk(math.sin(amplitude / 2) ** 2) * math.sqrt((5.42 + 38.0 * arm**2) / (38.0 * 9.8 * arm))
    assert found.t_events[0][0] == pytest.approx(period, rel=1e-7)


def test_free_fall():
    """A parabola, and its mean, which order-4 quadrature gives exactly."""
    robot = make(1, **components("initial.velocity", (1.0, 2.0, 3.0)))
    run(robot, 1.0, 0.1)
    np.testing.assert_allclose(vector(robot, "body.position"), [1.0, 2.0, 3.0 - 4.9], atol=1e-12)
    np.testing.assert_allclose(vector(robot, "body.velocity"), [1.0, 2.0, 3.0 - 9.8], atol=1e-12)
    mean = 3.0 * 0.95 - 4.9 * (1.0 - 0.9**3) / 0.3  # of 3 t - 4.9 t² over 0.9 … 1.0
    assert vector(robot, "wheel[1].position_mean")[2] == pytest.approx(0.2152 + mean, abs=1e-12)
    fallen = scalar(robot, "kinetic_energy") + scalar(robot, "gravitational_energy")
    assert fallen == pytest.approx(38.0 * (7.0 - 9.8 * 0.1), rel=1e-12)  # m v²/2 + m g z_G at the start


def test_thrust_and_torque_by_hand():
    """Thrust 500 N on 38 kg; 2 N m about z on 8.5 kg m², started level and at rest."""
    robot = make(1)
    robot.table.assign(robot.values, {"thrust": 500.0, "torque.z": 2.0})
    run(robot, 1.0, 0.1)
    assert vector(robot, "body.position")[2] == pytest.approx((500.0 / 38.0 - 9.8) / 2, abs=1e-12)
    assert scalar(robot, "yaw") == pytest.approx(2.0 / 8.5 / 2, abs=1e-12)
    lifted, turned = 500.0 * (500.0 / 38.0 - 9.8) / 2, 2.0 * 2.0 / 8.5 / 2
    assert scalar(robot, "control_work") == pytest.approx(lifted + turned, rel=1e-12)


def test_thrust_acts_at_b():
    """G lies 0.2 m along x from b: thrust T gives the moment 0.2 T about y."""
    robot = make(1, **components("center_of_mass", (0.2, 0.0, 0.0)))
    force, moment, torque = np.zeros(3), np.zeros(3), np.zeros(4)
    loads = np.concatenate([[100.0], np.zeros(10)])
    rigid_body.resultants(robot._prm, robot.state, loads, force, moment, torque)
    np.testing.assert_allclose(moment, [0.0, 20.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(force, [0.0, 0.0, 100.0 - 38.0 * 9.8], atol=1e-12)


def test_wheel_drive_by_hand():
    """Torque tau on a free wheel at the body's own axis: body turns by -tau/(J - I), nothing turns in sum."""
    free = {"wheel[1].braked": False, "wheel[1].inertia": 0.1, "gravity": 0.0}
    robot = make(1, **free)
    robot.table.assign(robot.values, {"wheel[1].drive_torque": 0.6})
    run(robot, 2.0, 0.1)
    body, wheel = -0.6 * 2.0 / (5.42 - 0.1), 0.6 * 2.0 / 0.1
    assert vector(robot, "body.angular_velocity")[0] == pytest.approx(body, rel=1e-12)
    assert vector(robot, "wheel[1].angular_velocity")[0] == pytest.approx(wheel, rel=1e-12)
    assert np.abs(angular_momentum(robot)).max() < 1e-12
    assert scalar(robot, "control_work") == pytest.approx(scalar(robot, "kinetic_energy"), rel=1e-12)


def test_a_braked_wheel_ignores_its_drive():
    robot = make(1, gravity=0.0)
    robot.table.assign(robot.values, {"wheel[1].drive_torque": 5.0})
    run(robot, 0.1, 0.01)
    assert scalar(robot, "kinetic_energy") == 0.0 and scalar(robot, "control_work") == 0.0


def test_drives_keep_the_angular_momentum():
    """Inner torques and gyroscopic coupling change nothing in sum; what is left is of order 4."""
    drifts = []
    for inner in (0.02, 0.01):
        robot = make(2, **GENERAL | {"gravity": 0.0, "wheel[1].braked": False}, integration_step=inner)
        start = angular_momentum(robot)
        robot.table.assign(robot.values, {"wheel[1].drive_torque": 0.5, "wheel[2].drive_torque": -0.7})
        run(robot, 4.0, 0.04)
        drifts.append(np.linalg.norm(angular_momentum(robot) - start) / np.linalg.norm(start))
    assert drifts[1] < 1e-7 and np.log2(drifts[0] / drifts[1]) > 3.8, drifts


# Invariance


WHEEL_SIGNALS = [f"wheel[{k}].{s}" for k in (1, 2) for s in ("position", "axle", "velocity", "position_mean")]


@settings(deadline=None, max_examples=20)
@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array))
def test_reference_point_does_not_matter(shift):
    """Another b, with mounts, centre of mass and initial motion moved along, moves the wheels alike."""
    moved = dict(GENERAL)
    R = Rotation.from_euler("ZYX", [GENERAL[f"initial.{a}"] for a in ("yaw", "pitch", "roll")])
    w = np.array([GENERAL[f"initial.angular_velocity.{axis}"] for axis in "xyz"])
    changes = {name: -shift for name in ("center_of_mass", "wheel[1].mount", "wheel[2].mount")}
    changes |= {"initial.position": R.apply(shift), "initial.velocity": np.cross(w, R.apply(shift))}
    for name, change in changes.items():
        for axis, value in zip("xyz", change, strict=True):
            moved[f"{name}.{axis}"] += value
    robots = [make(2, **chosen) for chosen in (GENERAL, moved)]
    for robot in robots:
        robot.table.assign(robot.values, LOADS | {"thrust": 0.0, "thrust_rate": 0.0})  # thrust acts at b
        run(robot, 0.2, 0.02)
    for name in WHEEL_SIGNALS:
        np.testing.assert_allclose(vector(robots[0], name), vector(robots[1], name), rtol=0, atol=1e-12)


@settings(deadline=None, max_examples=20)
@given(st.floats(-3.0, 3.0))
def test_turned_about_the_vertical(angle):
    """All turned about Z, loads too: the motion is turned with them."""
    turn = Rotation.from_rotvec([0.0, 0.0, angle])
    turned, loads = dict(GENERAL), dict(LOADS)
    turned["initial.yaw"] += angle
    for place, names in ((turned, ("position", "velocity", "angular_velocity")), (loads, ())):
        wanted = [f"initial.{n}" for n in names] or [
            f"wheel[{k}].{n}" for k in (1, 2) for n in ("force", "force_rate", "moment", "moment_rate")
        ]
        for name in wanted:
            place |= components(name, turn.apply([place[f"{name}.{axis}"] for axis in "xyz"]))
    robots = [make(2, **GENERAL), make(2, **turned)]
    for robot, applied in zip(robots, (LOADS, loads), strict=True):
        robot.table.assign(robot.values, applied)
        run(robot, 0.2, 0.02)
    for name in WHEEL_SIGNALS:
        np.testing.assert_allclose(turn.apply(vector(robots[0], name)), vector(robots[1], name), rtol=0, atol=2e-12)


# State, angles, errors


def test_replay_is_bit_identical():
    robot = make(2, **GENERAL)
    robot.table.assign(robot.values, LOADS)
    run(robot, 0.05, 0.01)
    values, state = robot.values.copy(), robot.state.copy()
    run(robot, 0.1, 0.01)
    after = robot.values.copy(), robot.state.copy()
    robot.values[:], robot.state[:] = values, state
    run(robot, 0.1, 0.01)
    assert np.array_equal(robot.values, after[0]) and np.array_equal(robot.state, after[1])


def test_refresh_repeats_the_outputs():
    robot = make(2, **GENERAL)
    robot.table.assign(robot.values, LOADS)
    robot.step(0.0, 0.01)
    before = robot.values.copy()
    robot.values[robot.table.indices(robot.table.names("output"))] = np.nan
    robot.refresh()
    assert np.array_equal(robot.values, before)


def test_means_after_initialisation_are_the_values():
    robot = make(2, **GENERAL)
    for k in (1, 2):
        for name in ("position", "axle"):
            now, mean = vector(robot, f"wheel[{k}].{name}"), vector(robot, f"wheel[{k}].{name}_mean")
            assert np.array_equal(now, mean)
        assert not vector(robot, f"wheel[{k}].rotation").any()
        assert not vector(robot, f"wheel[{k}].rotation_mean").any()


def test_axles_stay_orthonormal():
    """After 1e5 steps of a tumbling body: a few rounding errors, for each step scales the quaternion."""
    axles = components("wheel[2].axle_direction", (0.0, 1.0, 0.0))
    robot = make(2, **axles, **components("initial.angular_velocity", (3.0, -2.0, 1.0)), gravity=0.0)
    run(robot, 100.0, 0.5)
    a, b = vector(robot, "wheel[1].axle"), vector(robot, "wheel[2].axle")
    assert max(abs(a @ b), abs(a @ a - 1.0), abs(b @ b - 1.0)) < 8 * EPS


@pytest.mark.parametrize("angle", ["roll", "yaw"])
def test_angles_do_not_jump(angle):
    """Ten seconds at 3 rad/s are 30 rad, with macro steps of more than a whole turn as well."""
    axis = {"roll": "x", "yaw": "z"}[angle]
    robot = make(1, **{f"initial.angular_velocity.{axis}": 3.0})
    run(robot, 10.0, 2.5)
    assert scalar(robot, angle) == pytest.approx(30.0, abs=1e-9)
    assert vector(robot, "wheel[1].rotation")["xyz".index(axis)] == pytest.approx(7.5, abs=1e-12)


def test_whole_number_of_inner_steps():
    """(0.1 + 0.2) / 0.1 exceeds 3 by round-off: three inner steps all the same, not four."""
    robots = [make(2, **GENERAL, integration_step=inner) for inner in (0.1, 0.1001)]
    for robot in robots:
        robot.step(0.0, 0.1 + 0.2)
    assert np.array_equal(robots[0].state, robots[1].state)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"mass": -1.0}, "robot: mass = -1 kg must be greater than 0"),
        ({"mass": math.nan}, "mass = nan kg is not a finite number"),
        ({"inertia.xx": -5.0}, "inertia.xx = -5 kg.m2 must be greater than 0"),
        ({"inertia.xy": 6.0}, "must be positive"),
        ({"inertia.zz": 20.0}, "those of no body"),
        ({"integration_step": 0.0}, "integration_step = 0 s must be greater than 0"),
        ({"wheel[1].axle_direction.x": 0.0}, r"wheel\[1\].axle_direction: has no length"),
        (
            {"wheel[1].braked": False, "wheel[1].inertia": 0.0},
            r"wheel\[1\].inertia = 0 kg.m2 of a free wheel must be greater than 0",
        ),
        ({"wheel[1].braked": False, "wheel[1].inertia": 9.0}, "exceeds the whole robot's"),
        ({"n_wheels": 2}, "n_wheels: this model has 1"),
    ],
)
def test_bad_parameters_are_refused(settings, message):
    with pytest.raises(ModuleError, match=message):
        make(1, **settings)


@pytest.mark.parametrize("n_wheels", [0, 5])
def test_number_of_wheels(n_wheels):
    with pytest.raises(ModuleError, match="choose 1 to 4"):
        Robot(n_wheels)


@pytest.mark.parametrize(
    ("inputs", "h", "message"),
    [
        ({"thrust": math.nan}, 0.01, "input thrust is not a finite number"),
        ({"torque.x": 1e9}, 0.01, "turns by more than 1 rad"),
        ({"wheel[1].force.z": 1e307}, 0.01, "no longer finite"),
        ({}, 0.0, "macro step 0 s is not positive"),
    ],
)
def test_a_failed_step_says_why_and_changes_no_state(inputs, h, message):
    robot = make(1)
    robot.table.assign(robot.values, inputs)
    before = robot.state.copy()
    with pytest.raises(ModuleError, match=message):
        robot.step(1.0, h)
    assert np.array_equal(robot.state, before)
