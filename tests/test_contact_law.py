"""The contact law at one instant: closed forms, an independent quadrature, invariants."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, quad_vec, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fmus.contact import places as at
from fmus.contact.law import LEFT, NODES, OK, OPEN, SLIP, STEEP, STICK, contact_wrench
from tests.contacts import APEX, COS, HALF, SEAT, SIN, parameters, wheel_above, wrench

pytestmark = pytest.mark.portable


def random_motion(rng, depth=None):
    """A cable and a wheel in a random, but plausible pose; the offset from p is some centimetres."""
    motion = wheel_above(rng.uniform(-1e-3, 6e-3) if depth is None else depth, rng.uniform(-3e-3, 3e-3))
    motion[at.POINT : at.TANGENT] += 0.03 * rng.normal() * motion[at.TANGENT : at.POINT_RATE]
    yaw = Rotation.from_rotvec([0.02 * rng.normal(), 0.02 * rng.normal(), 0.05 * rng.normal()])
    motion[at.TANGENT : at.POINT_RATE] = yaw.apply(motion[at.TANGENT : at.POINT_RATE]) * rng.uniform(0.99, 1.01)
    motion[at.POINT_RATE : at.CENTRE] = 0.3 * rng.normal(size=6)
    motion[at.CENTRE_RATE : at.MOTION_SIZE] = 0.3 * rng.normal(size=6)
    return turned(motion, Rotation.from_rotvec(rng.normal(size=3)))


def turned(motion, rotation):
    return rotation.apply(motion.reshape(-1, 3)).ravel()


def away_from_axle(motion):
    """Unit vector from the axle to the cable."""
    axle = motion[at.AXLE : at.CENTRE_RATE]
    d = motion[at.POINT : at.TANGENT] - motion[at.CENTRE : at.AXLE]
    tangent = motion[at.TANGENT : at.POINT_RATE] / np.linalg.norm(motion[at.TANGENT : at.POINT_RATE])
    d = d - (d @ tangent) * tangent
    d = d - (d @ axle) * axle
    return d / np.linalg.norm(d)


def hunt_crossley(delta, rate, k=1e8, n=2.5, D=1.0):
    return k * delta**n * max(1.0 + D * rate, 0.0)


def impact(delta, rate, k=1e8, n=2.5, c=1e4, depth=0.01):
    """ADAMS' IMPACT function; its STEP is the cubic that is level at both ends."""
    x = min(delta / depth, 1.0)
    return max(k * delta**n + c * x**2 * (3.0 - 2.0 * x) * rate, 0.0)


LAWS = {"hunt_crossley": hunt_crossley, "impact": impact}


def reference_walls(motion, pressure=hunt_crossley, l0=0.06):
    """Force and moments from the formulas, point by point, by adaptive quadrature."""
    p, t, dp, dt, w, a, dw, om = motion.reshape(8, 3)
    u = t / np.linalg.norm(t)
    turn = np.cross(t, dt) / (t @ t)
    foot = (w - p) @ u

    def density(x):
        point = p + (foot + x) * u
        d = point - w
        y = d @ a
        radial = d - y * a
        rho = np.linalg.norm(radial)
        v = dp + (foot + x) * np.cross(turn, u) - dw - np.cross(om, d)
        total = np.zeros(7)
        for side in (1.0, -1.0):
            normal = -side * COS * a + SIN * radial / rho
            delta = max(0.009 - (SIN * (rho - APEX) - side * COS * y), 0.0)
            f = pressure(delta, -normal @ v) / l0
            total += np.concatenate([f * normal, np.cross((foot + x) * u, f * normal), [f]])
        return total

    edges = np.linspace(-0.1, 0.1, 41)  # longer than what can touch
    return quad_vec(density, edges[0], edges[-1], epsabs=1e-9, epsrel=1e-11, points=edges, limit=4000)[0]


