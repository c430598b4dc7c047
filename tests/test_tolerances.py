"""What is built a little askew: a turned axle, a centre of mass off the middle; yaw and pitch have these causes."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.cable.assembly import interpolate
from fmus.contact import places as at
from fmus.robot.module import Robot, axle_in_body
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.landing.build import problem
from orchestrator.landing.resolve import resolve
from orchestrator.landing.seat import PRESSED, Wheel
from orchestrator.runs.coupled import run_coupled
from tests.scenarios import scenario

AXLE = "robot.parameters.wheel[1].axle_yaw"
MASS = "robot.parameters.center_of_mass.x"
ASKEW = {AXLE: '{ value = 1.2, unit = "deg" }'}
OFF = {MASS: '{ value = 0.3, unit = "mm" }'}


def test_axle_is_turned_by_tilt_then_yaw():
    robot, tilt, yaw = Robot(1), 0.3, -0.2
    angles = {"wheel[1].axle_direction.y": 0.5, "wheel[1].axle_tilt": tilt, "wheel[1].axle_yaw": yaw}
    robot.table.assign(robot.values, angles)
    expected = Rotation.from_euler("yz", [tilt, yaw]).apply([1.0, 0.5, 0.0]) / math.hypot(1.0, 0.5)
    np.testing.assert_allclose(axle_in_body(robot.values, robot.table, "wheel[1]"), expected, atol=1e-15)
    robot.initialize(0.0)
    axle = robot.values[robot.table.indices(f"wheel[1].axle.{i}" for i in "xyz")]
    np.testing.assert_allclose(axle, expected, atol=1e-15)


def test_a_robots_file_may_give_the_misalignment(tmp_path):
    path = tmp_path / "askew.toml"
    wheel = 'mount = { value = [0, 0, 0.2152], unit = "m", source = "x" }\nbraked = { value = true, source = "x" }\n'
    askew = 'axle_yaw = { value = -0.5, unit = "deg", source = "measured" }'
    path.write_text(f'extends = "fptlir"\n[[wheel]]\n{wheel}{askew}\n', encoding="utf-8")
    assert load_robot(path).parameters["wheel[1].axle_yaw"] == pytest.approx(math.radians(-0.5), rel=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1.2, -10.0])
def test_a_wheel_askew_starts_touching_and_not_pressed(angle):
    """It stands higher: the line touches a wall on each side before it lies in the middle of the groove."""
    landing = resolve(scenario("landing_200m_midspan", **{AXLE: math.radians(angle)}))
    straight = resolve(scenario("landing_200m_midspan"))
    higher = landing.placement.initial["initial.position.z"] - straight.placement.initial["initial.position.z"]
    assert higher == 0.0 if angle == 0.0 else 0.0 < higher < 2e-3
    seated = seat(landing)
    assert abs(seated.penetration(0.0)) < 1e-6 + PRESSED
    assert seated.motion[at.AXLE + 1] == pytest.approx(math.sin(math.radians(angle)), abs=1e-12)


def seat(landing):
    """The wheel of a landing on its line at the start."""
    modules = problem(landing)
    robot, cable = modules.robot, modules.cable
    centre, axle = (robot.values[robot.table.indices(f"wheel[1].{n}.{i}" for i in "xyz")] for n in ("position", "axle"))
    point = np.zeros(6)
    interpolate(
        cable.model, cable.state[: cable.model.weight.size], landing.placement.arc_lengths[0], np.zeros(8), point
    )
    return Wheel(1, point[:3], point[3:], centre, axle, modules.contacts[0])


@pytest.fixture(scope="module")
def landed():
    return run_coupled(scenario("landing_200m_midspan", 2.5, macro_step=0.01, **ASKEW, **OFF)).table


def test_a_turned_axle_gives_yaw(landed):
    """The groove turns the wheel along the line: yaw goes from 0 through -1.2 degrees, where nothing turns it, to about
    twice that, and back. Not exactly twice: the wall forces that turn it change as the robot bounces."""
    yaw = np.degrees(landed["robot.yaw"])
    assert yaw[0] == 0.0
    assert -3.0 < np.min(yaw) < -1.8
    assert np.max(yaw) < 1e-3
    assert yaw[-1] > np.min(yaw)


def test_a_body_turned_against_its_axle_keeps_its_yaw():
    """The wheel runs along the line from the start: nothing turns it, at midspan and with equal moments of inertia."""
    turned = {"robot.parameters.initial.yaw": math.radians(-1.2), AXLE: math.radians(1.2)}
    table = run_coupled(scenario("landing_200m_midspan", 1.0, macro_step=0.01, **turned)).table
    np.testing.assert_allclose(np.degrees(table["robot.yaw"]), -1.2, atol=1e-6)


def test_a_mass_off_the_middle_gives_pitch(landed):
    """The body hangs from the middle of the line, 0.172 m above b once the walls are pressed, G being 0.1 m below b: it
    is at rest at 0.3 mm / 0.272 m = 0.063 degrees. From 0 it swings past that, to less than twice it: the robot bounces,
    and what turns it is there while it hangs alone."""
    pitch = np.degrees(landed["robot.pitch"])
    rest = math.degrees(0.3e-3 / 0.272)
    assert rest < np.max(pitch) < 2.0 * rest
    assert np.min(pitch) > -rest
