"""What the contact says of the inside of a macro step, along motions that the exchange knows exactly."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from fmus.contact import places as at
from fmus.contact.law import LEFT
from fmus.contact.module import Contact
from fmus.module.variables import ModuleError
from tests.contacts import SEAT, SIN, wheel_above, wrench

pytestmark = pytest.mark.portable

TABLE = Contact.table
DEPTH, BOTTOM, PULL = 4e-3, 0.0123, 90.0
"""m, s, m/s²: the wheel's parabola, DEPTH below first touch at the time BOTTOM."""
TOUCH = BOTTOM - math.sqrt(2.0 * DEPTH / PULL)
STOP = 0.024


def depth(t):
    return DEPTH - 0.5 * PULL * (t - BOTTOM) ** 2


def write(contact, name, vector):
    i = TABLE.index[f"{name}.x"]
    contact.values[i : i + 3] = vector


def read(contact, name):
    return float(contact.values[TABLE.index[name]])


def put(contact, t, h=0.0, along=0.0, depth=depth):
    """Write the wheel on its parabola at t, with the means over the last h; it moves at `along` (m/s) across the cable."""
    rate, eps = 1e-6, 1e-6
    z = lambda time: SEAT - depth(time)  # noqa: E731
    write(contact, "wheel.position", (along * t, 0.0, z(t)))
    write(contact, "wheel.velocity", (along, 0.0, (z(t + eps) - z(t - rate)) / (eps + rate)))
    mean = quad(z, t - h, t)[0] / h if h else z(t)
    write(contact, "wheel.position_mean", (along * (t - 0.5 * h), 0.0, mean))


def fall(h, along=0.0, depth=depth, stop=STOP, **settings):
    """Go along the parabola in steps of h; return the contact and what it says after each step."""
    contact = Contact()
    TABLE.assign(contact.values, {"damping": 0.0, **settings})
    put(contact, 0.0, along=along, depth=depth)
    contact.initialize(0.0)
    rows = []
    for i in range(round(stop / h)):
        put(contact, (i + 1) * h, h, along, depth)
        contact.step(i * h, h)
        names = ("normal_force_max", "penetration_max", "slip_velocity_max", "impulse", "touch_time", "normal_force")
        rows.append({name: read(contact, name) for name in names})
    return contact, {name: np.array([row[name] for row in rows]) for name in rows[0]}


def largest_force(**settings):
    return wrench(wheel_above(DEPTH), damping=0.0, **settings)[at.NORMAL]


@pytest.mark.parametrize("exchange", ["waveform", "hermite", "point"])
@pytest.mark.parametrize("parts", [1, 2, 3, 7, 40])
def test_largest_values_do_not_depend_on_the_step(exchange, parts):
    """Without damping force and penetration are largest at the bottom of the parabola, wherever in a step it is. A
    parabola through three looks, thrice refined, finds the top of a force ~ depth³ to 1e-6."""
    _, said = fall(STOP / parts, exchange=exchange)
    assert said["normal_force_max"].max() == pytest.approx(largest_force(), rel=1e-5)
    assert said["penetration_max"].max() == pytest.approx(SIN * DEPTH, rel=1e-6)
    assert np.all(said["normal_force_max"] >= said["normal_force"])
    assert said["touch_time"][-1] == pytest.approx(TOUCH, abs=1e-9)
    assert np.all(said["touch_time"][np.arange(1, parts + 1) * STOP / parts < TOUCH] == -1.0)


@pytest.mark.parametrize("parts", [1, 2, 3, 7, 40])
def test_impulse_is_the_integral_of_the_force(parts):
    """By adaptive quadrature; a touch inside a step costs the eight Gauss points 1e-4 of it where the load ends smoothly."""
    expected = quad(lambda t: wrench(wheel_above(depth(t)), damping=0.0)[at.NORMAL], TOUCH, 2.0 * BOTTOM - TOUCH)[0]
    expected -= quad(lambda t: wrench(wheel_above(depth(t)), damping=0.0)[at.NORMAL], STOP, 2.0 * BOTTOM - TOUCH)[0]
    assert fall(STOP / parts)[1]["impulse"].sum() == pytest.approx(expected, rel=2e-3 if parts == 1 else 2e-4)