def test_seat_depth_of_a_point_contact():
    """Two walls at half the groove angle from the radial direction: W = 2 k delta^n sin(theta/2)."""
    weight = 38.0 * 9.8
    delta = (weight / (2.0 * 1e8 * SIN)) ** (1 / 2.5)
    out = wrench(wheel_above(delta / SIN), max_contact_length=1e-7, reference_length=2e-7)
    assert out[at.WHEEL_FORCE + 2] == pytest.approx(weight, rel=1e-9)
    assert out[at.CABLE_FORCE + 2] == pytest.approx(-weight, rel=1e-9)
    assert out[at.NORMAL] == pytest.approx(weight / SIN, rel=1e-9)
    assert out[at.DEEPEST] == pytest.approx(delta, rel=1e-12)
    assert out[at.WALL_ENERGY] == pytest.approx(2.0 * 1e8 * delta**3.5 / 3.5, rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(12))
def test_walls_against_adaptive_quadrature(seed, law):
    """The rule on the touched piece is right to 4e-6 of the normal force (next test).

    IMPACT lets go near the ends of the piece where it is lifted, a kink: here the wheel comes down fast enough (for
    that, see tests/test_contact_impact.py).
    """
    motion = random_motion(np.random.default_rng(seed))
    if law == "impact":
        motion[at.CENTRE_RATE : at.TURN_RATE] += 2.0 * away_from_axle(motion)
    out = wrench(motion, friction_coefficient=0.0, damping_law=law)
    expected = reference_walls(motion, LAWS[law])
    scale = expected[6]
    np.testing.assert_allclose(out[at.CABLE_FORCE : at.CABLE_MOMENT], expected[0:3], atol=4e-6 * scale + 1e-12)
    np.testing.assert_allclose(out[at.CABLE_MOMENT : at.WHEEL_FORCE], expected[3:6], atol=4e-6 * 0.06 * scale + 1e-12)
    assert out[at.NORMAL] == pytest.approx(scale, rel=4e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("n", "cut", "error"), [(1.0, 1.0, 1e-14), (1.5, 1.0, 4e-5), (2.5, 1.0, 4e-6), (2.5, 0.9, 1e-7)]
)
def test_rule_of_the_touched_piece(n, cut, error):
    """A load (1 - x^2)^n ending at zero or cut off: Gauss-Legendre converges like 1 / points^(2 n + 2)."""
    exact = quad(lambda x: (1 - x * x) ** n, -cut, cut, epsabs=1e-15, epsrel=1e-13)[0]
    for points in (len(NODES), 2 * len(NODES)):
        x, w = np.polynomial.legendre.leggauss(points)
        assert cut * w @ (1 - (cut * x) ** 2) ** n == pytest.approx(exact, rel=error)
        error = max(error * 1.3 / 2 ** (2 * n + 2), 1e-14)


def test_contact_length_is_that_of_the_geometry_and_grows():
    """delta = 0 where the radial distance is that of first touch: x^2 + rho_0^2 = SEAT^2."""
    lengths = []
    for depth in (1e-4, 1e-3, 3e-3):
        lengths.append(wrench(wheel_above(depth))[at.CONTACT_LENGTH])
        assert lengths[-1] == pytest.approx(2.0 * math.sqrt(SEAT**2 - (SEAT - depth) ** 2), rel=1e-9)
    assert lengths == sorted(lengths)
    assert wrench(wheel_above(0.02), max_contact_length=0.03)[at.CONTACT_LENGTH] == pytest.approx(0.06, rel=1e-12)
    assert wrench(wheel_above(-1e-9))[at.CONTACT_LENGTH] == 0.0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_longest_contact_length_changes_nothing_beyond_what_touches(seed):
    """A limit of 0.12 m from the foot is longer than the chord of the groove, 2 SEAT = 0.106 m; 5 m is no different."""
    motion = random_motion(np.random.default_rng(seed), depth=0.01)
    out = [wrench(motion, max_contact_length=length) for length in (0.12, 5.0)]
    np.testing.assert_array_equal(out[0], out[1])
    halved = wrench(motion, reference_length=0.12, friction_coefficient=0.0)
    assert halved[at.NORMAL] == pytest.approx(0.5 * out[0][at.NORMAL], rel=1e-13)  # stiffness / l0 per unit length


