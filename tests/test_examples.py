"""Every example runs as it stands, in an empty folder, and shows what it must."""

from __future__ import annotations

import re
import runpy
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.fmus import needs_compiler

pytestmark = pytest.mark.usefixtures("coarse_pictures")
POSITION, MASS = "landing.position", "robot.parameters.mass"
FOLDER = Path(__file__).resolve().parents[1] / "examples"


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run an example by name and return its variables."""
    monkeypatch.chdir(tmp_path)
    return lambda name, **options: runpy.run_path(str(FOLDER / f"{name}.py"), **options)


def test_a_landing_swings_down_and_says_how_wrong_it_is(example: Any) -> None:
    shown = example("landing")
    run, z = shown["run"], shown["z"]
    assert 0.3 < z[0] - z.values.min() < 0.5  # the flagship goes down by 0.4 m
    assert run.summary["unconverged_steps"] == 0
    for name, error in run.estimated_error.items():
        assert 0.0 < error < 1e-3 * np.ptp(run.signals[name].values)


def test_a_heavier_robot_goes_deeper_and_two_wheels_have_two_contacts(example: Any) -> None:
    shown = example("swap_robot")
    depth = shown["depth"]
    assert depth["10 kg"] < depth["38 kg"] < depth["100 kg"]
    assert "contact2.normal_force" in shown["runs"]["two wheels"].signals


def test_the_own_line_has_the_sag_it_was_given(example: Any) -> None:
    height = example("own_line")["height"]
    assert -height[0] == pytest.approx(3.0, abs=1e-3)  # found to the mesh's accuracy, 1e-4 of the sag
    assert height.values.min() < height[0]


def test_results_are_the_same_from_disk(example: Any) -> None:
    shown = example("read_results")
    run, old = shown["run"], shown["old"]
    assert set(old.signals) == set(run.signals)
    for name in ("robot.body.position.z", "contact1.normal_force"):
        np.testing.assert_array_equal(old.signals[name].values, run.signals[name].values)
    assert shown["largest"] == shown["force"].values.max()
    assert shown["touch"] == pytest.approx(np.sqrt(2 * 0.05 / 9.8), abs=2e-5)  # a free fall of 5 cm, inside a step


def test_the_implicit_master_is_of_order_4_and_the_explicit_one_of_order_1(example: Any) -> None:
    orders = example("compare_masters")["comparison"].observed_order
    assert orders["iqn_ils"]["left.position"] == pytest.approx(4.0, abs=0.2)
    assert orders["gauss_seidel"]["left.position"] == pytest.approx(1.0, abs=0.2)


def test_a_study_finds_where_it_is_safe_how_surely_and_why(example: Any) -> None:
    shown = example("sweep_study", run_name="__main__")
    study, near = shown["study"], shown["near"]
    safe = {(p, m): s == 1.0 for p, m, s in zip(*(study.table[k] for k in (POSITION, MASS, "safe")), strict=True)}
    assert all(safe[p, 38.0] for p in (20.0, 60.0, 100.0)) and safe[20.0, 90.0] and not safe[100.0, 90.0]
    added = {p for p, m in safe if m == 90.0} - {20.0, 60.0, 100.0}
    assert added == {40.0}, "between 20 m, where 90 kg are safe, and 60 m"
    assert shown["chance"].count == 40 and len(near.table["run"]) == 40 + 8 * (2 + 2)
    indices = near.sensitivity[0].of["least_margin"]
    assert indices[MASS].total.estimate > indices["cable.parameters.mass_damping"].total.estimate
    assert Path("map.pdf").read_bytes().startswith(b"%PDF")


@needs_compiler
@pytest.mark.skipif(shutil.which("make") is None or shutil.which("gcc") is None, reason="no make, no gcc")
def test_a_robot_in_c_obeys_in_both_versions_of_fmi(example: Any) -> None:
    shown = example("robot_in_c")
    assert all(trial.passed for trial in shown["trials"].values())
    two, three = (shown["ends"][kind] for kind in ("c", "fmi3"))
    assert two == three  # the same code
    turn = -38.0 * (0.2152 + 0.1) / 5.42 * 0.1  # rad/s, about G; what it does to the lever is of order roll²
    assert two["body.velocity.y"] == pytest.approx(0.1 - 0.1 * turn, rel=1e-3) and two["roll"] == pytest.approx(
        turn / 20, rel=1e-3
    )


def test_every_example_is_tested_and_listed() -> None:
    names = {path.stem for path in FOLDER.glob("*.py")}
    listed = (FOLDER / "README.md").read_text()
    tested = Path(__file__).read_text() + Path(__file__).with_name("test_engine.py").read_text()
    assert [n for n in names if f"({n}.py)" not in listed or not re.search(rf'"{n}(\.py)?"', tested)] == []
