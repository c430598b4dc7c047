"""Symmetries of whole runs, coupled and monolithic: what is mirrored or turned moves mirrored or turned.

Tolerances are round-off (1e-16 of 200 m) times what the motion makes grow in the time of a run, at most 1e3.
"""

import numpy as np
import pytest

from fmus.kernels.rotations import from_rotation_vector, multiply
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import Integrator, integrate
from orchestrator.runs.coupled import run_coupled
from tests.scenarios import scenario

pytestmark = pytest.mark.portable

ROUND_OFF = 1e-10
"""m and rad, over 1 s."""
ITERATION = 1e-7
"""m and rad, what iterations leave where a symmetry holds up to round-off alone. A coupled run iterates to 1e-8 of the
largest force, 1e-5 N; on 38 kg (and 5 kg m² at 0.3 m) for 0.5 s that is up to 7e-8. The monolithic solver leaves 1e-12 m
a step, 1e-10 where round-off stops it: in the 830 steps of a second up to 8e-8."""
SPIN = 1e-6
"""rad/s: the same of an angular velocity, 1e-10 m in a step of 1.2 ms at 0.3 m: 3e-7."""


def run(kind, one):
    """The signals of a scenario, coupled or monolithic."""
    if kind == "coupled":
        return run_coupled(one).table
    times = np.arange(round(one.simulation.stop_time / 0.005) + 1) * 0.005
    return integrate(lambda: landing.problem(one), times).signals


@pytest.mark.parametrize("kind", ["coupled", "monolithic"])
def test_midspan_gives_no_roll(kind):
    """The cable, its mesh and the robot are symmetric about midspan."""
    table = run(kind, scenario("landing_200m_midspan"))
    assert np.ptp(table["robot.body.position.z"]) > 0.5
    assert np.max(np.abs(table["robot.roll"])) < ROUND_OFF
    assert np.max(np.abs(table["robot.body.position.y"] - 100.0)) < ROUND_OFF
    assert np.max(np.abs(table["robot.body.position.x"])) < ROUND_OFF


@pytest.mark.parametrize("kind", ["coupled", "monolithic"])
def test_mirrored_landing_points(kind):
    """20 m and 180 m: the same height, roll and lateral axis reversed. The nodes of the mesh are mirrored to 1e-12."""
    left = run(kind, scenario(stop=0.5, master__tolerance=1e-8))
    right = run(kind, scenario(stop=0.5, master__tolerance=1e-8, **{"landing.position": 180.0}))
    assert np.max(np.abs(left["robot.roll"])) > 1e-3
    for name, sign, offset in (("body.position.z", 1, 0), ("body.position.y", -1, 200), ("roll", -1, 0)):
        mirrored = offset + sign * right[f"robot.{name}"]
        np.testing.assert_allclose(left[f"robot.{name}"], mirrored, atol=ITERATION, rtol=0.0)


@pytest.mark.parametrize("kind", ["coupled", "monolithic"])
def test_mirrored_in_x(kind):
    """A push to one side and to the other, with the yaw to match."""
    push = {"robot.parameters.initial.velocity.x": 0.05, "robot.parameters.initial.yaw": 0.03}
    pushed = [{k: s * v for k, v in push.items()} for s in (1, -1)]
    one, other = (run(kind, scenario(stop=0.5, master__tolerance=1e-8, **push)) for push in pushed)
    assert np.max(np.abs(one["robot.body.position.x"])) > 1e-3
    signs = {"body.position.x": -1, "body.position.y": 1, "body.position.z": 1, "roll": 1, "pitch": -1, "yaw": -1}
    for name, sign in signs.items():
        np.testing.assert_allclose(one[f"robot.{name}"], sign * other[f"robot.{name}"], atol=ITERATION, rtol=0.0)


def test_everything_turned_about_the_vertical():
    """Supports, cable and robot turned by 0.7 rad: the monolithic motion is the same, turned.

    At 1e-9 m both make the same steps, the longest allowed; what Newton's method leaves chooses none of them.
    """
    push = {"robot.parameters.initial.velocity.x": 0.05}
    plain, turned = (Integrator(landing.problem(scenario(**push)), 1e-9) for _ in range(2))
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    n = turned.system.model.weight.size
    state = turned.state
    for part in (state.cable[:n], state.cable[n : 2 * n], state.robot[0:3], state.robot[7:10], state.robot[10:13]):
        part[:] = (part.reshape(-1, 3) @ turn.T).ravel()
    rotation, attitude = np.zeros(4), np.zeros(4)
    from_rotation_vector(np.array([0.0, 0.0, angle]), rotation)
    multiply(rotation, state.robot[3:7].copy(), attitude)
    state.robot[3:7] = attitude
    for integrator in (plain, turned):
        for i in range(200):
            integrator.advance(0.005 * i, 0.005 * (i + 1))
    expected = (plain.state.cable[:n].reshape(-1, 3) @ turn.T).ravel()
    np.testing.assert_allclose(turned.state.cable[:n], expected, atol=ITERATION, rtol=0.0)
    for place, left in ((slice(0, 3), ITERATION), (slice(10, 13), SPIN)):
        np.testing.assert_allclose(turned.state.robot[place], turn @ plain.state.robot[place], atol=left, rtol=0.0)
    multiply(rotation, plain.state.robot[3:7].copy(), attitude)
    np.testing.assert_allclose(turned.state.robot[3:7], attitude, atol=ITERATION, rtol=0.0)