def test_resultants_of_the_walls():
    """Seated in the middle, W = N sin(θ/2) presses towards the axle and nothing along it; on one wall alone the force
    stands on that wall, N (sin(θ/2), ∓cos(θ/2))."""
    out = wrench(wheel_above(2e-3), friction_coefficient=0.0, max_contact_length=1e-7)
    assert out[at.RADIAL] == pytest.approx(SIN * out[at.NORMAL], rel=1e-12)
    assert out[at.LATERAL] == pytest.approx(0.0, abs=1e-12 * out[at.NORMAL])
    for side in (1.0, -1.0):
        motion = wheel_above(-2e-3, lateral=side * 5e-3)
        out = wrench(motion, friction_coefficient=0.0, max_contact_length=1e-7)
        assert out[at.NORMAL] > 0.0
        assert out[at.RADIAL] == pytest.approx(SIN * out[at.NORMAL], rel=1e-12)
        assert abs(out[at.LATERAL]) == pytest.approx(COS * out[at.NORMAL], rel=1e-12)
        axle, force = motion[at.AXLE : at.CENTRE_RATE], out[at.WHEEL_FORCE : at.WHEEL_MOMENT]
        assert out[at.LATERAL] == pytest.approx(force @ axle, rel=1e-12)


def test_a_cable_steeper_than_the_wall_is_refused():
    """A wall stands at half the groove angle to the wheel's plane; a steeper cable has no end of its contact on it."""
    for angle, expected in ((HALF - 0.01, OK), (HALF + 0.01, STEEP), (0.5 * math.pi, STEEP)):
        motion = wheel_above(5e-3)
        motion[at.TANGENT : at.POINT_RATE] = (math.sin(angle), math.cos(angle), 0.0)
        out = np.zeros(at.OUT_SIZE)
        assert contact_wrench(parameters(), motion, np.zeros(2), out) == expected
        motion[at.CENTRE + 2] += 0.2  # in the air it may be turned as it likes
        assert contact_wrench(parameters(), motion, np.zeros(2), out) == OK


def test_lateral_self_centring():
    """Small lateral offset y of a point contact: F_y = -2 n k delta^(n-1) cos^2(theta/2) y on the cable."""
    delta, y = 4e-3, 1e-7
    out = wrench(
        wheel_above(delta / SIN, lateral=y), max_contact_length=1e-7, reference_length=2e-7, friction_coefficient=0.0
    )
    assert out[at.CABLE_FORCE] == pytest.approx(-2.0 * 2.5 * 1e8 * delta**1.5 * COS**2 * y, rel=1e-6)


