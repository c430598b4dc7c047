"""Signals of an interval at fewer communication points."""

from itertools import pairwise

import numpy as np
import pytest

from orchestrator.landing.intervals import coarsened


def test_largest_values_and_impulses_are_those_of_the_longer_intervals():
    """By loops over the intervals; all other signals are those at the points."""
    rng = np.random.default_rng(1)
    time, some = np.linspace(0.0, 1.0, 21), [0, 4, 5, 13, 20]
    names = ("contact1.normal_force_max", "contact2.impulse", "contact1.normal_force", "robot.body.z_max")
    table = {"time": time} | {name: rng.normal(size=21) for name in names}
    found = coarsened(table, time[some])
    for i, (first, last) in enumerate(pairwise(some), start=1):
        inside = slice(first + 1, last + 1)
        assert found["contact1.normal_force_max"][i] == table["contact1.normal_force_max"][inside].max()
        assert found["contact2.impulse"][i] == pytest.approx(table["contact2.impulse"][inside].sum(), rel=1e-13)
    for name in table:
        assert found[name][0] == table[name][0] and len(found[name]) == 5
    for name in ("time", "contact1.normal_force", "robot.body.z_max"):
        np.testing.assert_array_equal(found[name], table[name][some])


def test_all_points_change_nothing():
    table = {"time": np.arange(4.0), "contact1.impulse": np.arange(4.0), "contact1.slip_velocity_max": np.ones(4)}
    for name, values in coarsened(table, table["time"]).items():
        np.testing.assert_array_equal(values, table[name])
