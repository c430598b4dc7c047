"""The contact over a macro step: work, energy, order, stability, memory."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fmus.contact import places as at
from fmus.contact.law import LEFT, OPEN, SLIP, STICK, contact_wrench
from fmus.contact.module import Contact
from fmus.contact.path import PATH_SHAPE, motion_at, waveform_path
from fmus.contact.sampling import gauss_rule, sample_law
from fmus.module.variables import ModuleError

pytestmark = pytest.mark.portable

HALF = math.radians(50.0)
SIN = math.sin(HALF)
SEAT = 0.075 - 0.04 / math.tan(HALF) + 0.009 / SIN  # radial distance of first touch
TABLE = Contact.table


def write(contact, name, vector):
    i = TABLE.index[f"{name}.x"]
    contact.values[i : i + 3] = vector


def read(contact, name):
    if f"{name}.x" not in TABLE.index:
        return contact.values[TABLE.index[name]]
    i = TABLE.index[f"{name}.x"]
    return contact.values[i : i + 3].copy()


def seated(depth=0.0, **settings):
    """A contact at rest: a level cable along +Y at the origin, the wheel `depth` below first touch."""
    contact = Contact()
    TABLE.assign(contact.values, settings)
    for name in ("wheel.position", "wheel.position_mean"):
        write(contact, name, (0.0, 0.0, SEAT - depth))
    contact.initialize(0.0)
    return contact


def rule(m):
    return (*gauss_rule(m), np.zeros((m + 1, at.MOTION_SIZE)), np.zeros((m + 1, at.OUT_SIZE)))


def triples(rows, first):
    """The three columns from `first` on of the eight Gauss points."""
    return rows[:8, first : first + 3]


def random_inputs(rng, size=1e-3):
    """A start motion and inputs (48,) that differ from it by about `size`."""
    start = np.zeros(24)
    start[at.TANGENT + 1], start[at.CENTRE + 2], start[at.AXLE] = 1.0, SEAT - 3e-3, 1.0
    inputs = np.zeros(at.INPUT_SIZE)
    inputs[: at.MEANS] = start
    inputs[: at.MEANS] += size * rng.normal(size=24)
    for j, i in enumerate((0, 1, 2, 3, 4, 5, 12, 13, 14, 15, 16, 17)):
        inputs[24 + j] = 0.5 * (start[i] + inputs[i]) + 0.1 * size * rng.normal()
    inputs[at.ROTATION : at.ROTATION_MEAN] = size * rng.normal(size=3)
    turn = inputs[at.ROTATION : at.ROTATION_MEAN]
    inputs[at.ROTATION_MEAN : at.CURVATURE] = 0.5 * turn + 0.1 * size * rng.normal(size=3)
    return start, inputs


def rigid_inputs(rng, size=1e-3):
    """As `random_inputs`, but the axle turns with the wheel's (constant) angular velocity."""
    start, inputs = random_inputs(rng, size)
    turn = inputs[at.ROTATION : at.ROTATION_MEAN]
    inputs[at.ROTATION_MEAN : at.CURVATURE] = 0.5 * turn
    before, after = start[at.AXLE : at.CENTRE_RATE], inputs[at.AXLE : at.CENTRE_RATE]
    after[:] = Rotation.from_rotvec(turn).apply(before)
    middle = Rotation.from_rotvec(0.5 * turn).apply(before)
    inputs[at.MEANS + 9 : at.ROTATION] = (before + 4.0 * middle + after) / 6.0
    return start, inputs


def sampled(contact, start, inputs, h, m=8):
    """The law on the waveform path: nodes, weights, motions, samples, dissipation, stored energy before."""
    nodes, weights, increments, motions, samples = rule(m)
    path = np.zeros(PATH_SHAPE)
    waveform_path(start, inputs, path)
    end, first, z = np.zeros(24), np.zeros(at.OUT_SIZE), np.zeros(2)
    motion_at(path, 1.0, h, end)
    motion_at(path, 0.0, h, motions[0])
    contact_wrench(contact._prm, motions[0], z, first)
    status, lost = sample_law(contact._prm, path, h, nodes, weights, increments, end, np.zeros(3), z, motions, samples)
    assert status == 0
    return nodes, weights, motions, samples, lost, first[at.WALL_ENERGY] + first[at.BRISTLE_ENERGY]


