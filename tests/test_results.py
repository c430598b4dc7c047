"""Run directories, and the arithmetic of the comparison."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.util import read_csv
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.compare import communication_times, matching_rows, observed_order, signal_errors
from orchestrator.coupling.run.results import read_fields, read_json, read_table, replacing
from orchestrator.runs.compare import Comparison, Reference, RunErrors
from orchestrator.runs.directory import RunDirectory, claimed
from orchestrator.runs.errors import CONSTANT, range_of
from orchestrator.runs.reference import common_divisor


@pytest.fixture
def directory(tmp_path: Path) -> RunDirectory:
    return RunDirectory(tmp_path / "run")


def table(values: np.ndarray) -> dict[str, np.ndarray]:
    return {"time": np.arange(values.size) * 0.1, "robot.wheel[1].position.x": values}


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
@settings(max_examples=50, deadline=None)
def test_a_table_reads_back_bit_for_bit(tmp_path_factory, numbers):
    directory = RunDirectory(tmp_path_factory.mktemp("bits") / "run")
    written = table(np.array(numbers))
    directory.write_table("results.csv", written)
    read = read_table(directory.path / "results.csv")
    assert list(read) == list(written)
    assert all(np.array_equal(read[name], written[name]) for name in written)


def test_the_table_is_in_fmpy_s_format(directory: RunDirectory):
    directory.write_table("results.csv", table(np.array([1.0, 2.5e-17, -3.0])))
    first = (directory.path / "results.csv").read_text().splitlines()[0]
    assert first == '"time","robot.wheel[1].position.x"'
    read = read_csv(directory.path / "results.csv")
    assert read["robot.wheel[1].position.x"].tolist() == [1.0, 2.5e-17, -3.0]


def test_flags_and_integers_are_numbers(directory: RunDirectory):
    directory.write_table("iterations.csv", {"time": np.array([0.1]), "converged": np.array([True])})
    assert read_table(directory.path / "iterations.csv")["converged"].tolist() == [1.0]


def test_an_existing_directory_is_not_touched(tmp_path: Path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "precious").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        RunDirectory(tmp_path / "run")
    assert (tmp_path / "run" / "precious").read_text() == "mine"


def test_a_failed_write_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_json_has_no_nan(directory: RunDirectory):
    directory.write_json("a.json", {"a": float("nan"), "b": np.float64(2.0), "c": np.array([1, 2]), "d": Path("x")})
    text = (directory.path / "a.json").read_text()
    assert json.loads(text) == {"a": None, "b": 2.0, "c": [1, 2], "d": "x"}


def test_fields_read_back_with_units(directory: RunDirectory):
    import h5py

    fields = {"time": np.arange(3.0), "position": np.random.default_rng(0).normal(size=(3, 4, 3))}
    directory.write_fields("fields.h5", fields, {"time": "s", "position": "m"})
    read = read_fields(directory.path / "fields.h5")
    assert all(np.array_equal(read[name], fields[name]) for name in fields)
    with h5py.File(directory.path / "fields.h5") as file:
        assert file["position"].attrs["unit"] == "m"


@pytest.mark.parametrize(("error", "complete"), [(None, True), ("the cable failed at t = 1 s", False)])
def test_manifest(directory: RunDirectory, error: str | None, complete: bool):
    directory.write_manifest({"scenario": "a.toml"}, error)
    content = read_json(directory.path / "manifest.json")
    assert content["complete"] is complete and content["error"] == error
    assert {"scenario", "versions", "commit", "platform", "written"} <= set(content)


def test_default_directories_are_counted(tmp_path: Path):
    assert RunDirectory.numbered("a", tmp_path).path.name == "a-001"
    assert RunDirectory.numbered("a", tmp_path).path == tmp_path / "a-002"
    assert (tmp_path / "a-002").is_dir()  # it is made at once, so that no other run takes it


CLAIM = """
import sys
from pathlib import Path
from orchestrator.runs.directory import RunDirectory
print("ready", flush=True)
sys.stdin.readline()
for _ in range(5):
    print(RunDirectory.numbered("a", Path(sys.argv[1])).path.name)
