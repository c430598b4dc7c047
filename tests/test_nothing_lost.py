"""What is left of a run whatever ends it: kill -9, signals, a full disk, streams that are closed.

Runs are made in forked processes, which have all loaded already.
"""

import errno
import json
import mmap
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

import numpy as np
import pytest

import orchestrator
from orchestrator.api import report_of
from orchestrator.catalogue.library import build_all
from orchestrator.cli import commands
from orchestrator.coupling.run import spool
from orchestrator.coupling.run.columns import Columns, Rows
from orchestrator.coupling.run.results import plain, read_fields, read_table, write_fields
from orchestrator.coupling.scratch import remove_left_overs, remove_parts, scratch
from orchestrator.runs import unfinished
from orchestrator.runs.coupled import noted_of
from orchestrator.runs.going_on import FOLDER
from orchestrator.runs.unfinished import load_unfinished, scenario_of, unfinished_in
from tests.scenarios import LANDING, OSCILLATOR, SCENARIOS

pytestmark = pytest.mark.skipif(os.name == "nt", reason="processes are forked, and killed by signals")
LONG = {"stop": 1e4, "estimate": "none", "pictures": False}
"""A run that nobody waits for."""


def forked(work: Callable[[], object]) -> int:
    """Do `work` in another process; return its number."""
    process = os.fork()
    if process:
        return process
    status = 99
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # which nohup has ignored
    try:
        work()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    finally:
        os._exit(status)


def ended(process: int) -> int:
    """Return the exit status of a process as a shell says it."""
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return status if status >= 0 else 128 - status


def stream(number: int) -> TextIO:
    return open(number, "w", encoding="utf-8", closefd=False)


def cli(*arguments: object, out: Path | str, err: Path | str) -> Callable[[], None]:
    """Return what carries out a command with its standard streams in files."""

    def work() -> None:
        for number, name, path in ((1, "stdout", out), (2, "stderr", err)):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
            setattr(sys, name, stream(number))
        commands.main([str(argument) for argument in arguments])

    return work


def until(there: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not there():
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.01)


def rows_on_disk(out: Path) -> int:
    try:
        return len(load_unfinished(out).time)
    except (orchestrator.InputError, OSError):
        return 0


def going(out: Path, rows: int = 10) -> Callable[[], bool]:
    return lambda: rows_on_disk(out) > rows


def manifest(out: Path) -> dict:
    return json.loads((out / "manifest.json").read_text())


# -- kill -9 ----------------------------------------------------------------------------------------------------


class Watch:
    """What a run tells of itself, in memory that outlives it: wall and simulated time of each of its steps, s."""

    def __init__(self, steps: int = 100_000):
        self.told = np.frombuffer(mmap.mmap(-1, 16 * (steps + 1)), dtype=float).reshape(-1, 2)

    def __call__(self, task: str, t: float, stop: float) -> None:
        n = int(self.told[0, 0]) + 1
        if "estimate" not in task and "reference" not in task:
            self.told[n] = time.monotonic(), t
            self.told[0, 0] = n

    def reached(self, before: float) -> float:
        """Return the simulated time that was reached at the wall time `before`, s."""
        told = self.told[1 : 1 + int(self.told[0, 0])]
        return float(np.max(told[told[:, 0] < before, 1], initial=0.0))


def killed_after(seconds: float, work: Callable[[], object]) -> float:
    """Kill `work` after so many seconds; return the wall time of that."""
    process = forked(work)
    time.sleep(seconds)
    at = time.monotonic()
    os.kill(process, signal.SIGKILL)
    ended(process)
    return at


def check_run(out: Path, watch: Watch, killed: float, stop: float) -> None:
    """Nothing false, and no more than a second lost; what there is can be drawn."""
    if (out / "manifest.json").is_file():
        assert manifest(out)["complete"] and orchestrator.load_run(out).time[-1] == pytest.approx(stop)
        return
    reached = watch.reached(killed - 1.0)
    if not unfinished_in(out):
        assert reached == 0.0
        return
    try:
        run = load_unfinished(out)
    except orchestrator.InputError as error:
        assert reached == 0.0 and ("no results" in str(error) or "not come" in str(error))
        return
    assert run.verdict == "failed" and "unfinished, up to t = " in (run.error or "")
    assert run.time[-1] >= reached and np.all(np.isfinite(run.table["left.position"]))
    assert len(run.time) - 1 == pytest.approx(len(run.iterations["time"]), abs=1)


def runs(out: Path, watch: Watch, pictures: bool = False) -> None:
    orchestrator.run(OSCILLATOR, stop=4.0, out=out, progress=watch, pictures=pictures)