@pytest.mark.parametrize("seed", range(5))
def test_work_booked_is_the_work_of_the_law(seed):
    """Translation of both bodies and rotation of the wheel: linear velocities are orthogonal to what is
    projected away. The tangent's rotation rate is linear but for the change of its length."""
    contact, h = seated(3e-3), 5e-3
    start, inputs = random_inputs(np.random.default_rng(seed))
    _, weights, motions, samples, *_ = sampled(contact, start, inputs, h)
    w = h * weights
    force, moment = triples(samples, at.WHEEL_FORCE), triples(samples, at.WHEEL_MOMENT)
    speeds = force * triples(motions, at.CENTRE_RATE), moment * triples(motions, at.TURN_RATE)
    law_wheel = w @ np.sum(speeds[0] + speeds[1], axis=1)
    tangent = triples(motions, at.TANGENT)
    turn = np.cross(tangent, triples(motions, at.TANGENT_RATE)) / np.sum(tangent**2, axis=1)[:, None]
    law_push = w @ np.sum(triples(samples, at.CABLE_FORCE) * triples(motions, at.POINT_RATE), axis=1)
    law_turn = w @ np.sum(triples(samples, at.CABLE_MOMENT) * turn, axis=1)

    contact.state[: at.MOTION_SIZE] = start
    contact.values[contact._INPUTS] = inputs
    contact.step(0.0, h)
    # round-off: some ulp of the positions (0.05 m) times the force; the turn: |t| changes by 1e-3
    turned = w @ np.abs(np.sum(triples(samples, at.CABLE_MOMENT) * turn, axis=1))
    roundoff = 1e-16 * np.max(np.abs(samples[:8, : at.NORMAL]))
    assert read(contact, "work_wheel") == pytest.approx(law_wheel, abs=roundoff)
    assert read(contact, "work_cable") == pytest.approx(law_push + law_turn, abs=1e-3 * turned)
    # translation alone: keep the tangent
    inputs[at.TANGENT : at.POINT_RATE] = inputs[at.MEANS + 3 : at.MEANS + 6] = start[at.TANGENT : at.POINT_RATE]
    _, _, motions, samples, *_ = sampled(contact, start, inputs, h)
    law_push = w @ np.sum(triples(samples, at.CABLE_FORCE) * triples(motions, at.POINT_RATE), axis=1)
    contact.initialize(0.0)
    contact.state[: at.MOTION_SIZE] = start
    contact.values[contact._INPUTS] = inputs
    contact.step(0.0, h)
    assert read(contact, "work_cable") == pytest.approx(law_push, abs=roundoff)


@pytest.mark.parametrize("friction", [0.0, 100.0, 0.1])
@pytest.mark.parametrize("law", ["hunt_crossley", "impact"])
def test_energy_balance_of_the_law_along_a_path(friction, law):
    """Work put in = rise of the elastic energy + dissipation; frictionless and sticking to the rule's
    accuracy, sliding to that of the rule at its kinks, which falls with the number of points."""
    contact, h, errors = seated(3e-3, friction_coefficient=friction, damping_law=law), 5e-3, []
    start, inputs = rigid_inputs(np.random.default_rng(3))
    for m in (8, 64):
        _, weights, motions, samples, lost, before = sampled(contact, start, inputs, h, m)
        v, turn = motions[:m, 6:9], np.cross(motions[:m, 3:6], motions[:m, 9:12])
        turn /= np.sum(motions[:m, 3:6] ** 2, axis=1)[:, None]
        power = samples[:m, 0:3] * v + samples[:m, 3:6] * turn
        power += samples[:m, 6:9] * motions[:m, 18:21] + samples[:m, 9:12] * motions[:m, 21:24]
        work = -h * weights @ power.sum(axis=1)
        after = samples[m, 25] + samples[m, 26]
        assert lost >= 0.0
        errors.append(abs(work - (after - before) - lost) / abs(work))
    assert errors[0] < (2e-5 if friction != 0.1 else 2e-2)
    assert errors[1] < (2e-5 if friction != 0.1 else 1e-3)


