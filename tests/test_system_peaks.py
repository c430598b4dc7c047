"""Peaks of whole runs: coupled against monolithic, and what is said where a step does not resolve an impact."""

import math

import numpy as np
import pytest

from fmus.contact.module import Contact
from orchestrator.landing import build as landing
from orchestrator.landing.impacts import Yielding, period
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.report.signals import extremes
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.summary import result, unresolved
from tests.scenarios import scenario

PEAK = "contact1.normal_force_max"
TABLE1 = Yielding(22075.0, 6580.0, 0.91, 38.0)


def contact(stiffness):
    made = Contact()
    Contact.table.assign(made.values, {"stiffness": stiffness})
    return made


def drop(macro_step, stiffness, stop=0.4, **sets):
    return scenario("drop_5cm", stop, None, macro_step, contact__parameters__stiffness=stiffness, **sets)


def monolithic(one, step, tolerance=2e-10):
    times = np.arange(round(one.simulation.stop_time / step) + 1) * step
    return {"time": times} | integrate(lambda: landing.problem(one), times, tolerance).signals


@pytest.mark.parametrize(("stiffness", "steps"), [(1e8, (0.002, 0.005)), (1e9, (0.002,)), (1e10, (0.001,))])
def test_peak_of_a_drop_where_the_step_resolves_it(stiffness, steps):
    """A step of at most a quarter of the contact's period gives the monolithic peak to 2 %, and nothing is said; the
    approach has 0.99 m/s, free fall over 5 cm."""
    reference = monolithic(drop(steps[0], stiffness), steps[0])
    for step in steps:
        assert step < 0.25 * period(contact(stiffness), TABLE1, 0.99)
        coupled = run_coupled(drop(step, stiffness))
        assert coupled.table[PEAK].max() == pytest.approx(reference[PEAK].max(), rel=0.02)
        assert not unresolved(coupled)
        # the two pieces of path before and after touch make one parabola: 1e-4 at 10 ms, of order 3 and more
        assert coupled.table["contact1.touch_time"][-1] == pytest.approx(math.sqrt(0.1 / 9.8), abs=2e-5)
    assert reference["contact1.touch_time"][-1] == pytest.approx(math.sqrt(0.1 / 9.8), abs=1e-9)


def test_monolithic_says_the_same_of_every_interval():
    """Same names, same intervals; coupled at 1 ms within 1 % of the range, the impulse within 1e-4."""
    one = drop(0.001, 1e8, stop=0.25)
    coupled, reference = run_coupled(one).table, monolithic(one, 0.001)
    for name in ("normal_force_max", "penetration_max", "radial_force"):
        scale = np.ptp(reference[f"contact1.{name}"])
        assert np.max(np.abs(coupled[f"contact1.{name}"] - reference[f"contact1.{name}"])) < 0.01 * scale
    assert coupled["contact1.impulse"].sum() == pytest.approx(reference["contact1.impulse"].sum(), rel=1e-4)
    assert np.all(reference[PEAK] >= reference["contact1.normal_force"])
    # the walls stand at half the groove angle to the radial direction, the wheel hangs in the middle
    half = np.sin(np.radians(50.0))
    for table in (coupled, reference):
        chord = table["contact1.radial_force"] / np.maximum(table["contact1.normal_force"], 1e-300)
        closed = table["contact1.normal_force"] > 1.0
        assert np.all(chord[closed] <= half * (1.0 + 1e-9)) and np.all(chord[closed] > 0.9 * half)
        assert np.max(np.abs(table["contact1.lateral_force"])) < 1e-3


def test_monolithic_peak_does_not_depend_on_the_output_times():
    one = drop(0.001, 1e10, stop=0.15)
    peaks = [monolithic(one, step)[PEAK].max() for step in (0.001, 0.05)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-4)


def test_an_unresolved_impact_is_said():
    """k = 1e11: the force rises within 0.8 ms. At 5 ms the peak is 10 % off, and the run says why and what helps."""
    coupled = run_coupled(drop(0.005, 1e11, stop=0.2))
    (said,) = unresolved(coupled)
    assert said["contact"] == "contact1" and said["speed"] == pytest.approx(0.97, abs=0.03)
    assert 0.25 * said["period"] == pytest.approx(8.3e-4, rel=0.05)
    run = result(coupled)
    (warning,) = [line for line in run.warnings if "resolve" in line]
    assert "contact1 meets the cable" in warning and "macro step of at most 0.000" in warning
    assert run.summary["extremes"]["contact1.normal_force"]["max"] == coupled.table[PEAK].max()
    rows = {row[0]: row for row in extremes(run.table)}
    assert float(rows["contact1.normal_force"][4]) == pytest.approx(coupled.table[PEAK].max(), rel=1e-4)


def test_what_yields_under_a_wheel():
    """Closed forms of an infinite string, 2 ω √(T ρA), and an infinite beam, 2√2 EI k³ with k⁴ = ρA ω²/EI; a mass ω² m
    between walls. Landau & Lifshitz, Theory of Elasticity, §25; Cremer & Heckl, Structure-borne Sound, §IV.3."""
    omega = 300.0
    assert Yielding(2e4, 0.0, 0.9).dynamic_stiffness(omega) == pytest.approx(2.0 * omega * math.sqrt(2e4 * 0.9))
    wave = (0.9 * omega**2 / 6580.0) ** 0.25
    expected = 2.0 * math.sqrt(2.0) * 6580.0 * wave**3
    assert Yielding(0.0, 6580.0, 0.9).dynamic_stiffness(omega) == pytest.approx(expected)
    assert Yielding(1e15, 0.0, 0.9, 38.0).dynamic_stiffness(omega) == pytest.approx(38.0 * omega**2, rel=1e-3)
    assert TABLE1.frequency(TABLE1.dynamic_stiffness(omega)) == pytest.approx(omega, rel=1e-6)


def test_stiffer_contacts_and_faster_impacts_are_shorter():
    """Of one mass m, stiffness ~ depth² in the middle of the groove and m v² ~ depth⁴: the period goes with v^(-1/2) and
    k^(-1/4), exactly on a mass between walls, for a contact that is short compared with the groove."""
    alone = Yielding(1e15, 0.0, 1.0, 0.7)
    periods = [period(contact(k), alone, v) for k, v in ((1e12, 0.1), (1e12, 0.4), (1.6e13, 0.1))]
    assert periods[1] == pytest.approx(0.5 * periods[0], rel=0.02)
    assert periods[2] == pytest.approx(0.5 * periods[0], rel=0.02)