def test_kill_9_at_random_moments_of_a_run(tmp_path: Path):
    begun = time.monotonic()
    assert ended(forked(lambda: runs(tmp_path / "whole", Watch()))) == 0
    length, moments = time.monotonic() - begun, random.Random(2)
    for i in range(4):
        watch, out = Watch(), tmp_path / str(i)
        check_run(out, watch, killed_after(moments.uniform(0.0, 1.1 * length), lambda: runs(out, watch)), 4.0)  # noqa: B023


def test_what_a_killed_run_has_left_becomes_files(tmp_path: Path):
    out, watch = tmp_path / "out", Watch()
    process = forked(lambda: orchestrator.run(OSCILLATOR, out=out, progress=watch, **LONG))
    until(going(out))
    with pytest.raises(orchestrator.InputError, match=r"no manifest\.json.*load_unfinished"):
        orchestrator.load_run(out)
    page = report_of(out)
    assert page == out / FOLDER / "so_far" / "report.html" and not (out / "manifest.json").exists()
    assert "still going on" in manifest(page.parent)["error"]
    os.kill(process, signal.SIGKILL)
    assert ended(process) == 137
    (out / ".results.999999999.csv").write_text("half")
    last = load_unfinished(out).time[-1]
    assert report_of(out) == out / "report.html"
    run = orchestrator.load_run(out)
    assert manifest(out)["complete"] is False and run.verdict == "failed" and run.time[-1] == last
    assert run.error == f"unfinished, up to t = {last:g} s: {unfinished.DIED}" and run.exit_status == 3
    names = {path.name for path in out.iterdir()}
    assert names == {"results.csv", "iterations.csv", "summary.json", "manifest.json", "plots", "report.html"}
    assert f"up to {last:g} s" in (out / "report.html").read_text()


def test_a_run_goes_on_until_its_files_are_written(tmp_path: Path, monkeypatch):
    """While its error is estimated, too: it is not for others to say that it has died."""
    out, seen = tmp_path / "out", []

    def look(task: str, t: float, stop: float) -> None:
        if "estimate" in task and not seen:
            seen.append(load_unfinished(out).error)

    orchestrator.run(OSCILLATOR, stop=0.2, out=out, progress=look, pictures=False)
    assert seen == [f"unfinished, up to t = 0.2 s: {unfinished.GOES_ON}"] and manifest(out)["complete"]


def test_it_is_the_run_that_it_would_have_been(tmp_path: Path, monkeypatch):
    """Signals, reports, extremes and all that is made of them: bit for bit."""
    settings = {"stop": 1.0, "estimate": "none", "out": tmp_path / "out", "pictures": False}
    monkeypatch.setattr("orchestrator.runs.directory.conclude", lambda directory: None)
    whole = orchestrator.run(OSCILLATOR, **settings)
    left = load_unfinished(tmp_path / "out")
    for one, other in ((left.table, whole.table), (left.iterations, whole.iterations)):
        assert list(one) == list(other) and all(np.array_equal(one[n], other[n], equal_nan=True) for n in one)
    differ = {key for key, value in whole.summary.items() if left.summary[key] != value}
    assert {"verdict"} <= differ <= {"verdict", "wall_s", "wall_per_simulated_s", "wall_components_s", "solves"}


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
def test_a_scenario_reads_back_from_what_a_run_has_noted(path: Path):
    loaded = orchestrator.load_scenario(path)
    noted = json.loads(json.dumps(plain(noted_of(loaded))))
    read = scenario_of(noted)
    assert read == loaded and (read.path, read.provenance, read.notes) == (loaded.path, loaded.provenance, loaded.notes)