@pytest.mark.parametrize("n", [2, 8, 40])
def test_gauss_rule_integrates_between_its_nodes(n):
    """Exact for polynomials up to degree n - 1, and well conditioned."""
    nodes, weights, increments = gauss_rule(n)
    ends = np.append(nodes, 1.0)
    for degree in (0, n // 2, n - 1):
        integrals = np.cumsum(increments @ nodes**degree)
        np.testing.assert_allclose(integrals, ends ** (degree + 1) / (degree + 1), atol=1e-15 * n)
    np.testing.assert_allclose(increments.sum(axis=0), weights, atol=1e-15)


def coupled_step(contact, x, v, h, mass, load, find):
    """One implicit macro step of a free mass (the wheel, moving up and down) against the fixed cable.

    The mass is integrated exactly under F + Fdot (tau - h/2); force and slope are found by Newton's method.
    """
    saved = contact.values.copy(), contact.state.copy()

    def motion(force, rate):
        acceleration, jerk = (force - rate * h / 2 + load) / mass, rate / mass
        x1 = x + h * v + h**2 / 2 * acceleration + h**3 / 6 * jerk
        v1 = v + h * acceleration + h**2 / 2 * jerk
        return x1, v1, x + h / 2 * v + h**2 / 6 * acceleration + h**3 / 24 * jerk

    def answer(unknown):
        contact.values[:], contact.state[:] = saved
        x1, v1, mean = motion(*unknown)
        write(contact, "wheel.position", (0.0, 0.0, x1))
        write(contact, "wheel.position_mean", (0.0, 0.0, mean))
        write(contact, "wheel.velocity", (0.0, 0.0, v1))
        contact.step(0.0, h)
        return np.array([read(contact, "wheel.force")[2], read(contact, "wheel.force_rate")[2]])

    find[:] = newton(answer, find, 1e-7 * mass / h**2 * np.array([1.0, 10.0 / h]))
    return motion(*find)[:2]


def newton(answer, unknown, differences, tolerance=1e-12):
    """Solve answer(u) = u by Newton's method with finite differences."""
    for _ in range(30):
        residual = answer(unknown) - unknown
        size = len(unknown)
        jacobian = np.empty((size, size))
        for j in range(size):
            moved = unknown.copy()
            moved[j] += differences[j]
            jacobian[:, j] = (answer(moved) - moved - residual) / differences[j]
        change = np.linalg.solve(jacobian, -residual)
        unknown = unknown + change
        if np.max(np.abs(change / differences)) < tolerance * (1e6 + np.max(np.abs(unknown / differences))):
            break
    answer(unknown)
    return unknown


LINEAR = {
    "exponent": 1.0,
    "damping": 0.0,
    "friction_coefficient": 0.0,
    "max_contact_length": 1e-7,
    "reference_length": 2e-7,
    "stiffness": 1e6,
}
"""A point contact that is a linear spring of stiffness 2 k sin^2(theta/2) as long as it is closed."""


@pytest.mark.parametrize("omega_h", [0.1, 1.0, 3.0, 10.0, 1000.0])
def test_waveform_is_unconditionally_stable(omega_h):
    """The amplification matrix of an undamped linear oscillator has both eigenvalues on the unit circle.

    Columns are differences of motions moved so little that the contact stays closed within the step, at a tenth of the
    depth. Rounding of the wheel's place, half an ulp of 5 cm, moves the mass by (omega h)² times as much.
    """
    stiffness = 2.0 * 1e6 * SIN**2
    h = 5e-3
    mass = stiffness * h**2 / omega_h**2
    depth = 2e-3
    moved = 0.1 * depth / max(1.0, omega_h)
    columns = []
    for dx, dv in ((0.0, 0.0), (moved, 0.0), (0.0, moved * omega_h / h)):
        contact = seated(depth - dx, **LINEAR)
        find = np.array([stiffness * depth, 0.0])
        x, v = coupled_step(contact, SEAT - depth + dx, dv, h, mass, -stiffness * depth, find)
        columns.append(np.array([x - SEAT + depth, v * h / omega_h]) / moved)
    matrix = np.column_stack([columns[1] - columns[0], columns[2] - columns[0]])
    left = 1e-10 + 3.5e-18 * omega_h**2 / moved  # Newton's method stops at 1e-12
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(matrix)), 1.0, rtol=0.0, atol=left)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=left)


