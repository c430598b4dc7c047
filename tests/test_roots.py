"""Brent's method: the same as SciPy's, so that it may stand in its place."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from fmus.kernels.roots import root

FUNCTIONS: dict[str, Callable[[float], float]] = {
    "line": lambda x: 3.0 * x - 0.7,
    "cubic": lambda x: (x - 0.3) * (x * x + 1.0),
    "flat": lambda x: (x - 0.1) ** 3 + 0.01 * (x - 0.1),
    "steep": lambda x: np.arctan(1e6 * (x - 0.2)),
    "exponential": lambda x: np.exp(20.0 * x) - 5.0,
    "catenary": lambda x: np.sinh(x) - 1.7 * x + 0.01,
    "step": lambda x: -1.0 if x < 1.0 / 3.0 else 2.0,
}


@pytest.mark.parametrize("name", FUNCTIONS)
@given(low=st.floats(-5.0, 0.0), high=st.floats(0.4, 5.0), rtol=st.sampled_from([4.0 * 2.0**-52, 1e-14, 1e-6]))
@settings(max_examples=60, deadline=None)
def test_a_root_is_that_of_scipy(name: str, low: float, high: float, rtol: float):
    function = FUNCTIONS[name]
    if function(low) * function(high) > 0.0:
        with pytest.raises(ValueError, match="different signs"):
            root(function, low, high)
    else:
        for xtol, limit in ((2e-12, rtol), (1e-5, 4.0 * 2.0**-52)):
            found = root(function, low, high, xtol, limit)
            peer = float(brentq(function, low, high, xtol=xtol, rtol=limit))
            assert abs(found - peer) <= 2.0 * (xtol + limit * abs(peer))  # each may be off by what it was allowed


def test_an_end_of_the_bracket_may_be_the_root():
    assert root(lambda x: x - 1.0, 1.0, 2.0) == 1.0 and root(lambda x: x - 2.0, 1.0, 2.0) == 2.0


def test_a_function_without_numbers_has_no_root():
    with pytest.raises(ValueError, match="not a number"):
        root(lambda x: float("nan") if 0.2 < x < 0.8 else x - 0.5, 0.0, 1.0)
