"""Parameters from data, held against closed forms: linear problems have all of it in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.studies.fit import Effort, Parameter, fit

TIME = np.linspace(0.0, 5.0, 60)


def decay(points: np.ndarray) -> np.ndarray:
    """Return a exp(-b t), (m, 60), of points (m, 2)."""
    return points[:, :1] * np.exp(-points[:, 1:2] * TIME)


def straight_line(points: np.ndarray) -> np.ndarray:
    """Return a + b t, (m, 60), of points (m, 2)."""
    return points[:, :1] + points[:, 1:2] * TIME


def test_parameters_of_exact_data_are_found():
    truth = np.array([[2.0, 0.7]])
    found = fit([Parameter("a", 0.1, 10.0, log=True), Parameter("b", 0.0, 2.0)], lambda p: decay(p) - decay(truth))
    assert found.values["a"] == pytest.approx(2.0, rel=1e-4)
    assert found.values["b"] == pytest.approx(0.7, rel=1e-4)
    assert found.scale == 1.0


def test_covariance_of_a_straight_line_is_that_of_linear_regression():
    """(A^T A)^-1 s^2 is exact for a model linear in its parameters; data with sigma 0.1 and known noise."""
    rng = np.random.default_rng(3)
    sigma = 0.1
    data = 1.0 + 0.5 * TIME + sigma * rng.standard_normal(TIME.size)
    parameters = [Parameter("a", -5.0, 5.0), Parameter("b", -5.0, 5.0)]
    found = fit(parameters, lambda p: (straight_line(p) - data) / sigma)
    design = np.column_stack([np.ones_like(TIME), TIME]) / sigma
    wanted, rest, *_ = np.linalg.lstsq(design, data / sigma, rcond=None)
    scale = max(1.0, float(rest[0]) / (TIME.size - 2))
    covariance = scale * np.linalg.inv(design.T @ design)
    deviation = np.sqrt(np.diag(covariance))
    assert [one.value for one in found.estimates] == pytest.approx(wanted, abs=0.02 * float(deviation.min()))
    assert [one.deviation for one in found.estimates] == pytest.approx(deviation, rel=1e-6)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / np.prod(deviation), rel=1e-6)
    for one in found.estimates:  # the profile of a linear problem is one standard deviation wide on either side
        assert one.interval is not None
        assert np.subtract(one.interval, one.value) == pytest.approx([-one.deviation, one.deviation], rel=0.06)


def test_data_that_are_missed_determine_less():
    """A model that cannot meet its data: the variances are multiplied by chi2 by degree of freedom."""
    data = straight_line(np.array([[1.0, 0.5]]))[0] + np.where(np.arange(TIME.size) % 2, 3.0, -3.0)
    found = fit([Parameter("a", -5.0, 5.0), Parameter("b", -5.0, 5.0)], lambda p: straight_line(p) - data)
    assert found.scale == pytest.approx(found.chi2 / (TIME.size - 2))
    assert found.scale > 5.0


def test_what_the_data_do_not_hold_is_not_determined():
    """Only a + c enters: neither is determined, whatever a search says of them; b is."""
    parameters = [Parameter("a", -1.0, 1.0), Parameter("b", -1.0, 1.0), Parameter("c", -1.0, 1.0)]
    truth = straight_line(np.array([[0.4, 0.2]]))
    found = fit(
        parameters,
        lambda p: straight_line(np.column_stack([p[:, 0] + p[:, 2], p[:, 1]])) - truth,
        Effort(profile=False),
    )
    assert [one.determined for one in found.estimates] == [False, True, False]
    assert found.estimates[0].deviation == np.inf
    assert found.values["a"] + found.values["c"] == pytest.approx(0.4, abs=1e-4)
    assert found.values["b"] == pytest.approx(0.2, abs=1e-4)


def test_a_value_at_its_bound_is_said():
    truth = straight_line(np.array([[3.0, 0.2]]))
    found = fit(
        [Parameter("a", -1.0, 1.0), Parameter("b", -1.0, 1.0)],
        lambda p: straight_line(p) - truth,
        Effort(profile=False),
    )
    assert found.estimates[0].at_bound == "high"
    assert found.estimates[1].at_bound == ""


def test_points_without_an_answer_are_avoided():
    truth = np.array([[2.0, 0.7]])

    def residuals(points: np.ndarray) -> np.ndarray:
        found = decay(points) - decay(truth)
        found[points[:, 1] < 0.5] = np.nan
        return found

    found = fit([Parameter("a", 0.1, 10.0), Parameter("b", 0.0, 2.0)], residuals, Effort(profile=False))
    assert found.values["b"] == pytest.approx(0.7, rel=1e-3)


def test_the_same_seed_gives_the_same_answer():
    truth = np.array([[2.0, 0.7]])
    parameters = [Parameter("a", 0.1, 10.0), Parameter("b", 0.0, 2.0)]
    first, second = (fit(parameters, lambda p: decay(p) - decay(truth), Effort(profile=False)) for _ in range(2))
    assert first.values == second.values
    assert first.evaluations == second.evaluations


def test_a_jump_beside_the_answer_does_not_hide_what_is_determined():
    """The second of two residuals jumps by 7 just above the answer, as the time of the highest of two peaks may."""
    truth = straight_line(np.array([[0.4, 0.2]]))

    def residuals(points: np.ndarray) -> np.ndarray:
        jump = np.where(points[:, :1] > 0.4 + 1e-5, 7.0, 0.0)
        return np.hstack([straight_line(points) - truth, jump])

    found = fit([Parameter("a", -1.0, 1.0), Parameter("b", -1.0, 1.0)], residuals, Effort(profile=False))
    design = np.column_stack([np.ones_like(TIME), TIME])
    deviation = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert [one.determined for one in found.estimates] == [True, True]
    assert [one.deviation for one in found.estimates] == pytest.approx(deviation, rel=1e-6)