def test_yaw_restoring_moment():
    """Small yaw psi: the walls' difference over x and the radial forces at the lever psi x turn back."""
    depth, psi, k, l0 = 3e-3, 1e-6, 1e8, 0.06
    motion = wheel_above(depth)
    motion[at.TANGENT : at.POINT_RATE] = math.sin(psi), math.cos(psi), 0.0  # right-handed turn about z is -psi

    def stiffness(x):
        rho = math.hypot(SEAT - depth, x)
        delta = max(SIN * (SEAT - rho), 0.0)
        return x**2 * (2.0 * 2.5 * k * delta**1.5 * COS**2 + 2.0 * k * delta**2.5 * SIN / rho) / l0

    end = math.sqrt(SEAT**2 - (SEAT - depth) ** 2)
    expected = quad(stiffness, -end, end, epsabs=0.0, epsrel=1e-10)[0]
    assert wrench(motion, friction_coefficient=0.0)[at.CABLE_MOMENT + 2] == pytest.approx(expected * psi, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_wall_force_is_the_gradient_of_the_wall_energy(seed):
    """Without damping the force is -dU/dp; central differences of the energy, step 1e-6 m."""
    motion = random_motion(np.random.default_rng(seed), depth=2e-3)
    settings = {"damping": 0.0, "friction_coefficient": 0.0}
    out = wrench(motion, **settings)
    for i in range(3):
        energies = []
        for h in (1e-6, -1e-6):
            moved = motion.copy()
            moved[i] += h
            energies.append(wrench(moved, **settings)[at.WALL_ENERGY])
        assert out[i] == pytest.approx(-(energies[0] - energies[1]) / 2e-6, abs=2e-5 * out[at.NORMAL])


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), damping=st.floats(0.0, 100.0), law=st.sampled_from(sorted(LAWS)))
def test_never_pulls_and_dissipates(seed, damping, law):
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    damped = {"damping_law": law, "damping": damping, "damping_coefficient": 1e3 * damping}
    out = wrench(motion, 1e-3 * rng.normal(size=2), **damped)
    d = motion[at.POINT : at.TANGENT] - motion[at.CENTRE : at.AXLE]
    radial = d - (d @ motion[at.AXLE : at.CENTRE_RATE]) * motion[at.AXLE : at.CENTRE_RATE]
    walls = wrench(motion, **damped, friction_coefficient=0.0)
    assert out[at.NORMAL] >= 0.0
    assert walls[at.CABLE_FORCE : at.CABLE_MOMENT] @ radial >= -1e-9 * out[at.NORMAL]
    assert out[at.WALL_POWER] >= 0.0
    assert out[at.FRICTION_POWER] >= -1e-12 * out[at.NORMAL]
    assert math.hypot(out[at.FRICTION], out[at.FRICTION + 1]) <= 0.7 * out[at.NORMAL] * (1 + 1e-12)


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_pose_gives_finite_passive_forces(seed):
    """Wheels upside down, along the cable, through it: the law stays defined, or says that the cable is too steep to
    the wall: from half the groove angle to the wheel's plane on."""
    rng = np.random.default_rng(seed)
    motion = rng.normal(size=24)
    motion[at.CENTRE : at.AXLE] = motion[at.POINT : at.TANGENT] + 0.05 * rng.normal(size=3)
    motion[at.AXLE : at.CENTRE_RATE] /= np.linalg.norm(motion[at.AXLE : at.CENTRE_RATE])
    if seed % 3 == 0:
        motion[at.AXLE : at.CENTRE_RATE] = motion[at.TANGENT : at.POINT_RATE] / np.linalg.norm(
            motion[at.TANGENT : at.POINT_RATE]
        )
    out = np.zeros(at.OUT_SIZE)
    status = contact_wrench(parameters(), motion, 1e-3 * rng.normal(size=2), out)
    tangent = motion[at.TANGENT : at.POINT_RATE]
    steep = abs(tangent @ motion[at.AXLE : at.CENTRE_RATE]) / np.linalg.norm(tangent) >= SIN
    assert status == OK or (status == STEEP and steep)
    assert np.isfinite(out).all()
    if status == STEEP:
        return
    assert out[at.NORMAL] >= 0.0 and out[at.WALL_POWER] >= 0.0 and 0.0 <= out[at.CONTACT_LENGTH] <= 1.0
    about_wheel = out[at.CABLE_MOMENT : at.WHEEL_FORCE] + np.cross(
        motion[at.POINT : at.TANGENT] - motion[at.CENTRE : at.AXLE], out[at.CABLE_FORCE : at.CABLE_MOMENT]
    )
    np.testing.assert_allclose(
        about_wheel + out[at.WHEEL_MOMENT : at.NORMAL], 0.0, atol=1e-12 * (out[at.NORMAL] + 1e-9)
    )


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_action_is_reaction(seed):
    """Forces cancel, and the moments of both about any point: M_c + M_w + (p - w) x F_c = 0."""
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    out = wrench(motion, 1e-4 * rng.normal(size=2))
    scale = out[at.NORMAL] + 1e-9
    np.testing.assert_allclose(
        out[at.CABLE_FORCE : at.CABLE_MOMENT] + out[at.WHEEL_FORCE : at.WHEEL_MOMENT], 0.0, atol=1e-14 * scale
    )
    about_wheel = out[at.CABLE_MOMENT : at.WHEEL_FORCE] + np.cross(
        motion[at.POINT : at.TANGENT] - motion[at.CENTRE : at.AXLE], out[at.CABLE_FORCE : at.CABLE_MOMENT]
    )
    np.testing.assert_allclose(about_wheel + out[at.WHEEL_MOMENT : at.NORMAL], 0.0, atol=1e-14 * scale)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_turned_and_mirrored_motion_gives_turned_and_mirrored_wrench(seed):
    rng = np.random.default_rng(seed)
    motion, slip = random_motion(rng), 1e-5 * rng.normal(size=2)
    out = wrench(motion, slip)
    rotation = Rotation.from_rotvec(rng.normal(size=3))
    after = wrench(turned(motion, rotation), slip)
    tolerance = 1e-9 * (1.0 + out[at.NORMAL])
    np.testing.assert_allclose(after[: at.NORMAL], turned(out[: at.NORMAL], rotation), atol=tolerance)
    np.testing.assert_allclose(after[at.NORMAL : at.SCRATCH], out[at.NORMAL : at.SCRATCH], atol=tolerance)
    # mirrored in x: polar vectors change x, axial vectors (moment, angular velocity) change y and z; the
    # mirrored axle -x is the same wheel as +x, which turns round the lateral bristle
    polar, axial = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0])
    mirror = np.concatenate([polar, polar, polar, polar, polar, -polar, polar, axial])
    image = wrench(mirror * motion, slip * [1.0, -1.0])
    np.testing.assert_allclose(
        image[: at.NORMAL], np.concatenate([polar, axial, polar, axial]) * out[: at.NORMAL], atol=tolerance
    )
    assert image[at.FRICTION + 1] == pytest.approx(-out[at.FRICTION + 1], abs=tolerance)


