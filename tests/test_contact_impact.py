"""The damping of ADAMS' IMPACT function: closed forms, a drop, whole runs of both solvers."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from fmus.contact import places as at
from fmus.contact.law import NODES, OPEN, WEIGHTS, contact_wrench, step_up
from orchestrator.landing import audit
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic import solve
from orchestrator.runs.coupled import run_coupled
from tests.contacts import SEAT, SIN, parameters, wheel_above, wrench
from tests.scenarios import scenario

pytestmark = pytest.mark.portable

POINT = {"max_contact_length": 1e-7, "reference_length": 2e-7, "friction_coefficient": 0.0}
"""A contact as long as its reference length, all of it at one depth: what ADAMS takes a contact for."""
IMPACT = {"damping_law": "impact", "damping_coefficient": 1e4, "damping_depth": 0.01}
WEIGHT = 38.0 * 9.8


def pressed(delta, rate, **settings):
    """Sum of the forces of both walls, each pressed by `delta` (m) at the `rate` (m/s)."""
    motion = wheel_above(delta / SIN, velocity=(0.0, 0.0, -rate / SIN))
    return wrench(motion, **{**POINT, **settings})[at.NORMAL]


def test_step_is_the_cubic_of_adams():
    """STEP(x, 0, 0, 1, 1): level at both ends, 1/2 in the middle, held beyond."""
    assert [step_up(x) for x in (0.0, 0.5, 1.0, 3.0)] == [0.0, 0.5, 1.0, 1.0]
    for x, slope in ((1e-6, 0.0), (0.5, 1.5), (1.0 - 1e-6, 0.0)):
        assert (step_up(x + 1e-7) - step_up(x - 1e-7)) / 2e-7 == pytest.approx(slope, abs=1e-5)


@pytest.mark.parametrize("delta", [1e-3, 5e-3, 0.012])
@pytest.mark.parametrize("rate", [-0.01, 0.0, 0.3])
def test_force_of_a_wall(delta, rate):
    """F = k delta^n + c(delta) delta_dot of each wall, and nothing below zero."""
    x = min(delta / 0.01, 1.0)
    expected = 1e8 * delta**2.5 + 1e4 * (3.0 * x**2 - 2.0 * x**3) * rate
    assert pressed(delta, rate, **IMPACT) == pytest.approx(2.0 * max(expected, 0.0), rel=1e-9)


def test_equals_hunt_crossley_at_one_depth():
    """At the depth at which 38 kg stand, 5.7 mm, 1e4 N s/m is D = c(delta)/(k delta^n) = 25 s/m, at any rate: both laws are
    linear in it. Along the point contact, 1e-7 m long, the depth varies by 2e-11 of itself."""
    delta = (WEIGHT / (2.0 * 1e8 * SIN)) ** (1 / 2.5)
    assert delta == pytest.approx(5.7e-3, rel=0.005)
    x = delta / 0.01
    equal = 1e4 * (3.0 * x**2 - 2.0 * x**3) / (1e8 * delta**2.5)
    assert equal == pytest.approx(25.0, rel=0.02)
    for rate in (-0.03, 0.1):
        assert pressed(delta, rate, **IMPACT) == pytest.approx(pressed(delta, rate, damping=equal), rel=1e-10)


def test_damping_is_spread_as_the_stiffness_is():
    """Twice the reference length: half the force of a piece that touches, elastic and damped alike."""
    motion = wheel_above(4e-3, velocity=(0.0, 0.0, -0.2))
    one, two = (wrench(motion, **IMPACT, friction_coefficient=0.0, reference_length=l0) for l0 in (0.06, 0.12))
    assert two[at.NORMAL] == pytest.approx(0.5 * one[at.NORMAL], rel=1e-13)


def test_never_pulls_and_books_what_is_lost():
    """Lifted faster than the walls follow: no force, and what they had stored is lost."""
    out = wrench(wheel_above(2e-3, velocity=(0.0, 0.0, 2.0)), **POINT, **IMPACT)
    assert out[at.NORMAL] == 0.0 and out[at.STATUS] == OPEN
    rate = 2.0 * SIN
    assert out[at.WALL_POWER] == pytest.approx(2.0 * 1e8 * (2e-3 * SIN) ** 2.5 * rate, rel=1e-9)


@pytest.mark.parametrize("speed", [0.005, 0.01, 0.02])
def test_lifted_it_lets_go_at_the_ends_first(speed):
    """Near the ends of what touches the damping outweighs the elasticity, delta^2 against delta^2.5, and the force ends at
    a kink. Nine Gauss points leave the error that they leave of a kink of that slope."""
    depth = 6e-3
    out = wrench(wheel_above(depth, velocity=(0.0, 0.0, speed)), **IMPACT, friction_coefficient=0.0)
    half = math.sqrt(SEAT**2 - (SEAT - depth) ** 2)

    def density(x):
        rho = math.hypot(SEAT - depth, x)
        delta = SIN * (SEAT - rho)
        ramp = step_up(delta / 0.01)
        return 2.0 / 0.06 * max(1e8 * delta**2.5 - 1e4 * ramp * speed * SIN * (SEAT - depth) / rho, 0.0)

    x = np.linspace(0.0, half, 20001)[:-1]
    values = np.array([density(one) for one in x])
    kink = int(np.argmin(values > 0.0))
    assert 0 < kink < x.size - 1
    slope = (values[kink - 1] - values[kink]) / (x[1] - x[0])
    exact = 2.0 * quad(density, 0.0, x[kink], epsrel=1e-10)[0]
    assert abs(out[at.NORMAL] - exact) < 2.0 * kink_error() * half**2 * slope + 1e-5 * exact


def kink_error():
    """Largest error of the rule on [-1, 1] for (x - a)_+, over a."""
    a = np.linspace(-1.0, 1.0, 2001)
    return np.max(np.abs(np.maximum(NODES - a[:, None], 0.0) @ WEIGHTS - 0.5 * (1.0 - a) ** 2))


def test_parameters_of_one_law_leave_the_other_alone():
    motion = wheel_above(4e-3, velocity=(0.0, 0.0, -0.2))
    np.testing.assert_array_equal(wrench(motion), wrench(motion, damping_coefficient=7.0, damping_depth=3.0))
    np.testing.assert_array_equal(wrench(motion, **IMPACT), wrench(motion, **IMPACT, damping=7.0))


def test_first_integral_of_a_linear_spring():
    """With k delta and a full damping that does not depend on the depth, the bounce is that of a damped oscillator.

    Released at the speed v at touch, its force is zero again at w t = pi - 2 asin(z), z = c/(2 sqrt(k m)): it leaves at
    v exp(-z w0 t), and has lost the rest. `damping_depth` is so small that the ramp is over at once.
    """
    k, c, mass, speed = 2.0 * SIN**2 * 1e5, 2.0 * SIN**2 * 300.0, 38.0, 0.5
    settings = {"exponent": 1.0, "stiffness": 1e5, "damping_law": "impact", "damping_coefficient": 300.0}
    prm = parameters(**POINT, **settings, damping_depth=1e-9)
    out, none = np.zeros(at.OUT_SIZE), np.zeros(2)

    def fall(t, x):
        contact_wrench(prm, wheel_above(x[0], velocity=(0.0, 0.0, -x[1])), none, out)
        return x[1], -out[at.WHEEL_FORCE + 2] / mass, out[at.WALL_POWER]

    omega, z = math.sqrt(k / mass), 0.5 * c / math.sqrt(k * mass)
    time = (math.pi - 2.0 * math.asin(z)) / (omega * math.sqrt(1.0 - z * z))
    run = solve_ivp(fall, (0.0, 2.0 * time), [1e-9, speed, 0.0], rtol=1e-9, atol=1e-12, max_step=1e-3)
    leaving = speed * math.exp(-z * omega * time)
    assert -run.y[1, -1] == pytest.approx(leaving, rel=1e-5)
    free = 0.5 * mass * (speed**2 - leaving**2) - run.y[2, -1]
    assert abs(free) < 1e-5 * mass * speed**2  # what the spring still holds when the wheel leaves is lost as well


@pytest.fixture(scope="module")
def dropped():
    one = scenario("drop_5cm", 0.3, **{f"contact.parameters.{name}": value for name, value in IMPACT.items()})
    coupled = run_coupled(one)
    return coupled, solve(lambda: landing.problem(one), coupled.table["time"])


def test_a_drop_is_the_same_in_both_solvers(dropped):
    """To a thousandth of the range, the tolerance that shipped scenarios set for z."""
    coupled, reference = dropped
    for name in ("robot.body.position.z", "robot.roll"):
        values = reference.signals[name]
        assert np.max(np.abs(coupled.table[name] - values)) < 1e-3 * np.ptp(values)


def test_books_balance_in_a_drop(dropped):
    """As tight as with Hunt-Crossley (tests/test_system_energy.py)."""
    coupled, reference = dropped
    books = audit.of_monolithic({"time": reference.time} | reference.signals, reference.estimated_error)
    assert books.within
    assert coupled.energy.within
    assert coupled.energy.drift < 5e-6 * coupled.energy.exchanged
    assert coupled.table["contact1.dissipated_energy"][-1] > 0.0