def fall(exchange_name, steps, settings, speed=0.3, time=0.04):
    """Throw 38 kg, resting 4 mm deep, down; return place and speed after `time`, the load, the contact."""
    depth = 4e-3
    contact = seated(depth, exchange=exchange_name, **settings)
    load, h = -read(contact, "wheel.force")[2], time / steps
    x, v, find = SEAT - depth, -speed, np.array([-load, 0.0])
    write(contact, "wheel.velocity", (0.0, 0.0, v))
    contact.state[at.CENTRE_RATE + 2] = v
    for _ in range(steps):
        x, v = coupled_step(contact, x, v, h, 38.0, load, find)
    return x, v, load, contact


IMPACT = {"damping_law": "impact", "damping_coefficient": 1e4, "damping_depth": 0.02}


@pytest.mark.parametrize(("name", "order"), [("waveform", 4.0), ("hermite", 4.0), ("point", 1.0)])
@pytest.mark.parametrize("law", [{}, IMPACT], ids=["hunt_crossley", "impact"])
def test_order_of_the_exchange(name, order, law):
    """Nonlinear damped contact against a tight ODE solution of the same law."""
    settings = {"friction_coefficient": 0.0} | law
    base = 8 if order > 1 else 128
    runs = [fall(name, n, settings) for n in (base, 2 * base)]
    prm, out = runs[0][3]._prm, np.zeros(at.OUT_SIZE)

    def motion(t, y):
        m = np.zeros(24)
        m[at.TANGENT + 1], m[at.CENTRE + 2], m[at.AXLE], m[at.CENTRE_RATE + 2] = 1.0, y[0], 1.0, y[1]
        contact_wrench(prm, m, np.zeros(2), out)
        return y[1], (out[at.WHEEL_FORCE + 2] + runs[0][2]) / 38.0

    exact = solve_ivp(motion, (0.0, 0.04), [SEAT - 4e-3, -0.3], rtol=1e-11, atol=1e-14, method="DOP853")
    errors = [abs(x - exact.y[0, -1]) for x, *_ in runs]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


def test_interface_keeps_energy_over_many_steps():
    """Undamped, frictionless: kinetic + potential + wall energy after 200 steps of a tenth of a period.

    The work booked is that of the exact mass under the force exchanged, and the law's along the quadratic;
    what is left is the rule along the cable (4e-6 of the wall energy, not adding up) and the Newton
    tolerance.
    """
    settings = {"damping": 0.0, "friction_coefficient": 0.0}
    x, v, load, contact = fall("waveform", 200, settings, time=2.0)
    rest = seated(4e-3, **settings)
    walls = read(contact, "strain_energy") - read(rest, "strain_energy")
    potential = -load * (x - (SEAT - 4e-3))
    kinetic, thrown = 0.5 * 38.0 * v**2, 0.5 * 38.0 * 0.3**2
    assert kinetic + potential + walls == pytest.approx(thrown, rel=2e-5)
    assert read(contact, "work_wheel") == pytest.approx(kinetic + potential - thrown, abs=1e-8 * thrown)
    assert read(contact, "dissipated_energy") == pytest.approx(0.0, abs=1e-12)


def bounce(h, speed):
    """Drop 38 kg at `speed` from 0.1 mm above a point contact; return it and the speed of departure."""
    contact = seated(-1e-4, max_contact_length=1e-7, reference_length=2e-7, friction_coefficient=0.0)
    contact.state[at.CENTRE_RATE + 2] = -speed
    x, v, find, steps = SEAT + 1e-4, -speed, np.zeros(2), 0
    while x < SEAT or steps < 2:
        x, v = coupled_step(contact, x, v, h, 38.0, 0.0, find)
        steps += 1
        assert steps < 100
    return contact, v


