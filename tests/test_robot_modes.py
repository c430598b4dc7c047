"""Modes of the line with the robot on it: against free vibrations in time, closed forms, and what the command leaves."""

import csv
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import curve_fit
from typer.testing import CliRunner

from fmus.robot import rigid_body as rb
from orchestrator.cli.commands import app
from orchestrator.coupling.errors import InputError
from orchestrator.landing import build
from orchestrator.landing.monolithic.linear import at_rest
from orchestrator.landing.monolithic.solve import Integrator
from orchestrator.landing.monolithic.state import ARC, BRISTLE
from orchestrator.landing.placement import touching_distance
from orchestrator.landing.robot_modes import KINDS, SystemModes, modes, of_scenario, over_positions
from tests.scenarios import scenario
from verification.cable.setups import loaded_equilibrium, point

pytestmark = pytest.mark.portable

STIFF = {"contact.parameters.stiffness": 1e13, "contact.parameters.tangential_stiffness": 1e7}
RIGID = STIFF | {
    "cable.parameters.span": 4.0,
    "cable.parameters.unstretched_length": 4.0,
    "cable.parameters.axial_stiffness": 1e10,
    "cable.parameters.bending_stiffness": 1e8,
    "cable.parameters.clamped": "true",
    "landing.position": 2.0,
}
"""A short beam that gives way by less than 1e-5 m, and a contact likewise."""


def problem(name="rig_10m", **values):
    return build.problem(scenario(name, **values))


def of_kind(found: SystemModes, kind: str) -> int:
    """Return the slowest mode of that kind."""
    return found.kinds.index(kind)


def body(one):
    """Return mass, gravity, height of the wheel over the centre of mass, and inertia about it (roll, pitch)."""
    value = {
        name: one.robot.values[one.robot.table.index[name]] for name in ("mass", "gravity", "inertia.xx", "inertia.yy")
    }
    arm = one.robot.values[one.robot.table.indices(("wheel[1].mount.z", "center_of_mass.z"))]
    return value["mass"], value["gravity"], arm[0] - arm[1], value["inertia.xx"], value["inertia.yy"]


def test_pendulum_on_a_rigid_support():
    """A braked wheel rolls on the line as it swings: ω² = m g l/(J + m (l - r)²), l from wheel to centre of mass, r from
    wheel to line; across the line it turns about the line: ω² = m g (l - r)/(J + m (l - r)²). The support gives way by
    a 1e-5 of l."""
    one = problem(**RIGID)
    found = modes(at_rest(one), 12)
    mass, g, l, roll, pitch = body(one)
    r = touching_distance(one.contacts[0])
    swing = np.sqrt(mass * g * l / (roll + mass * (l - r) ** 2))
    sway = np.sqrt(mass * g * (l - r) / (pitch + mass * (l - r) ** 2))
    assert 2.0 * np.pi * found.frequency[of_kind(found, "pendulum")] == pytest.approx(swing, rel=1e-3)
    assert 2.0 * np.pi * found.frequency[of_kind(found, "sway")] == pytest.approx(sway, rel=1e-3)


def test_a_robot_that_stands_on_the_line_topples():
    """An inverted pendulum about the line: λ² = m g h/(J + m h²), h its height over the line."""
    high = {"robot.parameters.center_of_mass.z": 1.2}
    one = problem(**RIGID, **high)
    found = modes(at_rest(one), 6)
    mass, g, l, _, pitch = body(one)
    h = touching_distance(one.contacts[0]) - l
    assert h > 0.1
    expected = np.sqrt(mass * g * h / (pitch + mass * h**2))
    grows = found.growth > 0.0
    k = int(np.argmax(found.shares[:, 4] * grows))
    assert found.growth[k] == pytest.approx(expected, rel=1e-3)
    assert found.frequency[k] == 0.0 and found.kinds[k] == "sway, topples"
    assert any(f"the robot topples: sway grows e-fold in {1.0 / expected:.2f}"[:-1] in text for text in found.warnings)


