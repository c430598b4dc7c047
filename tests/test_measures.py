"""Measures of signals, held against closed forms."""

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.studies import measures as m

TIME = np.linspace(0.0, 20.0, 1001)


def swinging(damping=0.2, omega=2.0, static=-0.5, start=-1.2):
    """A released spring: start + static (1 - e^(-ζωt) (cos ω_d t + ζω/ω_d sin ω_d t))."""
    decay, free = damping * omega, omega * np.sqrt(1.0 - damping**2)
    wave = np.cos(free * TIME) + decay / free * np.sin(free * TIME)
    return start + static * (1.0 - np.exp(-decay * TIME) * wave), np.pi / free, np.exp(-np.pi * decay / free)


def test_a_released_spring():
    values, half_period, ratio = swinging()
    assert m.start(TIME, values) == -1.2
    assert m.peak(TIME, values) == pytest.approx(-0.5 * (1.0 + ratio), abs=1e-6)
    assert m.peak_time(TIME, values) == pytest.approx(half_period, abs=1e-4)
    assert m.first_peak_time(TIME, values) == m.peak_time(TIME, values)
    assert m.lowest(TIME, values) == pytest.approx(-1.2 - 0.5 * (1.0 + ratio), abs=1e-6)
    left = np.exp(-0.4 * 18.0)  # of the swing, where the tail begins that is averaged
    assert m.settled(TIME, values) == pytest.approx(-1.7, abs=0.5 * left)
    assert m.change(TIME, values) == pytest.approx(-0.5, rel=left)
    assert m.overshoot(TIME, values) == pytest.approx(1.0 + ratio, rel=1.1 * left)
    assert m.swing(TIME, values) == pytest.approx(0.5, rel=1.1 * left)


def test_an_undamped_spring_overshoots_twice():
    values, _, _ = swinging(damping=1e-9, omega=0.5 * np.pi)
    assert m.peak(TIME, values) == pytest.approx(-1.0, abs=1e-6)


def test_settling_is_where_the_envelope_passes_five_per_cent():
    values = np.exp(-0.5 * TIME)
    assert m.settling_time(TIME, values) == pytest.approx(np.log(20.0) / 0.5, rel=0.01)
    assert m.settling_time(TIME, np.full(TIME.shape, 3.0)) == 0.0
    assert m.settling_time(TIME, np.sin(TIME)) > 18.0, "what never settles has not settled at the end"


def test_peaks_lie_between_the_rows():
    coarse = np.linspace(0.0, 10.0, 101)
    values = np.sin(coarse - 0.03)
    assert m.highest(coarse, values) == pytest.approx(1.0, abs=1e-5)
    assert m.band(coarse, values) == (m.lowest(coarse, values), m.highest(coarse, values))
    assert m.amplitude(coarse, values) == pytest.approx(1.0, abs=1e-5)


def test_a_growing_swing_has_a_first_peak_and_a_largest_one():
    time = TIME[:451]
    values = 0.1 * time * np.sin(2.0 * time)
    assert m.first_peak_time(time, values) == pytest.approx(1.0144, abs=2e-3), "tan 2t = -2t"
    assert m.peak_time(time, values) > 7.0


def test_an_unknown_measure_is_refused():
    with pytest.raises(InputError, match="did you mean peak_time"):
        m.measure_named("peaktime")