def test_bounce_through_the_exchange_has_order_4_and_balanced_books():
    """Hunt-Crossley: E v - ln(1 + E v), E = D sin(theta/2), is the same before and after, any n."""
    speed = 0.5
    before = SIN * speed - math.log(1 + SIN * speed)
    exact = brentq(lambda v: -SIN * v - math.log(1 - SIN * v) - before, 1e-9, speed)
    errors = []
    for h in (4e-3, 2e-3):
        contact, v = bounce(h, speed)
        lost = 0.5 * 38.0 * (speed**2 - v**2)
        errors.append(abs(v / exact - 1.0))
        assert read(contact, "work_wheel") == pytest.approx(-lost, rel=1e-11)
        assert read(contact, "dissipated_energy") == pytest.approx(lost, rel=1e-6)
    assert errors[1] < 2e-6
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


def slide(contact, way, steps, h=1e-3, direction=(0.0, 1.0, 0.0)):
    """Move the wheel by `way` at constant speed, all means consistent."""
    velocity = np.array(direction) * way / (steps * h)
    position = read(contact, "wheel.position")
    contact.state[at.CENTRE_RATE : at.TURN_RATE] = velocity
    for _ in range(steps):
        write(contact, "wheel.position_mean", position + velocity * h / 2)
        position = position + velocity * h
        write(contact, "wheel.position", position)
        write(contact, "wheel.velocity", velocity)
        move_cable(contact)
        contact.step(0.0, h)


def move_cable(contact):
    """The straight cable at rest along +Y: its point at cable.s."""
    for name in ("cable.position", "cable.position_mean"):
        write(contact, name, (0.0, read(contact, "cable.s"), 0.0))


@pytest.mark.parametrize("name", ["point", "waveform", "hermite"])
def test_sticks_without_creep_then_slides_at_the_limit(name):
    contact = seated(
        4e-3, exchange=name, damping=0.0, tangential_damping=0.0, max_contact_length=1e-3, reference_length=2e-3
    )
    limit = 0.7 * read(contact, "normal_force")
    reach = limit / 1e6
    slide(contact, 0.5 * reach, 10)
    assert read(contact, "status") == STICK
    held = None
    write(contact, "wheel.velocity", (0.0, 0.0, 0.0))
    write(contact, "wheel.position_mean", read(contact, "wheel.position"))
    contact.state[at.CENTRE_RATE : at.TURN_RATE] = 0.0
    for i in range(1000):
        move_cable(contact)
        contact.step(0.0, 1e-3)
        if i == 10:
            held = read(contact, "cable.force")
    assert held[1] == pytest.approx(0.5 * limit, rel=1e-9)
    np.testing.assert_allclose(read(contact, "cable.force"), held, rtol=1e-12)
    before = read(contact, "dissipated_energy")
    slide(contact, 3.0 * reach, 60)
    assert read(contact, "status") == SLIP
    assert read(contact, "cable.force")[1] == pytest.approx(limit, rel=1e-9)
    assert read(contact, "friction_force") == pytest.approx(limit, rel=1e-9)
    # 0.5 + 3 elongations of the bristle, one of them elastic
    assert read(contact, "dissipated_energy") - before == pytest.approx(2.5 * limit * reach, rel=1e-6)
    assert read(contact, "work_wheel") == pytest.approx(-(2.5 + 0.5) * limit * reach, rel=2e-2)


