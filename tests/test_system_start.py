"""Landings that begin in contact, just touching and above the line, against the monolithic solution from the start on."""

import numpy as np
import pytest
from scipy.optimize import root_scalar

from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import integrate, solve
from orchestrator.runs.components import opened
from tests.scenarios import scenario

pytestmark = pytest.mark.portable

STOP, STEP = 0.1, 0.005
Z, FORCE = "robot.body.position.z", "contact1.normal_force"
WEIGHT = 38.0 * 9.8
REST = 1e-13 * 200.0
"""m: the line at rest is found to 1e-13 of its length, and so is whether the robot touches it."""
HEIGHT = "initial.position.z"


def problem(one, shift):
    """The landing with its robot moved up by `shift`, m."""
    made = landing.problem(one)
    made.robot.values[made.robot.table.index[HEIGHT]] += shift
    made.robot.initialize(0.0)
    return made


def coupled(one, shift, master):
    times = one.simulation
    with opened(one) as graph:
        robot = graph.components["robot"]
        robot.set_parameters({HEIGHT: float(robot.read(HEIGHT)) + shift})
        return simulate(graph, MASTERS[master](graph), 0.0, times.stop_time, times.macro_step, [Z, FORCE])


def resting(one):
    """Return how far the robot stands in the line at rest, m: both walls together, at 50 degrees, carry its weight."""

    def excess(shift):
        start = integrate(lambda: problem(one, shift), np.array([0.0, 1e-5])).signals
        return start[FORCE][0] * np.sin(np.radians(50.0)) - WEIGHT

    return root_scalar(excess, bracket=(-2e-2, 0.0)).root


@pytest.mark.parametrize("master", ["interface_jacobian", "iqn_ils"])
@pytest.mark.parametrize("stiffness", [1e8, 1e10])
@pytest.mark.parametrize("start", ["in contact", "touching", "above"])
def test_start(start, stiffness, master):
    """The force at the first instant is the law's at the same pose; after that within the bar of the drops."""
    one = scenario(stop=STOP, macro_step=STEP, **{"contact__parameters__stiffness": stiffness})
    shift = resting(one) if start == "in contact" else {"touching": 0.0, "above": 0.01}[start]
    reference = solve(lambda: problem(one, shift), np.linspace(0.0, STOP, 21))
    log = coupled(one, shift, master)
    assert log.error is None and log.unconverged == 0
    assert log.signal(FORCE)[0] == pytest.approx(reference.signals[FORCE][0], rel=1e-9, abs=1e-9)
    if start == "in contact":  # `resting` finds the height to 2e-12 m, 1e-8 of the depth at k = 1e10
        assert log.signal(FORCE)[0] * np.sin(np.radians(50.0)) == pytest.approx(WEIGHT, rel=1e-6)
    else:
        assert log.signal(FORCE)[0] <= (stiffness * REST**2.5 if start == "touching" else 0.0)
    assert np.max(log.signal(FORCE)) > 100.0
    z = reference.signals[Z]
    assert reference.estimated_error[Z] < 1e-5 * np.ptp(z)
    assert np.max(np.abs(log.signal(Z) - z)) < 1e-4 * np.ptp(z)


@pytest.mark.parametrize("master", ["interface_jacobian", "iqn_ils"])
def test_hard_impact_within_a_long_step(master):
    """Impact at 1 m/s on k = 1e10 inside a step of 20 ms: the first iterates are wild, and one that is stuck there is no
    answer. Held to the bar of the drops."""
    one = scenario("drop_5cm", stop=0.2, macro_step=0.02, contact__parameters__stiffness=1e10)
    reference = solve(lambda: landing.problem(one), np.linspace(0.0, 0.2, 11)).signals[Z]
    log = coupled(one, 0.0, master)
    assert log.error is None and log.unconverged == 0
    assert np.max(np.abs(log.signal(Z) - reference)) < 1e-4 * np.ptp(reference)
