"""A batch of runs: each made once, none the victim of another, whole runs only in the store."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from multiprocessing import parent_process
from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.runs.batch import run_batch
from orchestrator.runs.job import Job, found, make
from orchestrator.runs.worker import ONE_THREAD


def job(stop: float = 0.2, **options) -> Job:
    return Job("oscillator", {"simulation.stop_time": stop}, solver="coupled", **options)


@dataclass(frozen=True)
class Crash(Job):
    """Ends the worker's process without a word."""

    def loaded(self):
        return super().loaded() if parent_process() is None else os._exit(7)


@dataclass(frozen=True)
class Hang(Job):
    """Does not come back."""

    def loaded(self):
        return super().loaded() if parent_process() is None else time.sleep(60.0)


@dataclass(frozen=True)
class Blunder(Job):
    """Raises what no run raises for its user."""

    def loaded(self):
        return super().loaded() if parent_process() is None else 1 // 0


@dataclass(frozen=True)
class Threads(Job):
    """Ends the worker's process with the number of threads that its libraries are allowed."""

    def loaded(self):
        return super().loaded() if parent_process() is None else os._exit(10 * int(os.environ[ONE_THREAD[0]]))


def test_runs_are_made_once_and_come_back_in_order(tmp_path: Path):
    counts: list[tuple[int, int]] = []
    jobs = [job(0.2), job(0.1), job(0.2)]
    done = run_batch(jobs, tmp_path, 2, progress=lambda n, of: counts.append((n, of)))
    assert [len(one.table["time"]) for one in done] == [21, 11, 21]
    assert counts == [(0, 2), (1, 2), (2, 2)], "equal ones are run once"
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("manifest.json")}
    again = run_batch(jobs, tmp_path, 2, progress=lambda n, of: counts.append((n, of)))
    assert counts[3:] == [(2, 2)] and {p: p.stat().st_mtime_ns for p in tmp_path.rglob("manifest.json")} == before
    assert np.array_equal(again[0].table["left.position"], done[2].table["left.position"])


def test_a_crash_and_a_hang_cost_themselves_alone_and_are_tried_again(tmp_path: Path):
    bad = [Crash(**vars(job(0.3))), Hang(**vars(job(0.4))), Blunder(**vars(job(0.5)))]
    good = [job(0.1), job(0.2)]
    done = run_batch([bad[0], good[0], bad[1], good[1], bad[2]], tmp_path, 2, timeout=15.0)
    assert [one.failure is None for one in done] == [False, True, False, True, False]
    assert "ZeroDivisionError" in str(done[4].failure)
    assert "died (exit code 7)" in str(done[0].failure) and "longer than it may" in str(done[2].failure)
    assert [found(one, tmp_path) for one in bad] == [None, None, None]
    assert not list(tmp_path.glob(".*")), "nothing half done is left"
    assert run_batch([job(0.3)], tmp_path, 1)[0].failure is None


def test_a_run_that_fails_by_itself_is_finished_too(tmp_path: Path):
    fails = Job("landing_200m_point9", {"robot.parameters.initial.yaw": 1.5})
    make(fails, tmp_path)
    done = found(fails, tmp_path)
    assert done is not None and "its axle lies along the cable" in str(done.failure)


def test_wrong_input_is_said_before_anything_is_run(tmp_path: Path):
    wrong = [job(), replace(job(), set={"simulation.stop_tim": 1.0}), replace(job(), solver="monolitic")]
    with pytest.raises(InputError) as error:
        run_batch(wrong, tmp_path / "store", 1)
    assert len(error.value.problems) == 2 and "did you mean" in str(error.value)
    assert not (tmp_path / "store").exists()


def test_what_a_run_is_known_by(tmp_path: Path):
    same = Job("oscillator", {"simulation.stop_time": 0.2, "simulation.macro_step": 0.01}, solver="coupled")
    other = Job("oscillator", {"components.left.parameters.mass": 1.5, "simulation.stop_time": 0.2}, solver="coupled")
    assert same.key == job(0.2).key, "the file has that macro step already"
    assert len({job(0.2).key, other.key, replace(other, signals=("left.position",)).key}) == 3


def test_only_the_signals_asked_for_are_kept(tmp_path: Path):
    asked = job(0.1, signals=("right.position",))
    make(asked, tmp_path)
    done = found(asked, tmp_path)
    assert done is not None and list(done.table) == ["time", "right.position"]


def test_a_worker_has_one_thread(tmp_path: Path):
    (done,) = run_batch([Threads(**vars(job()))], tmp_path, 1)
    assert "exit code 10" in str(done.failure)


SCRIPT = """
from pathlib import Path
from orchestrator.runs.batch import run_batch
from orchestrator.runs.job import Job

if __name__ == "__main__":
    jobs = [Job("oscillator", {{"simulation.stop_time": 0.5 + 0.01 * i}}, solver="coupled") for i in range(40)]
    run_batch(jobs, Path({store!r}), 2, progress=lambda n, of: print(n, flush=True))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_batch_that_was_killed_goes_on(tmp_path: Path, number: int):
    script, store = tmp_path / "batch.py", tmp_path / "store"
    script.write_text(SCRIPT.format(store=str(store)), encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as first:
        assert first.stdout is not None
        while int(first.stdout.readline()) < 3:
            pass
        first.send_signal(number)
    made = {path.parent.name: path.stat().st_mtime_ns for path in store.glob("*/manifest.json")}
    assert 3 <= len(made) < 40
    again = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert int(again.stdout.splitlines()[0]) >= 3 and again.stdout.splitlines()[-1] == "40"
    after = {path.parent.name: path.stat().st_mtime_ns for path in store.glob("*/manifest.json")}
    assert len(after) == 40 and {name: after[name] for name in made} == made, "none is made twice"


def test_a_run_of_a_batch_is_bit_for_bit_that_run_alone(tmp_path: Path):
    """What is solved once for several runs, the line at rest for one, changes none of them."""
    values = {"simulation.stop_time": 0.05}
    jobs = [Job("landing_200m_point9", values | {"landing.height": height}) for height in (0.01, 0.02)]
    run_batch(jobs, tmp_path / "batch", 1)
    make(jobs[1], tmp_path / "alone")
    one, other = (tmp_path / place / jobs[1].key / "results.csv" for place in ("batch", "alone"))
    assert one.read_bytes() == other.read_bytes()