def test_sticks_on_a_slope():
    """38 kg g sin 5 deg along the cable, held by the bristle: after the transient, rest to 1 um/s."""
    contact, h, mass = seated(6e-3, max_contact_length=1e-3, reference_length=2e-3), 5e-3, 38.0
    load = mass * 9.8 * math.sin(math.radians(5.0))
    y = v = 0.0
    find, speeds = np.zeros(2), []
    for _ in range(300):
        saved = contact.values.copy(), contact.state.copy()

        def motion(force, rate, y=y, v=v):
            a, j = (force - rate * h / 2 + load) / mass, rate / mass
            return (
                y + h * v + h**2 / 2 * a + h**3 / 6 * j,
                v + h * a + h**2 / 2 * j,
                (y + h / 2 * v + h**2 / 6 * a + h**3 / 24 * j),
            )

        def answer(unknown, saved=saved, motion=motion):
            contact.values[:], contact.state[:] = saved
            y1, v1, mean = motion(*unknown)
            move_cable(contact)
            write(contact, "wheel.position", (0.0, y1, SEAT - 6e-3))
            write(contact, "wheel.position_mean", (0.0, mean, SEAT - 6e-3))
            write(contact, "wheel.velocity", (0.0, v1, 0.0))
            contact.step(0.0, h)
            return np.array([read(contact, "wheel.force")[1], read(contact, "wheel.force_rate")[1]])

        find = newton(answer, find, np.array([1e-4, 1e-2]))
        y, v = motion(*find)[:2]
        speeds.append(abs(v))
    assert max(speeds[-20:]) < 1e-6
    assert y == pytest.approx(load / 1e6, rel=1e-3)
    assert read(contact, "status") == STICK


@pytest.mark.parametrize("depth", [3e-3, -0.05])
def test_arc_length_follows_the_wheel(depth):
    """Closed and in the air: cable.s is the wheel's foot on the cable; the force does not jump."""
    contact = seated(depth, friction_coefficient=0.0, **{"initial.s": 0.0})
    forces = []
    for _ in range(20):
        slide(contact, 2e-3, 1)
        forces.append(read(contact, "cable.force"))
    assert read(contact, "cable.s") == pytest.approx(0.04, rel=1e-12)
    np.testing.assert_allclose(forces, forces[0] * np.ones((20, 3)), rtol=1e-9, atol=1e-9)


def test_arc_length_of_a_stretched_inclined_cable():
    contact = Contact()
    tangent = 1.01 * np.array([0.0, 0.8, 0.6])
    for name in ("cable.tangent", "cable.tangent_mean"):
        write(contact, name, tangent)
    TABLE.assign(contact.values, {"initial.s": 50.0, "wheel.position.y": 3.0, "wheel.position_mean.y": 3.0})
    contact.initialize(0.0)
    contact.step(0.0, 1e-3)
    wheel = read(contact, "wheel.position")
    assert read(contact, "cable.s") == pytest.approx(50.0 + wheel @ tangent / 1.01**2, rel=1e-14)


def test_refresh_is_the_point_law_and_leaves_the_state():
    contact = seated(3e-3, exchange="point")
    write(contact, "wheel.position", (1e-5, 2e-5, SEAT - 3.1e-3))
    write(contact, "wheel.velocity", (1e-3, 0.0, -1e-2))
    write(contact, "wheel.rotation", (1e-4, 0.0, 0.0))
    state = contact.state.copy()
    contact.refresh()
    np.testing.assert_array_equal(contact.state, state)
    before = contact.values.copy()
    contact.step(0.0, 1e-3)
    for name in ("cable.force", "cable.moment", "wheel.force", "wheel.moment", "normal_force"):
        i = TABLE.indices([f"{name}.{a}" for a in "xyz"] if name != "normal_force" else [name])
        np.testing.assert_array_equal(contact.values[i], before[i])
    # inputs that stay are no motion: neither the moved cable point nor the old rotation is counted again
    force = read(contact, "cable.force")
    contact.refresh()
    np.testing.assert_allclose(read(contact, "cable.force"), force, rtol=1e-13)


@pytest.mark.parametrize("name", ["point", "waveform", "hermite"])
def test_copying_values_and_state_back_replays_bit_for_bit(name):
    contact = seated(3e-3, exchange=name)
    slide(contact, 1e-3, 5)
    saved = contact.values.copy(), contact.state.copy()
    slide(contact, 1e-3, 5)
    first = contact.values.copy(), contact.state.copy()
    slide(contact, -3e-3, 5)
    contact.values[:], contact.state[:] = saved
    slide(contact, 1e-3, 5)
    np.testing.assert_array_equal(contact.values, first[0])
    np.testing.assert_array_equal(contact.state, first[1])


