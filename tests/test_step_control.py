"""Adaptive steps: error against tolerance, against fixed steps on a hard impact, what is rolled back, and the local estimate.

Expected values: the analytic solution of the oscillator; the monolithic solution of a drop; integrals by quadrature.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.coupling.stepping.step_control import joined
from orchestrator.runs.compare import held_against
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.reference import solve_reference
from orchestrator.runs.summary import result
from orchestrator.scenario.read import load
from tests.fmus import MILD, oscillator, oscillator_solution
from tests.scenarios import DROP
from tests.systems import IMPLICIT, POSITIONS, faulty_oscillator, run

pytestmark = pytest.mark.portable


def controlled(master: str, tolerance: float):
    """The oscillator, its whole motion of 2 s in two macro steps."""
    options = {"local_tolerance": tolerance, "tolerance": 1e-11, "absolute": 1e-6}
    return run(oscillator(**MILD, waveform=True), master, 1.0, 2.0, POSITIONS, **options)


@pytest.mark.parametrize("master", IMPLICIT)
def test_error_follows_the_tolerance(master):
    """Local errors of order 5 below the tolerance: sub-steps as its power 1/5, global error as its power 4/5.

    Lengths are H/2^k, so that one tolerance may be met by a factor 2^5 too well: over six decades the slope is known to
    1.5/6 = 0.25.
    """
    tolerances = 10.0 ** -np.arange(3.0, 10.0)
    errors = []
    for tolerance in tolerances:
        log = controlled(master, tolerance)
        errors.append(np.max(np.abs(log.values - oscillator_solution(log.time, **MILD))))
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(0.8, abs=0.25)
    assert np.all(np.array(errors) < 10.0 * tolerances)


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian"])
def test_what_cannot_be_made_is_shortened_by_the_control(master):
    """An FMU that makes no step longer than 2.5 ms: halves of 1.25 ms or 2.5 ms, none of them sub-divided unseen."""
    log = run(faulty_oscillator(fault=1, longest_step=2.5e-3), master, 0.02, 0.1, POSITIONS, local_tolerance=1e-2)
    assert log.error is None and log.unconverged == 0
    assert log.steps[0].rejected >= 1
    assert all(step.subdivisions >= 7 for step in log.steps)
    assert all(np.isfinite(step.estimate) for step in log.steps)


def test_loads_of_two_halves_are_joined_in_the_mean():
    """Mean and slope of the best linear load, by Gauss quadrature of the two pieces."""
    h, first, second = 0.3, np.array([2.0, -5.0, 1.0]), np.array([3.5, 7.0, 4.0])
    nodes, weights = np.polynomial.legendre.leggauss(4)
    left, right = -h / 2 + h / 2 * nodes, h / 2 + h / 2 * nodes
    f = np.concatenate([first[0] + first[1] * (left + h / 2), second[0] + second[1] * (right - h / 2)])
    tau, w = np.concatenate([left, right]), np.tile(weights, 2) * h / 2
    scale = SimpleNamespace(load=np.array([0, 0, 2]))
    expected = [w @ f / (2 * h), w @ (f * tau) / (2 * h**3 / 3), 4.0]
    assert joined(scale, first, second, h) == pytest.approx(expected)  # type: ignore[arg-type]


def drop(macro_step: float, *settings: str):
    """The drop with k = 1e10, until 0.1 s after touch."""
    times = ["simulation.stop_time=0.2", f"simulation.macro_step={macro_step}"]
    hard = ["contact.parameters.stiffness=1e10", "cable.parameters.integration_step=0.00125"]
    return load(DROP, [*times, *hard, *settings])


HEIGHTS = [0.05 * (1.0 + 1e-12 * k) for k in range(5)]
"""m: starts that are the same but for round-off."""


def test_hard_impact_takes_fewer_solves_than_fixed_steps():
    """Macro steps of 20 ms, k = 1e10: fixed steps of 1.25 ms take more solves and are further from the monolithic height.

    The roll of both is what the impact leaves in the first tenth of a second. How many solves an impact takes is chaotic:
    a difference of 1e-12 in the height costs another rejected pair, a tenth of all solves, in one run of eight. The median
    of five is a tenth below the fixed steps; errors are smooth.
    """
    reference = solve_reference(drop(0.02), [0.00125])
    fixed = held_against(result(run_coupled(drop(0.00125))), reference)
    starts = [("master.local_tolerance=2e-6", f"landing.height={height}") for height in HEIGHTS]
    adaptive = [held_against(result(run_coupled(drop(0.02, *settings))), reference) for settings in starts]
    z, roll = "robot.body.position.z", "robot.roll"
    assert all(one.unconverged_steps == 0 for one in adaptive)
    assert np.median([one.cable_steps for one in adaptive]) < fixed.cable_steps
    assert max(one.signals[z].max_error for one in adaptive) < 0.5 * fixed.signals[z].max_error
    assert max(one.signals[roll].max_error for one in adaptive) < 1.1 * fixed.signals[roll].max_error


def test_steps_of_a_run_say_what_was_rejected():
    """A column beside the sub-steps; the touch of the drop is tried with a length that does not do."""
    table = run_coupled(drop(0.04, "master.local_tolerance=1e-6", "simulation.stop_time=0.12")).steps_table
    assert np.sum(table["rejected"]) >= 1
    assert table["subdivisions"][0] == 1 < table["subdivisions"][-1]
    assert np.all(table["estimate"] <= 1e-6)