def test_bounce_on_a_light_line():
    """ω² = k/m, k from two equilibria of the line under a little more and a little less than the robot's weight."""
    line = {"linear_density": 1e-4, "axial_stiffness": 2.111e7, "bending_stiffness": 1.0}
    one = problem(**STIFF, **{f"cable.parameters.{name}": value for name, value in line.items()})
    found = modes(at_rest(one), 12)
    mass, g, *_ = body(one)
    settings = line | {"span": 10.0, "unstretched_length": 10.0}
    heights = []
    for factor in (0.999, 1.001):
        loads = ((5.0, factor * mass * g),)
        model, q = loaded_equilibrium(settings, loads, n_elements=60, grading=30.0, grading_position=5.0)
        heights.append(point(model, q, 5.0)[2])
    k = 0.002 * mass * g / (heights[0] - heights[1])
    assert 2.0 * np.pi * found.frequency[found.bounce_and_pendulum[0]] == pytest.approx(np.sqrt(k / mass), rel=2e-3)


def released(one, linear, shape, speed, stop):
    """Return time and motion of the robot (n, 6) after a kick of rest in the shape of a mode, by the monolithic solver."""
    n = linear.q.size
    integrator = Integrator(one)
    state = integrator.state
    state.cable[:n], state.robot[:] = linear.q, linear.robot
    state.contacts[:, ARC], state.contacts[:, BRISTLE : BRISTLE + 2] = linear.arcs, linear.bristles
    state.cable[n : 2 * n] = speed * shape[:n]
    state.robot[rb.VELOCITY : rb.SPIN_ANGLE] = speed * shape[n : n + 6]
    times, rows = np.linspace(0.0, stop, 400), []
    for start, end in pairwise(times):
        rows.append(state.robot[rb.VELOCITY : rb.SPIN_ANGLE].copy())
        integrator.advance(start, end)
    return times[:-1], np.array(rows)


@pytest.mark.parametrize("kind", ["bounce", "pendulum", "sway"])
@pytest.mark.parametrize("damped", [False, True])
def test_against_a_free_vibration(kind, damped):
    """A kick in the shape of a mode: frequency and damping of the motion, fitted over six periods; the contact's own
    nonlinearity is of the order of the kick, 1e-3 of what rest presses."""
    damping = {"cable.parameters.mass_damping": 4.0, "cable.parameters.damping_time": 0.03} if damped else {}
    one = problem("rig_10m", **{"landing.position": 4.0}, **damping)
    linear = at_rest(one)
    n = linear.q.size
    found = modes(linear, 12)
    k = found.bounce_and_pendulum[0] if kind == "bounce" else of_kind(found, kind)
    shape = found.shape[k].real
    main = int(np.argmax(np.abs(shape[n : n + 6])))
    f, zeta = found.frequency[k], found.damping_ratio[k]
    t, moved = released(one, linear, shape, 1e-4 / np.abs(shape[n : n + 6]).max(), 6.0 / f)

    def vibration(t, amplitude, frequency, ratio, phase):
        omega = 2.0 * np.pi * frequency
        return amplitude * np.exp(-ratio * omega * t) * np.cos(omega * np.sqrt(1.0 - ratio**2) * t + phase)

    (_, frequency, ratio, _), _ = curve_fit(vibration, t, moved[:, main], (moved[0, main], f, zeta, 0.0))
    assert frequency == pytest.approx(f, rel=1e-3)
    assert ratio == pytest.approx(zeta, rel=0.02, abs=1e-4)


def test_rest_is_rest():
    """The monolithic solver stays where `at_rest` has found rest: 1e-9 m/s is what 1e-11 m on 1e7 N/m gives a wheel."""
    one = problem("landing_200m_point9_physical")
    linear = at_rest(one)
    assert not linear.slides
    _, moved = released(one, linear, np.zeros(linear.q.size + 10), 0.0, 0.5)
    assert np.abs(moved).max() < 1e-8