@pytest.mark.parametrize(("scenario", "stop"), [(OSCILLATOR, 4.0), (LANDING, 0.3)], ids=["oscillator", "landing"])
def test_a_run_that_is_read_from_disk_is_the_same(tmp_path: Path, monkeypatch, scenario: Path, stop: float):
    """As of one with too many rows for memory: tables bit for bit, summary, limits and audit."""
    settings = {"stop": stop, "estimate": "none", "pictures": False}
    held = orchestrator.run(scenario, out=tmp_path / "held", **settings)
    monkeypatch.setattr("orchestrator.coupling.run.columns.HELD", 1000)
    monkeypatch.setattr("orchestrator.coupling.run.columns.PIECE", 20_000)
    monkeypatch.setattr("orchestrator.coupling.run.results.IN_MEMORY", 1000)
    monkeypatch.setattr("orchestrator.landing.fields.IN_MEMORY", 100_000)
    long = orchestrator.run(scenario, out=tmp_path / "long", **settings)
    assert isinstance(long.table, Columns) and isinstance(orchestrator.load_run(tmp_path / "long").iterations, Columns)
    for name in ("results.csv", "iterations.csv"):
        assert (tmp_path / "long" / name).read_bytes() == (tmp_path / "held" / name).read_bytes()
    assert {key for key in held.summary if held.summary[key] != long.summary[key]} <= {
        "wall_s", "wall_per_simulated_s", "wall_components_s",
    }  # fmt: skip
    if long.energy is not None and held.energy is not None:
        assert long.energy.content() == held.energy.content()
    if scenario == LANDING:
        assert np.array_equal(long.fields["tension_max"], np.max(held.fields["tension"], axis=1))
        assert len(Rows.read(tmp_path / "long" / "signals.part")) == len(held.time) > len(long.fields["time"])


def compares(out: Path, watch: Watch) -> None:
    orchestrator.compare(OSCILLATOR, stop=2.0, macro_steps=[0.02, 0.01], out=out, progress=watch, pictures=False)


def check_comparison(out: Path, watch: Watch, killed: float) -> None:
    for label in ("iqn_ils_0.02s", "iqn_ils_0.01s"):
        if (out / label).is_dir():
            check_run(out / label, watch if label.endswith("1s") else Watch(), killed, 2.0)
    if (out / "manifest.json").is_file():
        assert manifest(out)["complete"] and len(orchestrator.load_comparison(out).results) == 2
    elif unfinished_in(out) and all(map(rows_on_disk, unfinished_in(out))):
        report_of(out)
        assert manifest(out)["complete"] is False and not unfinished_in(out)


