"""The Python interface: what `orchestrator.run` and `compare` return, in memory and read back."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest

import orchestrator
from orchestrator.api import Unfinished
from orchestrator.runs import reference
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.scenarios import LANDING, OSCILLATOR, ROOT, exact_oscillator

pytestmark = pytest.mark.usefixtures("coarse_pictures")
SHORT = {"stop": 0.2, "estimate": "none"}


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory) -> orchestrator.Run:
    return orchestrator.run(OSCILLATOR, stop=0.5, out=tmp_path_factory.mktemp("api") / "run")


@pytest.fixture(scope="module")
def comparison(tmp_path_factory) -> orchestrator.Comparison:
    out = tmp_path_factory.mktemp("api") / "comparison"
    steps, masters = [0.02, 0.01], ["iqn_ils", "gauss_seidel"]
    return orchestrator.compare(OSCILLATOR, masters=masters, macro_steps=steps, stop=0.2, out=out, pictures=False)


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    """Whether two tables have the same columns, bit for bit and of the same type."""
    alike = all(a[name].dtype == b[name].dtype and a[name].tobytes() == b[name].tobytes() for name in a)
    return list(a) == list(b) and alike


def test_import_brings_nothing_heavy():
    """What takes time is imported when it is used, so that ``--help`` is quick."""
    code = "import sys, orchestrator; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"numpy", "numba", "pydantic", "fmpy", "orchestrator.api"} & set(done.stdout.split())


def test_every_name_is_there():
    assert all(getattr(orchestrator, name) is not None for name in orchestrator.__all__)
    assert set(orchestrator.__all__) <= set(dir(orchestrator))
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        _ = orchestrator.fly


def test_signals_are_labelled_arrays(oscillator: orchestrator.Run):
    left = oscillator["left.position"]
    assert (left.name, left.unit, len(left)) == ("left.position", "m", 51)
    assert np.array_equal(left.time, np.arange(51) * 0.01) and np.array_equal(left.time, oscillator.time)
    assert np.max(np.abs(np.asarray(left) - exact_oscillator(left.time)[0])) < 1e-5
    assert left[-1] == left.values[-1] and list(left) == left.values.tolist()
    assert np.array(left, copy=True) is not left.values and np.ptp(left) == np.ptp(left.values)
    assert repr(left) == "Signal(left.position [m], 51 values)"
    assert oscillator.signals["right.velocity"].unit == "m/s" and "time" not in oscillator.signals


def test_a_run_says_how_it_went(oscillator: orchestrator.Run):
    assert (oscillator.verdict, oscillator.exit_status, oscillator.warnings) == ("within", 0, [])
    assert len(oscillator.iterations["iterations"]) == 50 and oscillator.iterations["converged"].all()
    assert 0.0 < oscillator.estimated_error["left.position"] < 1e-5
    assert repr(oscillator) == f"Run(oscillator: iqn_ils, 50 steps of 0.01 s, within; {oscillator.directory})"


def test_a_run_read_back_is_the_same(oscillator: orchestrator.Run):
    assert oscillator.directory is not None
    read = orchestrator.load_run(oscillator.directory)
    assert same(read.table, oscillator.table) and same(read.iterations, oscillator.iterations)
    assert (read.summary, read.manifest) == (oscillator.summary, oscillator.manifest)
    assert read.estimated_error == oscillator.estimated_error
    assert repr(read) == repr(oscillator)


def test_a_landing_read_back_is_the_same(tmp_path: Path):
    run = orchestrator.run(LANDING, stop=0.02, estimate="none", out=tmp_path / "out", pictures=False)
    read = orchestrator.load_run(tmp_path / "out")
    assert same(read.table, run.table) and same(read.fields, run.fields) and read.summary == run.summary
    assert same(read.iterations, run.iterations)
    assert (run["robot.roll"].unit, run["contact1.normal_force"].unit) == ("rad", "N")
    assert read.energy is not None and run.energy is not None and read.energy.drift == run.energy.drift
    assert not (tmp_path / "out" / "plots").exists()


def test_in_memory_nothing_is_written(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = orchestrator.run(OSCILLATOR, **SHORT)
    assert run.directory is None and list(tmp_path.iterdir()) == []


def test_out_true_numbers_the_folder(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runs = [orchestrator.run(OSCILLATOR, **SHORT, out=True, pictures=False) for _ in range(2)]
    assert [run.directory for run in runs] == [Path("runs/oscillator-001"), Path("runs/oscillator-002")]


def test_a_scenario_by_its_name():
    assert orchestrator.load_scenario("oscillator").path.name == "oscillator.toml"


SETTINGS = {
    "title": 'a "quoted" ü',
    "components.left.parameters.mass": np.float64(2.0),
    "components.right.parameters.stiffness": 3,
    "connections": ["left.position -> right.neighbour.position"],
    "simulation.tolerances": {"left.position": 1e-05},
}


def test_values_of_python_are_those_of_toml():
    scenario = orchestrator.load_scenario(OSCILLATOR, set=SETTINGS, stop=1, macro_step=0.5, estimate="coarser")
    written = scenario.model_dump()
    assert written["title"] == SETTINGS["title"] and written["connections"] == SETTINGS["connections"]
    assert written["components"]["left"]["parameters"]["mass"] == 2.0
    assert written["components"]["right"]["parameters"]["stiffness"] == 3
    simulation = written["simulation"]
    assert simulation["tolerances"]["left.position"] == 1e-05 and simulation["estimate"] == "coarser"
    assert (simulation["stop_time"], simulation["macro_step"]) == (1.0, 0.5)


def test_a_loaded_scenario_gives_the_same_as_its_file():
    options = {"master": "gauss_seidel", "macro_step": 0.005, **SHORT}
    loaded, again = (orchestrator.run(one, **options) for one in (orchestrator.load_scenario(OSCILLATOR), OSCILLATOR))
    assert same(loaded.table, again.table)
    assert loaded.manifest["resolved"] == again.manifest["resolved"]
    with pytest.raises(orchestrator.InputError, match="is loaded already"):
        orchestrator.run(orchestrator.load_scenario(OSCILLATOR), set={"title": "x"})
    with pytest.raises(orchestrator.InputError, match="did you mean jacobi"):
        orchestrator.run(orchestrator.load_scenario(OSCILLATOR), master="jacoby")


def test_python_and_the_command_line_give_the_same(oscillator: orchestrator.Run, tmp_path: Path):
    command = [sys.executable, "-m", "orchestrator", "run", str(OSCILLATOR), "--stop", "0.5", "--out", "out", "--quiet"]
    subprocess.run([*command, "--no-pictures"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    assert same(orchestrator.load_run(tmp_path / "out").table, oscillator.table)


def test_progress_is_told():
    told = []
    orchestrator.run(OSCILLATOR, stop=0.1, macro_step=0.05, progress=lambda *what: told.append(what))
    assert told[:2] == [("iqn_ils_0.05s", 0.05, 0.1), ("iqn_ils_0.05s", 0.1, 0.1)]
    assert {task for task, _, _ in told[2:]} == {"error estimate: coupling and macro step"}


def test_a_run_in_a_thread(oscillator: orchestrator.Run):
    """As in a server or a notebook's widget; signals of the system belong to the main thread."""
    with ThreadPoolExecutor(1) as pool:
        run = pool.submit(orchestrator.run, OSCILLATOR, stop=0.5).result()
    assert same(run.table, oscillator.table)


