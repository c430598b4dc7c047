"""The budget of the energy that a coupling makes: kept at any tolerance, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.api import load_scenario
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.stepping.energy import DISSIPATED
from orchestrator.runs.coupled import Coupled, run_coupled

UNDAMPED = "landing_200m_point9_undamped"
ROUND_OFF = 1e-12
"""Of the energy exchanged: what the books cannot tell from nothing."""


def _run(scenario: str, stop: float, tolerance: float, budget: str | float, **changes: object) -> Coupled:
    settings = {"master.tolerance": tolerance, "master.energy_budget": budget} | changes
    return run_coupled(load_scenario(scenario, stop=stop, set=settings))


def _made(run: Coupled) -> np.ndarray:
    """Energy that all interfaces have made up to each communication point, J."""
    residuals = list(run.log.energy_residual.values())
    assert len(residuals) == 4  # force and moment on the line and on the robot: none is left out
    return np.sum(residuals, axis=0)


def _exchanged(run: Coupled) -> float:
    assert run.energy is not None
    return run.energy.exchanged


@pytest.mark.parametrize("tolerance", [1e-8, 1e-4, 1e-2])
@pytest.mark.parametrize("scenario", [UNDAMPED, "drop_5cm"])
def test_nothing_is_made_where_nothing_is_allowed(scenario: str, tolerance: float):
    """Expected: the sum is never above zero, at any communication point (`EnergyAccount`); the undamped line would keep what
    is made for ever, the drop has hard impacts."""
    run = _run(scenario, 0.2, tolerance, 0)
    assert np.max(_made(run)) <= ROUND_OFF * _exchanged(run)


def test_no_more_is_made_than_the_contact_has_dissipated():
    run = _run(UNDAMPED, 0.2, 1e-2, "dissipated")
    made, dissipated = _made(run), run.table[f"contact1.{DISSIPATED}"]
    assert np.all(made <= dissipated + ROUND_OFF * _exchanged(run))


def test_without_a_budget_a_loose_tolerance_makes_energy():
    """What the budget is for: at a tolerance of 1e-2 the residuals alone let 3e-5 of the energy exchanged pass, and more."""
    run = _run(UNDAMPED, 1.0, 1e-2, "none", **{"master.prediction": "polynomial"})
    assert np.max(_made(run)) > 1e-6 * _exchanged(run)


@pytest.mark.parametrize("master", ["iqn_ils", "anderson", "aitken"])
def test_every_implicit_master_keeps_it(master: str):
    run = _run("rig_10m", 0.05, 1e-3, 0, **{"simulation.master": master, "simulation.macro_step": 0.0005})
    assert np.max(_made(run)) <= ROUND_OFF * _exchanged(run)


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("budget", ["dissipated", 0])
@pytest.mark.parametrize("height", [0.0, 0.05])
def test_a_minute_on_an_undamped_line(height: float, tolerance: float, budget: str | float):
    """From touch, and after an impact at 1 m/s."""
    run = _run(UNDAMPED, 60.0, tolerance, budget, **{"landing.height": height})
    made, allowed = _made(run), run.table[f"contact1.{DISSIPATED}"] if budget else 0.0
    assert np.all(made <= allowed + ROUND_OFF * _exchanged(run))
    assert run.log.error is None


@pytest.mark.parametrize("iterations", [1, 2])
def test_steps_that_cannot_keep_it_are_divided_or_said_to_be_unconverged(iterations: int):
    """Expected: no iteration is left to correct the energy, so that steps are halved, and where that does not help they do not
    count as converged; never is more made in silence."""
    options = {"master.prediction": "polynomial", "master.max_iterations": iterations, "master.max_depth": 3}
    run = _run(UNDAMPED, 0.1, 1e-2, 0, **options)
    steps = run.log.steps_table
    over = np.diff(np.maximum.accumulate(_made(run))) > ROUND_OFF * _exchanged(run)
    assert np.sum(steps["rejected"]) > 0
    assert not np.any(over & (steps["converged"] == 1))


def test_a_budget_in_joules_is_used_and_kept():
    """Expected: with a tolerance of 1e-2 more than a microjoule would be made (above): it is used up, and no more."""
    run = _run(UNDAMPED, 1.0, 1e-2, 1e-6, **{"master.prediction": "polynomial"})
    assert 0.0 < np.max(_made(run)) <= 1e-6 + ROUND_OFF * _exchanged(run)


def test_budgets_that_do_not_exist():
    for budget in ("much", -3.0, np.nan, np.inf):
        with pytest.raises(
            InputError, match=f"energy_budget {budget!r}: choose dissipated, none or a number of joules"
        ):
            _run(UNDAMPED, 0.01, 1e-6, budget)