@pytest.mark.slow
def test_kill_9_at_fifty_moments_of_run_compare_and_build(tmp_path: Path, monkeypatch):
    """Never a false `complete`, at most a second lost, nothing left in temporary folders after the next start."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setenv("TMPDIR", str(temporary))
    moments = random.Random(3)
    lengths = {}
    whole = {
        "run": lambda: runs(tmp_path / "run", Watch(), True),
        "compare": lambda: compares(tmp_path / "compare", Watch()),
    }
    for name, work in whole.items():
        begun = time.monotonic()
        assert ended(forked(work)) == 0
        lengths[name] = time.monotonic() - begun
    for i in range(20):
        watch, out = Watch(), tmp_path / f"run-{i}"
        at = killed_after(moments.uniform(0.0, 1.1 * lengths["run"]), lambda: runs(out, watch, True))  # noqa: B023
        check_run(out, watch, at, 4.0)
    for i in range(20):
        watch, out = Watch(), tmp_path / f"compare-{i}"
        at = killed_after(moments.uniform(0.0, 1.1 * lengths["compare"]), lambda: compares(out, watch))  # noqa: B023
        check_comparison(out, watch, at)
    for i in range(10):
        folder = tmp_path / f"build-{i}"
        killed_after(moments.uniform(0.0, 6.0), lambda: build_all(folder))  # noqa: B023
        for fmu in folder.glob("*.fmu"):
            assert zipfile.ZipFile(fmu).testzip() is None

    def is_clean() -> bool:  # processes that a killed one has started end by themselves
        remove_left_overs()
        for folder in tmp_path.glob("build-*"):
            remove_parts(folder)
        left = [path for path in tmp_path.glob("build-*/.*") if path.suffix != ".lock"]  # the next build takes these
        return not left and not list(temporary.iterdir())

    until(is_clean, 120.0)


def test_scratch_folders_of_the_dead_are_removed_and_those_of_the_living_kept(tmp_path: Path):
    place = tmp_path / "place"

    def work() -> None:
        with scratch(tmp_path) as folder:
            place.symlink_to(folder)
            time.sleep(60.0)

    process = forked(work)
    until(place.is_symlink)
    with scratch(tmp_path):
        assert place.resolve().is_dir()
    os.kill(process, signal.SIGKILL)
    ended(process)
    with scratch(tmp_path) as mine:
        assert [path for path in tmp_path.iterdir() if path.is_dir() and path != place] == [mine]


# -- signals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_run_with_its_results(tmp_path: Path, number: signal.Signals):
    out, said = tmp_path / "out", tmp_path / "said"
    process = forked(
        cli("run", OSCILLATOR, "--out", out, "--stop", "1e4", "--no-pictures", "--quiet", out=said, err=said)
    )
    until(going(out))
    os.kill(process, number)
    assert ended(process) == 128 + number
    run = orchestrator.load_run(out)
    assert manifest(out)["complete"] is False and run.error == f"ended by {number.name} at t = {run.time[-1]:g} s"
    assert (run.verdict, run.exit_status) == ("interrupted", 128 + number) and not (out / FOLDER).exists()
    assert said.read_text().splitlines()[-1] == f"orchestrator: ended by {number.name}; results so far in {out}"


def test_from_python_the_signal_is_passed_on_when_results_are_written(tmp_path: Path):
    process = forked(lambda: orchestrator.run(OSCILLATOR, out=tmp_path / "out", **LONG))
    until(going(tmp_path / "out"))
    os.kill(process, signal.SIGTERM)
    assert ended(process) == 143 and manifest(tmp_path / "out")["error"].startswith("ended by SIGTERM")


def test_a_second_signal_ends_at_once(tmp_path: Path, monkeypatch):
    """The step that the first one waits for never ends; what has come before is on disk."""
    out = tmp_path / "out"

    def hangs(task: str, t: float, stop: float) -> None:
        while t > 0.5:
            time.sleep(0.01)

    process = forked(lambda: orchestrator.run(OSCILLATOR, out=out, progress=hangs, **LONG))
    until(going(out, 51))
    os.kill(process, signal.SIGTERM)
    time.sleep(0.3)
    os.kill(process, signal.SIGTERM)
    assert ended(process) == 143 and load_unfinished(out).time[-1] == pytest.approx(0.51)


def test_a_signal_that_is_ignored_stays_so(tmp_path: Path):
    """As under nohup."""

    def work() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

        def told(task: str, t: float, stop: float) -> None:
            if t > 0.1:
                os.kill(os.getpid(), signal.SIGHUP)

        orchestrator.run(OSCILLATOR, stop=0.2, out=tmp_path / "out", progress=told, pictures=False)

    assert ended(forked(work)) == 0 and manifest(tmp_path / "out")["complete"]


def test_ctrl_c_ends_all_of_a_comparison_and_keeps_finished_runs(tmp_path: Path):
    out, said = tmp_path / "out", tmp_path / "said"
    options = ["--macro-steps", "1,0.01,0.005", "--stop", "1000", "--no-pictures", "--quiet"]
    process = forked(cli("compare", OSCILLATOR, "--out", out, *options, out=said, err=said))
    until(going(out / "iqn_ils_0.01s"))
    os.kill(process, signal.SIGINT)
    assert ended(process) == 130
    assert [path.name for path in sorted(out.iterdir())] == ["iqn_ils_0.01s", "iqn_ils_1s", "manifest.json"]
    assert manifest(out / "iqn_ils_1s")["complete"] and manifest(out)["complete"] is False
    assert manifest(out / "iqn_ils_0.01s")["error"].startswith("interrupted at t = ")
    assert "results so far in" in said.read_text() and "Traceback" not in said.read_text()


def test_a_signal_in_the_writing_waits_for_its_end(tmp_path: Path, monkeypatch):
    """Results that are there are not given up for a picture."""

    def ask(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("orchestrator.api.leave", lambda *_, **__: ask())
    process = forked(lambda: orchestrator.run(OSCILLATOR, stop=0.2, out=tmp_path / "out", pictures=False))
    assert ended(process) == 143 and manifest(tmp_path / "out")["complete"]


# -- a full disk ------------------------------------------------------------------------------------------------


def check_full(out: Path, said: Path, status: int) -> None:
    lines = said.read_text().splitlines()
    assert status == 3 and sum("orchestrator: " in line and "--out" in line for line in lines) == 1, lines
    assert "Traceback" not in said.read_text() and not (out / "manifest.json").exists()


@pytest.mark.parametrize("most", [2_000, 8_000, 30_000, 60_000])
def test_a_file_that_may_not_grow(tmp_path: Path, monkeypatch, most: int):
    """The system's own limit of a file's size (RLIMIT_FSIZE), at several points of a run: EFBIG."""
    import resource

    monkeypatch.setattr(spool, "INTERVAL", 0.01)  # on a quick machine all of the run would be one piece
    out, said = tmp_path / "out", tmp_path / "said"

    def work() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        cli("run", OSCILLATOR, "--out", out, "--stop", "5", "--no-pictures", "--quiet", out=os.devnull, err=said)()

    check_full(out, said, ended(forked(work)))
    if most > 8_000:  # what was written before is there
        assert load_unfinished(out).time[-1] > 0.1


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may mount a small disk")
@pytest.mark.parametrize("size", ["8k", "100k", "250k"])
def test_a_full_disk(tmp_path: Path, monkeypatch, size: str):
    """A small one, of memory, at several points of a run: ENOSPC."""
    monkeypatch.setattr(spool, "INTERVAL", 0.01)
    disk, said = tmp_path / "disk", tmp_path / "said"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        options = ["--stop", "20", "--no-pictures", "--quiet"]
        work = cli("run", OSCILLATOR, "--out", disk / "out", *options, out=os.devnull, err=said)
        check_full(disk / "out", said, ended(forked(work)))
        assert size == "8k" or load_unfinished(disk / "out").time[-1] > 1.0
    finally:
        subprocess.run(["umount", disk], check=True)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_a_disk_that_fails_when_files_are_written(tmp_path: Path, monkeypatch, number: int):
    """The system's fsync says so, of the last file: all is there still."""
    out, said, fsync = tmp_path / "out", tmp_path / "said", os.fsync

    def fails(handle: int) -> None:
        if (out / "summary.json").exists():
            raise OSError(number, os.strerror(number))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", fails)
    work = cli("run", OSCILLATOR, "--out", out, "--stop", "0.5", "--no-pictures", "--quiet", out=os.devnull, err=said)
    check_full(out, said, ended(forked(work)))
    assert load_unfinished(out).time[-1] == pytest.approx(0.5)