@pytest.mark.parametrize("length", [1e-7, 0.06])
def test_smooth_at_touch(length):
    """C2 in the depth: force / depth^2 falls like depth^(1/2) or faster, so F'' starts at 0."""
    depths = np.array([1e-4, 1e-5, 1e-6])
    forces = np.array([wrench(wheel_above(d), max_contact_length=length)[at.NORMAL] for d in depths])
    assert np.all(np.diff(np.log(forces)) / np.diff(np.log(depths)) >= 2.5 - 1e-3)
    assert wrench(wheel_above(-1e-12))[:12].any() == False  # noqa: E712


def test_restitution_of_hunt_crossley():
    """First integral of m x'' = -K x^n (1 + E x'): E v - ln(1 + E v) is the same before and after, any n.

    For a point contact in the groove the walls' rate is sin(theta/2) of the radial speed: E = D sin(theta/2).
    """
    prm = parameters(max_contact_length=1e-7, reference_length=2e-7, friction_coefficient=0.0)
    out, none = np.zeros(at.OUT_SIZE), np.zeros(2)

    def fall(t, x):
        contact_wrench(prm, wheel_above(x[0], velocity=(0.0, 0.0, -x[1])), none, out)
        return x[1], -out[at.WHEEL_FORCE + 2] / 38.0

    def lift(t, x):
        return x[0] + 1e-15

    lift.terminal, lift.direction = True, -1
    for speed in (0.1, 0.5, 1.0, 2.0):
        run = solve_ivp(fall, (0, 1), [0.0, speed], events=lift, rtol=1e-10, atol=1e-14, max_step=1e-3)
        E = SIN
        before = E * speed - math.log(1 + E * speed)
        after = brentq(lambda v, E=E, c=before: -E * v - math.log(1 - E * v) - c, 1e-9, min(speed, (1 - 1e-12) / E))
        assert -run.y[1, -1] == pytest.approx(after, rel=1e-6)