"""


def test_runs_that_start_at_the_same_moment_get_a_folder_each(tmp_path: Path):
    """Four processes claim five folders each, all from the same instant on: twenty folders, numbered 1 to 20."""
    command, pipes = [sys.executable, "-c", CLAIM, str(tmp_path)], {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    processes = [subprocess.Popen(command, **pipes, text=True) for _ in range(4)]
    assert [process.stdout.readline() for process in processes if process.stdout] == ["ready\n"] * 4
    for process in processes:  # all wait; what they do takes longer than to write a line to each
        if process.stdin:
            process.stdin.write("go\n")
            process.stdin.flush()
    names = [name for process in processes for name in process.communicate()[0].split()]
    assert sorted(names) == [f"a-{number:03d}" for number in range(1, 21)]


def test_a_run_that_fails_at_its_start_leaves_no_folder(tmp_path: Path):
    with pytest.raises(RuntimeError), claimed(tmp_path / "out", "a"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_has_written_keeps_its_folder(tmp_path: Path):
    with pytest.raises(RuntimeError), claimed(tmp_path / "out", "a") as directory:
        directory.write_json("summary.json", {})
        raise RuntimeError
    assert (tmp_path / "out" / "summary.json").is_file()


def test_unreadable_results_are_named(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.csv"):
        read_table(tmp_path / "none.csv")


def test_errors_by_hand():
    """Reference 0, 2, 4 (peak-to-peak 4), run 0, 2.5, 4: largest 0.5, rms 0.5/sqrt(3), relative 0.125."""
    time = np.array([0.0, 1.0, 2.0])
    reference = {"time": time, "z": np.array([0.0, 2.0, 4.0]), "only.here": time}
    error = signal_errors({"time": time, "z": np.array([0.0, 2.5, 4.0])}, reference)["z"]
    assert (error.max_error, error.scale, error.relative_max_error) == (0.5, 4.0, 0.125)
    assert error.rms_error == pytest.approx(0.5 / np.sqrt(3.0), rel=1e-15)


def test_errors_are_taken_at_the_run_s_own_communication_points():
    fine = {"time": np.linspace(0.0, 1.0, 11), "z": np.linspace(0.0, 1.0, 11) ** 2}
    coarse = {"time": np.array([0.0, 0.5, 1.0]), "z": np.array([0.0, 0.25, 1.0])}
    assert signal_errors(coarse, fine)["z"].max_error == pytest.approx(0.0, abs=1e-15)


def test_a_constant_reference_has_no_scale():
    time = np.array([0.0, 1.0])
    same, other = np.array([3.0, 3.0]), np.array([3.0, 4.0])
    assert signal_errors({"time": time, "z": same}, {"time": time, "z": same})["z"].relative_max_error == 0.0
    assert np.isinf(signal_errors({"time": time, "z": other}, {"time": time, "z": same})["z"].relative_max_error)


def test_times_missing_from_the_reference_are_an_error():
    with pytest.raises(ValueError, match=r"no value at t = 0\.3 s"):
        matching_rows(np.array([0.0, 0.2, 0.4]), np.array([0.0, 0.3]))


@given(st.sampled_from([0.01, 0.005, 0.002, 0.0025, 0.001, 1 / 3]), st.sampled_from([0.01, 0.004, 0.1, 1 / 7]))
@settings(deadline=None)
def test_common_times_hold_every_communication_point_once(a: float, b: float):
    stop = 1.0
    times = communication_times(stop, [a, b])
    assert np.all(np.diff(times) > 1e-9)
    for step in (a, b):
        wanted = np.arange(round(stop / step) + 1) * step
        assert np.allclose(times[matching_rows(times, wanted)], wanted, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
def test_observed_order_of_a_power(order: float):
    steps = np.array([0.01, 0.005, 0.002])
    assert observed_order(steps, 3.0 * steps**order) == pytest.approx(order, abs=1e-12)


def test_no_order_from_one_step_or_from_zero():
    assert np.isnan(observed_order([0.01], [1.0])) and np.isnan(observed_order([0.01, 0.005], [1.0, 0.0]))


@pytest.mark.parametrize(
    ("steps", "divisor"), [([0.01, 0.005], 0.005), ([0.005, 0.002], 0.001), ([0.1], 0.1), ([1 / 3, 1 / 4], 1 / 12)]
)
def test_common_divisor(steps: list[float], divisor: float):
    assert common_divisor(steps) == pytest.approx(divisor, rel=1e-9)


def comparison(error: float, estimate: float | None) -> Comparison:
    time = np.linspace(0.0, 1.0, 3)
    reference = Reference("monolithic", {"time": time, "z": time}, 1.0, {} if estimate is None else {"z": estimate})
    runs = [
        RunErrors(
            "m", h, 2, 1.0, 0, 2, 1.0, signal_errors({"time": time, "z": time + error * h / 0.1}, reference.table)
        )
        for h in (0.1, 0.2)
    ]
    return Comparison(reference, runs, {"z": 1e-2})


@pytest.mark.parametrize(
    ("error", "estimate", "passed", "note"),
    [
        (4e-3, 1e-4, True, ""),
        (6e-3, 1e-4, False, ""),  # 6e-3 at 0.1 s is 12e-3 at 0.2 s
        (4e-3, 2e-3, False, "reference not accurate enough"),
        (4e-3, None, False, "does not say how accurate"),
    ],
)
def test_verdict(error: float, estimate: float | None, passed: bool, note: str):
    found = comparison(error, estimate)
    assert found.passed is passed
    assert found.content()["verdict"] == ("pass" if passed else "fail")
    assert all(note in check.note for check in found.checks)
    assert found.observed_order["m"]["z"] == pytest.approx(1.0, abs=1e-9)


def test_a_tolerance_for_an_unknown_signal_is_not_met():
    found = comparison(0.0, 0.0)
    found.tolerance["y"] = 1.0
    assert not found.passed


def test_comparison_json_has_the_agreed_keys_and_reads_back(directory: RunDirectory):
    found = comparison(4e-3, 1e-4)
    directory.write_json("comparison.json", found.content())
    content = read_json(directory.path / "comparison.json")
    assert set(content) == {"reference", "runs", "observed_order", "tolerance", "verdict"}
    assert set(content["reference"]) == {"kind", "wall_s", "estimated_error"}
    keys = {"master", "macro_step", "steps", "iterations_per_step", "unconverged_steps", "cable_steps", "wall_s"}
    assert set(content["runs"][0]) == keys | {"signals", "errors"}
    assert set(content["runs"][0]["signals"]["z"]) == {"max_error", "rms_error", "scale", "relative_max_error"}
    assert Comparison.from_content(content, found.reference.table).content() == found.content()


def test_a_signal_that_does_not_move_is_judged_by_its_size():
    """One that moves by its peak-to-peak, whatever its size."""
    still, moving = np.full(3, -0.2), np.array([-20.0, -20.0 + 2e-6, -20.0])
    assert range_of(still) == 0.2 and range_of(np.array([-0.2, -0.2 + 1e-16, -0.2])) == pytest.approx(0.2, rel=1e-12)
    assert range_of(moving) == np.ptp(moving)
    assert range_of(np.zeros(3)) == range_of(1e-20 * moving) == CONSTANT
