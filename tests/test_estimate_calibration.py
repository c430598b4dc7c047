"""The error estimate against the monolithic solver: three landings of the grid it is calibrated on, and what is written.

The whole grid is measured by ``python docs/estimate.py``; `docs/estimate.json` has what it found.
"""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.errors import CONSTANT, RIGHT, differences, verdict_on
from orchestrator.runs.estimate import estimate_error, solved
from orchestrator.runs.systems import LandingSystem, resolve
from verification.coupling import estimate, estimate_grid, estimate_rows

DOCS = Path(__file__).resolve().parents[1] / "docs"
BRIEF = 0.25
"""s"""
HERE = [("rig", 0.01, {}), ("5 cm", 0.01, {"master.tolerance": 1e-5}), ("driving on the rig", 0.01, {})]


@pytest.mark.parametrize(("place", "step", "settings"), HERE, ids=[place for place, _, _ in HERE])
def test_estimate_of_a_landing_is_within_a_factor_three(place, step, settings):
    """Coupling and inner steps, against the monolithic solution on the same mesh, local tolerance 1e-10 m."""
    spec = estimate_grid.Spec("", place, estimate_grid.Coupling("interface_jacobian", step, settings))
    system = resolve(estimate_grid.scenario(spec).changed(stop_time=BRIEF))
    run = run_coupled(system)
    estimate_error(run, parts=("coupling", "inner_steps"))
    true = differences(run.table, solved(system, run.table["time"], lambda _: None, 1e-10), run.judged)
    moved = [name for name in run.judged if np.ptp(run.table[name]) > CONSTANT]  # not the roll at midspan
    assert len(moved) >= 2
    for name in moved:
        assert 1 / 3 < run.estimated_error[name] / true[name] < 3, name


def test_parts_that_are_not_wanted_are_not_made():
    run = run_coupled(estimate_grid.scenario(oscillator()))
    assert estimate_error(run, parts=("inner_steps",)) is None
    assert all(parts.known == {} for parts in run.error_parts.values())


def oscillator() -> estimate_grid.Spec:
    """The two masses, as they are in the grid."""
    return next(spec for spec in estimate_grid.specs() if spec.place == "oscillator")


def test_a_row_has_what_is_counted():
    """Of the oscillator, whose truth is exact."""
    rows = list(estimate_rows.measured(oscillator()))
    assert [row["signal"] for row in rows] == list(estimate_rows.POSITIONS)
    cases = estimate.judged(rows).cases
    assert len(cases) == 2 and all(one.right("finer") for one in cases)


def test_the_file_has_runs_of_the_grid_alone():
    rows = estimate_rows.read()
    assert {row["case"] for row in rows} <= {spec.words for spec in estimate_grid.specs()}
    assert {row["group"] for row in rows} == set(estimate_grid.GROUPS)


def test_pages_have_what_the_file_says():
    made = runpy.run_path(str(DOCS / "estimate.py"))
    text = made["PAGE"].read_text(encoding="utf-8")
    assert made["BLOCK"].search(text)
    assert made["filled"](text, json.loads(made["FILE"].read_text(encoding="utf-8"))) == text, "docs/estimate.py --fill"


def test_the_estimate_is_right_as_often_as_it_says():
    """Of peak forces, whose error is one signed number that may be small by chance, less often: too large then."""
    cases = estimate.judged(estimate_rows.read()).cases
    peaks = [one for one in cases if one.quantity == "peak force"]
    others = [one for one in cases if one.quantity != "peak force"]
    right, small, large = estimate.shares(cases, "finer")
    assert right >= 0.95 and small <= 0.025 and right + small + large == pytest.approx(1.0)
    assert RIGHT == {"finer": "19 of 20 cases (4 of 5 peak forces)", "coarser": "3 of 5 cases"}
    assert estimate.shares(others, "finer")[0] >= 19 / 20 and estimate.shares(peaks, "finer")[0] >= 4 / 5
    assert estimate.shares(cases, "coarser")[0] >= 3 / 5


HELD = {"max_iterations": 1, "max_depth": 0, "tolerance": 1e-14}
DOUBTFUL = [
    ("iqn_ils", 0.01, HELD, "macro steps of the second run did not converge"),
    ("jacobi", 0.05, {}, "half its range or more"),
]


@pytest.mark.parametrize(("master", "step", "options", "why"), DOUBTFUL, ids=["unconverged", "unstable"])
def test_an_estimate_that_no_calibration_speaks_for_says_so(tmp_path, master, step, options, why):
    settings = {f"master.{name}": value for name, value in options.items()}
    changes = {"master": master, "macro_step": step, "stop": 1.0, "set": settings | TOLERANT}
    run = orchestrator.run("oscillator", out=tmp_path / "out", pictures=False, **changes)
    assert any(why in line for line in run.estimate_doubts)
    assert any("not calibrated for this run" in line and why in line for line in run.warnings)
    words = {verdict_on(parts, 1e9, bool(run.estimate_doubts)) for parts in run.error_parts.values()}
    assert words == {"doubtful"}


TOLERANT = {"simulation.tolerances": {"left.position": 1e9, "right.position": 1e9}}


def test_a_sound_estimate_has_no_doubts():
    run = orchestrator.run("oscillator", stop=0.2)
    assert run.estimate_doubts == [] and not any("calibrated" in line for line in run.warnings)


@pytest.mark.parametrize(
    ("step", "exchange", "cable", "robot"),
    [
        (0.005, "waveform", 0.5, 0.5),
        (0.00125, "waveform", 0.5, 1.0),
        (0.01, "point", 1.0, 0.5),
        (0.0005, "point", 1.0, 1.0),
    ],
)
def test_inner_steps_that_the_finer_run_shortens_are_not_counted_twice(step, exchange, cable, robot):
    """The cable's is the macro step with `point`, a quarter of it with `waveform`; the robot's is 1 ms."""
    place = estimate_grid.Coupling("interface_jacobian", step, {"simulation.exchange": f"'{exchange}'"})
    system = resolve(estimate_grid.scenario(estimate_grid.Spec("", "rig", place)))
    assert isinstance(system, LandingSystem)
    kept, halved = system.stepped(1.0).landing, system.stepped(0.5, longest=0.5 * step).landing
    for part, ratio in (("cable", cable), ("robot", robot)):
        before, after = (getattr(one, part).settings["integration_step"] for one in (kept, halved))
        assert after == pytest.approx(ratio * before), part