def test_friction_sticks_up_to_the_coulomb_limit():
    motion = wheel_above(4e-3)
    limit = 0.7 * wrench(motion)[at.NORMAL]
    z = 0.6 * limit / 1e6
    out = wrench(motion, (z, -z))
    assert out[at.STATUS] == STICK
    np.testing.assert_allclose(out[at.FRICTION : at.DEEPEST], [-1e6 * z, 1e6 * z], rtol=1e-14)
    np.testing.assert_array_equal(out[at.ELONGATION : at.WALL_POWER], [z, -z])
    out = wrench(motion, (3 * z, -3 * z))
    assert out[at.STATUS] == SLIP
    assert math.hypot(out[at.FRICTION], out[at.FRICTION + 1]) == pytest.approx(limit, rel=1e-14)
    assert out[at.CABLE_FORCE + 1] == pytest.approx(-limit / math.sqrt(2), rel=1e-12)
    np.testing.assert_allclose(
        wrench(motion, out[at.ELONGATION : at.WALL_POWER])[at.ELONGATION : at.WALL_POWER],
        out[at.ELONGATION : at.WALL_POWER],
        rtol=1e-15,
    )


def test_wedge_raises_sliding_friction():
    """Walls carry W = N sin(theta/2), friction is mu N: sliding takes mu / sin(theta/2) of the load."""
    motion = wheel_above(4e-3, slip_rate=(0.5, 0.0))
    out = wrench(motion, (1.0, 0.0), max_contact_length=1e-7, reference_length=2e-7, damping=0.0)
    assert out[at.STATUS] == SLIP
    assert -out[at.CABLE_FORCE + 1] / out[at.WHEEL_FORCE + 2] == pytest.approx(0.7 / SIN, rel=1e-9)
    assert out[at.FRICTION_POWER] == pytest.approx(-out[at.CABLE_FORCE + 1] * 0.5, rel=1e-12)


def test_no_force_no_friction():
    out = wrench(wheel_above(-1e-3, slip_rate=(1.0, 1.0)), (1e-3, 1e-3))
    assert out[at.STATUS] == OPEN
    assert not out[at.CABLE_FORCE : at.DEEPEST].any() and not out[at.ELONGATION : at.SCRATCH].any()
    assert out[at.DEEPEST] == pytest.approx(-1e-3 * SIN, rel=1e-9)
    np.testing.assert_allclose(out[at.SLIP_VELOCITY : at.CONTACT_LENGTH], [1.0, 1.0])


def test_offset_is_arc_length_of_the_foot():
    motion = wheel_above(2e-3)
    motion[at.POINT + 1] = 0.02
    motion[at.TANGENT + 1] = 1.01
    assert wrench(motion)[at.OFFSET] == pytest.approx(-0.02 / 1.01, rel=1e-14)


@pytest.mark.parametrize(
    ("lateral", "radial", "status"),
    [(0.0, 0.12, OPEN), (0.03, 0.085, OPEN), (0.041, 0.085, OPEN), (0.041, 0.08, LEFT), (0.041, 0.02, LEFT)],
)
def test_leaving_the_groove(lateral, radial, status):
    """Beside the wheel and lower than a cable lying on the rim (75 + 9 mm): left; above the rim: open."""
    motion = wheel_above(SEAT - radial, lateral=lateral)
    out = wrench(motion)
    assert out[at.STATUS] == status
    assert not out[at.CABLE_FORCE : at.NORMAL].any()


def test_failure_is_told():
    for i, expected in ((4, 1), (15, 2), (12, 3)):
        motion = wheel_above(1e-3)
        motion[i] = 0.0 if i != at.CENTRE else math.nan
        assert contact_wrench(parameters(), motion, np.zeros(2), np.zeros(at.OUT_SIZE)) == expected