def test_ctrl_c_keeps_what_was_reached():
    def press(task: str, time: float, stop: float) -> None:
        if time > 0.1:
            signal.raise_signal(signal.SIGINT)

    run = orchestrator.run(OSCILLATOR, **SHORT, progress=press)
    assert (run.verdict, run.exit_status, run.error) == ("interrupted", 130, "interrupted at t = 0.11 s")
    assert run.time[-1] == pytest.approx(0.11)


def test_wrong_input_names_all_problems():
    with pytest.raises(orchestrator.InputError) as error:
        orchestrator.run(OSCILLATOR, master="jacoby", set={"components.left.parameters.mas": 1.0})
    assert "did you mean jacobi" in str(error.value) and "did you mean mass" in str(error.value)


def test_an_existing_directory_is_refused_before_the_run(tmp_path: Path):
    with pytest.raises(orchestrator.InputError, match="exists already"):
        orchestrator.run(OSCILLATOR, out=tmp_path)


def test_wrong_input_leaves_no_directory(tmp_path: Path):
    with pytest.raises(orchestrator.InputError, match="no such signal"):
        orchestrator.run(OSCILLATOR, out=tmp_path / "out", set={"simulation.tolerances": {"left.height": 1e-3}})
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_on_its_way_is_returned(tmp_path: Path):
    """At 1e308 m/s, without a spring, the position overflows after 1.8 s."""
    zero = {f"components.{s}.parameters.{k}": 0.0 for s in ("left", "right") for k in ("stiffness", "damping")}
    zero |= {f"components.right.parameters.coupling_{k}": 0.0 for k in ("stiffness", "damping")}
    fast = zero | {"components.left.parameters.initial_velocity": 1e308}
    run = orchestrator.run(OSCILLATOR, set=fast, master="jacobi", out=tmp_path / "out", pictures=False)
    assert (run.verdict, run.exit_status) == ("failed", 3) and 1.5 < run.time[-1] < 2.0
    assert run.error is not None and "left" in run.error and run.warnings[-1].startswith(run.error)
    read = orchestrator.load_run(tmp_path / "out")
    assert read.verdict == "failed" and same(read.table, run.table)


def test_a_picture_that_fails_loses_no_run(tmp_path: Path, monkeypatch):
    def fail(*_, **__):
        raise ValueError("no ink")

    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", fail)
    run = orchestrator.run(OSCILLATOR, **SHORT, out=tmp_path / "out")
    assert run.verdict == "within" and run.warnings == ["no pictures: ValueError: no ink"]
    assert orchestrator.load_run(tmp_path / "out").manifest["complete"] is True