def test_largest_slip_is_that_while_they_touch():
    """Across the cable at constant speed, 0.2 m/s: the slip velocity is that speed, and 0 where they do not touch."""
    _, said = fall(STOP / 24, along=0.2)
    touching = said["normal_force_max"] > 0.0
    np.testing.assert_allclose(said["slip_velocity_max"][touching], 0.2, rtol=1e-6)
    assert not said["slip_velocity_max"][~touching].any() and not touching.all()


def test_a_touch_between_two_looks_is_found():
    """A graze of 20 µm that lasts a twentieth of the step, from 9.5 mm above: first touch and depth by the parabola."""
    graze = lambda t: 2e-5 - 0.5 * 1300.0 * (t - 0.0035) ** 2  # noqa: E731
    _, said = fall(0.007, depth=graze, stop=0.007)
    assert said["penetration_max"][0] == pytest.approx(SIN * 2e-5, rel=1e-6)
    assert said["touch_time"][0] == pytest.approx(0.0035 - math.sqrt(4e-5 / 1300.0), abs=1e-9)
    assert said["normal_force_max"][0] == pytest.approx(wrench(wheel_above(2e-5))[at.NORMAL], rel=1e-4)


def test_what_it_remembers_is_in_its_state():
    """The step from a restored state repeats bit for bit, its largest values too; outputs come with the state."""
    contact, _ = fall(STOP / 6, stop=STOP / 2)
    state, values = contact.state.copy(), contact.values.copy()
    after = []
    for _ in range(2):
        contact.state[:], contact.values[:] = state, values
        put(contact, STOP / 2 + STOP / 6, STOP / 6)
        contact.step(STOP / 2, STOP / 6)
        after.append((contact.state.copy(), contact.values.copy()))
    np.testing.assert_array_equal(after[0][0], after[1][0])
    np.testing.assert_array_equal(after[0][1], after[1][1])
    contact.refresh()
    assert read(contact, "normal_force_max") == after[0][1][TABLE.index["normal_force_max"]]


def test_a_step_in_which_they_meet_is_no_longer_than_the_groove_is_deep():
    """33.6 mm: 0.04 / tan 50°. The step says how long it may be; half of that passes, and so does a flight as fast
    that meets nothing."""
    speed, groove = 14.0, 0.04 / math.tan(math.radians(50.0))
    for exchange in ("waveform", "hermite", "point"):
        with pytest.raises(ModuleError, match=r"groove is deep.* steps of at most 0.0022 s"):
            fall(0.01, depth=lambda t: speed * t - 0.06, stop=0.01, exchange=exchange)
        _, said = fall(0.5 * groove / speed, depth=lambda t: speed * t - 0.02, stop=1.5 * groove / speed)
        assert said["penetration_max"].max() > 0.0
        _, said = fall(0.01, depth=lambda t: speed * t - 0.16, stop=0.01, exchange=exchange)
        assert said["touch_time"][0] == -1.0


def test_nothing_acts_after_the_groove_is_left():
    contact = Contact()
    TABLE.assign(contact.values, {})
    put(contact, BOTTOM)
    contact.initialize(0.0)
    for i in range(60):
        write(contact, "wheel.position", (1e-3 * (i + 1), 0.0, SEAT - DEPTH))
        write(contact, "wheel.position_mean", (1e-3 * (i + 0.5), 0.0, SEAT - DEPTH))
        contact.step(1e-3 * i, 1e-3)
    assert read(contact, "status") == LEFT
    for name in ("normal_force_max", "slip_velocity_max", "impulse", "radial_force", "lateral_force"):
        assert read(contact, name) == 0.0
    assert read(contact, "touch_time") == 0.0