def test_left_the_groove_stays_left():
    """Pulled sideways out of the groove: no force any more, also when it comes back; the books balance."""
    contact = seated(1e-3, stiffness=1e6)
    stored = read(contact, "strain_energy")
    slide(contact, 0.045, 45, direction=(1.0, 0.0, 0.0))
    assert read(contact, "status") == LEFT
    work = read(contact, "work_cable") + read(contact, "work_wheel")
    assert stored - work == pytest.approx(read(contact, "dissipated_energy"), rel=1e-3)
    slide(contact, -0.045, 45, direction=(1.0, 0.0, 0.0))
    assert read(contact, "status") == LEFT
    assert not read(contact, "cable.force").any() and not read(contact, "wheel.force").any()


def test_jump_up_is_open_and_passing_through_the_axle_is_left():
    contact = seated(1e-3)
    slide(contact, 0.05, 10, direction=(0.0, 0.0, 1.0))
    assert read(contact, "status") == OPEN
    slide(contact, -0.05, 10, direction=(0.0, 0.0, 1.0))
    assert read(contact, "status") in (STICK, SLIP)
    slide(contact, -0.2, 20, direction=(0.0, 0.0, 1.0))
    assert read(contact, "status") == LEFT


@pytest.mark.parametrize(
    ("name", "value", "cure"),
    [
        ("stiffness", -1.0, "greater than 0"),
        ("damping", -1.0, "at least 0"),
        ("exponent", 0.5, "at least 1; a smaller one makes the wall infinitely stiff"),
        ("groove_angle", 100.0, "degrees"),
        ("wheel_radius", 0.02, "enlarge"),
        ("initial.s", math.inf, "finite"),
    ],
)
def test_bad_parameters_are_named(name, value, cure):
    contact = Contact()
    TABLE.assign(contact.values, {name: value})
    with pytest.raises(ModuleError, match=f"{name}.*{cure}"):
        contact.initialize(0.0)


def test_bad_motion_is_named():
    contact = seated()
    write(contact, "wheel.position", (math.nan, 0.0, 0.0))
    with pytest.raises(ModuleError, match=r"t = 0.001 s.*not finite"):
        contact.step(0.0, 1e-3)


def test_contract_names_are_there():
    """The names other components connect to; vectors by component."""
    for side, names in (
        ("cable", "position tangent velocity tangent_rate position_mean tangent_mean curvature"),
        ("wheel", "position axle velocity angular_velocity position_mean axle_mean rotation rotation_mean"),
    ):
        for name in names.split():
            assert all(TABLE[f"{side}.{name}.{axis}"].causality == "input" for axis in "xyz")
        for name in ("force", "moment", "force_rate", "moment_rate"):
            assert all(TABLE[f"{side}.{name}.{axis}"].causality == "output" for axis in "xyz")
    assert TABLE["cable.s"].discrete and not TABLE["cable.s"].feedthrough
    assert "wheel.rotation.x" in TABLE["cable.force.x"].feedthrough
    assert "wheel.position_mean.x" not in TABLE["cable.force.x"].feedthrough


def test_hermite_does_without_means_and_rotation():
    """A wheel turns about its axle and tells its angular velocity only: the slip is rho * omega * t."""
    contact = seated(4e-3, exchange="hermite", max_contact_length=1e-3, reference_length=2e-3, tangential_damping=0.0)
    omega = np.array([1e-2, 0.0, 0.0])
    write(contact, "wheel.angular_velocity", omega)
    contact.state[at.TURN_RATE : at.MOTION_SIZE] = omega
    for _ in range(5):
        contact.step(0.0, 1e-3)
    # the wheel's lowest point moves by omega x (-z) = +y: the cable is dragged along
    assert read(contact, "cable.force")[1] > 0.0
    stored = 0.5 * 1e6 * ((SEAT - 4e-3) * 1e-2 * 5e-3) ** 2
    assert read(contact, "strain_energy") == pytest.approx(stored + walls_energy(contact), rel=1e-9)


def walls_energy(contact):
    out = np.zeros(at.OUT_SIZE)
    contact_wrench(contact._prm, contact.values[contact._INPUTS][:24].copy(), np.zeros(2), out)
    return out[at.WALL_ENERGY]


def test_step_length_is_checked():
    with pytest.raises(ModuleError, match="macro step"):
        seated().step(0.0, 0.0)