def test_fields_on_a_full_disk_are_an_error_and_no_crash(tmp_path: Path):
    import resource

    def work() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
        with pytest.raises(OSError, match="too large"):
            write_fields(tmp_path / "fields.h5", {"x": np.random.default_rng(0).random(100_000)}, {})

    assert ended(forked(work)) == 0 and list(tmp_path.iterdir()) == []
    write_fields(tmp_path / "fields.h5", {"x": np.arange(5.0)}, {"x": "m"})
    assert read_fields(tmp_path / "fields.h5")["x"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


# -- streams ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["closed", "full", "broken"])
def test_streams_that_take_nothing_cost_no_results(tmp_path: Path, what: str):
    out, reading = tmp_path / "out", os.pipe()

    def work() -> None:
        full = os.open("/dev/full", os.O_WRONLY) if what == "full" else None
        os.close(reading[0])
        for number, name in ((1, "stdout"), (2, "stderr")):
            os.close(number) if what == "closed" else os.dup2(full or reading[1], number)
            setattr(sys, name, None if what == "closed" else stream(number))
        commands.main(["run", str(OSCILLATOR), "--out", str(out), "--stop", "0.5", "--no-pictures"])

    if what == "full" and not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    process = forked(work)
    os.close(reading[0])
    assert ended(process) == 0 and manifest(out)["complete"]
    os.close(reading[1])
    assert read_table(out / "results.csv")["time"][-1] == pytest.approx(0.5)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_an_answer_that_cannot_be_printed_is_a_failure(tmp_path: Path):
    said = tmp_path / "said"
    assert ended(forked(cli("list", out="/dev/full", err=said))) == 3
    assert said.read_text() == (
        "orchestrator: standard output: No space left on device; what was to be printed is lost, results are kept\n"
    )


# -- an output interval -----------------------------------------------------------------------------------------


def test_every_tenth_point_is_recorded_and_the_last_one(tmp_path: Path):
    settings = {"stop": 0.25, "estimate": "none"}
    all_ = orchestrator.run(OSCILLATOR, **settings)
    few = orchestrator.run(OSCILLATOR, set={"simulation.output_interval": 0.1}, **settings)
    rows = [0, 10, 20, 25]
    assert np.array_equal(few.time, all_.time[rows])
    assert np.array_equal(few.table["left.position"], all_.table["left.position"][rows])
    assert len(few.iterations["time"]) == 25 and few.summary["steps"] == 25
    assert any("output_interval" in line for line in few.wiring) and not any(
        "output_interval" in x for x in all_.wiring
    )


def test_an_interval_is_a_whole_number_of_steps():
    with pytest.raises(
        orchestrator.InputError, match=r"output_interval 0\.015 s must be a whole number of macro steps"
    ):
        orchestrator.load_scenario(OSCILLATOR, set={"simulation.output_interval": 0.015})
    with pytest.raises(orchestrator.InputError, match="twice that"):
        orchestrator.load_scenario(OSCILLATOR, set={"simulation.output_interval": 0.03}, estimate="coarser")


def test_the_estimate_is_that_of_the_recorded_points():
    run = orchestrator.run(OSCILLATOR, set={"simulation.output_interval": 0.1}, stop=1.0)
    assert run.estimate_failure == "" and 0.0 < run.estimated_error["left.position"] < 1e-5