def test_resonance_20_m_from_the_tower():
    """Without damping the landing rolls 42 degrees there; its bounce is 0.587 Hz, its pendulum 0.60 Hz."""
    found = of_scenario(scenario("landing_200m_point9_undamped"))
    bounce, pendulum = found.frequency[list(found.bounce_and_pendulum)]
    assert bounce == pytest.approx(0.587, abs=3e-3) and pendulum == pytest.approx(0.604, abs=3e-3)
    (text,) = found.warnings
    assert "2.7 % apart" in text and "does not prevent it" in text
    damped = of_scenario(scenario("landing_200m_point9_physical"))
    (text,) = damped.warnings
    assert "is stronger than that" in text


def test_close_but_not_coupled():
    """In the middle of a level line bounce and pendulum of table1 are close, but symmetry keeps them apart."""
    (text,) = of_scenario(scenario("landing_200m_midspan")).warnings
    assert text.startswith("bounce (0.6046 Hz) and pendulum (0.6009 Hz)") and "nothing couples them" in text
    assert not of_scenario(scenario("rig_10m")).warnings


def test_rest_is_that_under_the_thrust_which_a_course_ends_with():
    """Set down by a thrust that falls to zero, the robot rests as without any; one that stays carries its part."""
    plain, down = (at_rest(problem(name)) for name in ("rig_10m", "rig_10m_setdown"))
    assert down.robot[:3] == pytest.approx(plain.robot[:3], abs=1e-9)
    lifted = at_rest(problem("rig_10m", **{"robot.inputs.thrust": 100.0}))
    assert lifted.robot[2] > plain.robot[2] + 1e-3


def test_shares_and_modal_mass():
    found = of_scenario(scenario("rig_10m"))
    assert found.shares.sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    assert set(found.kinds) <= {*KINDS, "line"}
    assert np.all(np.diff(found.frequency) > 0.0)
    robot, mass = found.robot, found.linear.inertia
    assert np.einsum("ki,ij,kj->k", robot.conj(), mass, robot).real == pytest.approx(1.0 - found.shares[:, 6], abs=1e-9)


def test_a_free_wheel_has_rest_at_the_lowest_point_alone():
    free = {"robot.parameters.wheel[1].braked": "false"}
    with pytest.raises(InputError, match=r"has no rest where it lands, it rolls .* brake its wheels"):
        of_scenario(scenario("landing_200m_point9", **free))
    found = of_scenario(scenario("landing_200m_midspan", **free))
    assert "bounce" in found.kinds and not any("topples" in text for text in found.warnings)


def test_over_the_landing_position():
    """Mirror symmetry of a level line; the pendulum hardly depends on the place, the bounce does."""
    found = over_positions(scenario("rig_10m"), 3)
    assert found.position == pytest.approx([0.25, 5.0, 9.75])
    assert found.frequency[0] == pytest.approx(found.frequency[2], rel=1e-3)
    bounce, pendulum = found.frequency.T
    assert bounce[0] > 1.5 * bounce[1] and pendulum == pytest.approx(pendulum[1], rel=0.05)


def test_command(tmp_path):
    out = tmp_path / "modes"
    arguments = ["modes", "rig_10m", "--count", "5", "--positions", "2", "--out", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    with (out / "modes.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[:5] == ["mode", "kind", "frequency [Hz]", "damping ratio [1]", "growth [1/s]"]
    assert len(rows) == 5
    pendulum = next(row for row in rows if row[1] == "pendulum")
    assert float(pendulum[2]) == pytest.approx(0.59995, abs=1e-4)
    assert f"{float(pendulum[2]):.5g}" in result.output and len(result.output.splitlines()) < 10
    for name in ("modes.png", "positions.png"):
        assert (out / name).stat().st_size > 10_000
    with (out / "positions.csv").open() as file:
        assert next(csv.reader(file))[:2] == ["landing.position", "bounce.frequency"]


def test_another_robot_on_the_line():
    result = CliRunner().invoke(app, ["modes", "rig_10m", "--robot", "linedrone", "--count", "3"])
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["oscillator"], "there is none; modes are those of a landing"),
        (["rig_10m", "--count", "0"], "--count 0: must be 1 or more"),
    ],
)
def test_what_has_no_modes(arguments, message):
    result = CliRunner().invoke(app, ["modes", *arguments])
    assert result.exit_code == 2 and message in result.output