def test_a_page_that_fails_loses_no_run(tmp_path: Path, monkeypatch):
    def fail(*_, **__):
        raise ValueError("no paper")

    monkeypatch.setattr("orchestrator.report.page.write", fail)
    run = orchestrator.run(OSCILLATOR, **SHORT, out=tmp_path / "out")
    assert run.verdict == "within" and run.warnings == ["no page: ValueError: no paper"]
    read = orchestrator.load_run(tmp_path / "out")
    assert read.manifest["page"] == "ValueError: no paper" and read.manifest["pictures"] is None


def test_a_run_leaves_its_page(tmp_path: Path):
    run = orchestrator.run(OSCILLATOR, **SHORT, out=tmp_path / "with")
    page = (tmp_path / "with" / "report.html").read_text(encoding="utf-8")
    assert run.manifest["page"] is None and run.summary["title"] in page
    assert orchestrator.load_run(tmp_path / "with").manifest["written"] in page, "it shows what the manifest says"
    orchestrator.run(OSCILLATOR, **SHORT, out=tmp_path / "without", pictures=False)
    assert not (tmp_path / "without" / "report.html").exists()


def test_the_manifest_is_written_last(tmp_path: Path):
    out = tmp_path / "out"
    orchestrator.run(OSCILLATOR, **SHORT, out=out)
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    assert max(times, key=lambda path: times[path]) == out / "manifest.json" and len(times) > 4


def test_an_unfinished_directory_is_no_run(tmp_path: Path):
    for load_it in (orchestrator.load_run, orchestrator.load_comparison):
        with pytest.raises(orchestrator.InputError, match=r"no manifest\.json"):
            load_it(tmp_path)


def test_comparison(comparison: orchestrator.Comparison):
    assert [(r.master, r.macro_step) for r in comparison.runs] == [
        ("iqn_ils", 0.02), ("iqn_ils", 0.01), ("gauss_seidel", 0.02), ("gauss_seidel", 0.01),
    ]  # fmt: skip
    assert comparison.observed_order["iqn_ils"]["left.position"] == pytest.approx(4.0, abs=0.2)
    assert comparison.exit_status == (0 if comparison.passed else 1)
    assert len(comparison.checks) == 8 and comparison.reference.kind.startswith("coupled")
    assert [run.label for run in comparison.results] == [run.label for run in comparison.runs]
    assert repr(comparison).startswith("Comparison(4 runs against coupled, ")


def test_a_comparison_read_back_is_the_same(comparison: orchestrator.Comparison):
    assert comparison.directory is not None
    read = orchestrator.load_comparison(comparison.directory)
    assert json.dumps(read.content(), default=vars) == json.dumps(comparison.content(), default=vars)
    assert same(read.reference.table, comparison.reference.table)
    assert all(same(a.table, b.table) for a, b in zip(read.results, comparison.results, strict=True))
    assert read.exit_status == comparison.exit_status and repr(read) == repr(comparison)


def test_each_variant_is_the_run_of_its_own(comparison: orchestrator.Comparison):
    """Variants share what was resolved once: each is, bit for bit, the run of a scenario that was read for it alone."""
    for held in comparison.results:
        settings = ["simulation.stop_time=0.2", f"simulation.macro_step={held.macro_step}"]
        assert same(run_coupled(load(OSCILLATOR, settings, master=held.master)).table, held.table)


def test_a_reference_that_fails_keeps_the_runs(tmp_path: Path, monkeypatch):
    def fail(*_):
        raise orchestrator.RunError("no reference today")

    monkeypatch.setattr(reference, "completed", fail)
    with pytest.raises(Unfinished, match="no reference today") as error:
        orchestrator.compare(OSCILLATOR, stop=0.1, out=tmp_path / "out", pictures=False)
    assert error.value.directory == tmp_path / "out" and len(error.value.runs) == 1
    assert orchestrator.load_run(tmp_path / "out" / "iqn_ils_0.01s").verdict == "within"
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["complete"] is False


def test_frame_without_pandas_says_how_to_get_it(oscillator, comparison, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    for one in (oscillator, comparison):
        with pytest.raises(ImportError, match="pip install pandas"):
            one.frame()


def test_frame(oscillator: orchestrator.Run, comparison: orchestrator.Comparison):
    pytest.importorskip("pandas")
    frame = oscillator.frame()
    assert frame.index.name == "time" and list(frame.columns) == list(oscillator.signals)
    assert frame["left.position"].to_numpy().tobytes() == oscillator["left.position"].values.tobytes()
    errors = comparison.frame()
    assert len(errors) == sum(len(run.signals) for run in comparison.runs)
    assert {"master", "macro_step", "signal", "max_error", "relative_max_error", "wall_s"} <= set(errors.columns)
