"""A sweep of FMUs that crash and hang, killed at any moment, on a disk that fills up: it loses what was in flight, no more."""

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.faulty import CRASHES, HANGS, PATIENCE, study_in
from tests.fmus import needs_compiler

ONLY_LINUX = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked for in /proc")


def started(study: Path, out: Path) -> subprocess.Popen:
    line = [sys.executable, "-m", "orchestrator", "sweep", str(study), "--out", str(out), "--quiet", "--workers", "2"]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)


def finished(study: Path, out: Path) -> tuple[int, str]:
    """Run a sweep to its end; return its status and what it said."""
    process = started(study, out)
    said, _ = process.communicate()
    return process.returncode, said


def group_of(leader: int) -> list[int]:
    """Return the processes that the one that leads a group has started, and that are still there."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                state, _, group = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
            except OSError:
                continue
            found += [int(entry.name)] if int(group) == leader and state != "Z" else []
    return found


def wait_until(condition, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds:g} s"
        time.sleep(0.05)


def killed(process: subprocess.Popen, whole_group: bool) -> None:
    """Kill a sweep, with all that it has started or alone; none of them is to be left."""
    (os.killpg if whole_group else os.kill)(process.pid, signal.SIGKILL)
    process.communicate()
    wait_until(lambda: not group_of(process.pid), 20.0)


def manifests(out: Path) -> list[Path]:
    """Those of the runs that are whole: a run that is being written stands in a hidden folder, which moves into place."""
    return list(out.glob("runs/[!.]*/manifest.json"))


def rows(out: Path) -> list[dict[str, str]]:
    with open(out / "table.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def require_only_the_faulty_failed(out: Path, count: int) -> None:
    table = rows(out)
    failed = [float(row["components.q.parameters.fault"]) for row in table if row["failure"]]
    assert sorted(failed) == [CRASHES] * count + [HANGS] * count
    for row in table:
        fault = float(row["components.q.parameters.fault"])
        if fault == CRASHES:
            assert "died (exit code -11)" in row["failure"]
        if fault == HANGS:
            assert "longer than it may" in row["failure"]
    result = json.loads((out / "study.json").read_text(encoding="utf-8"))
    assert result["complete"] and result["counts"]["failed"] == 2 * count


@needs_compiler
@ONLY_LINUX
def test_runs_that_crash_and_hang_cost_themselves_alone_though_the_sweep_is_killed(tmp_path: Path):
    study, out = study_in(tmp_path, 25, 2, PATIENCE), tmp_path / "out"
    first = started(study, out)
    wait_until(lambda: len(manifests(out)) >= 10 or first.poll() is not None, 120.0)
    made = {path: path.stat().st_mtime_ns for path in manifests(out)}
    killed(first, whole_group=False)
    assert finished(study, out)[0] == 1
    assert {path: path.stat().st_mtime_ns for path in made} == made, "none is made twice"
    require_only_the_faulty_failed(out, 2)
    assert len(rows(out)) == 50 and not list(out.glob("runs/.*")), "nothing half done is left"


@pytest.mark.slow
@needs_compiler
@ONLY_LINUX
def test_five_hundred_runs_killed_at_ten_random_moments(tmp_path: Path):
    study, out, undisturbed = study_in(tmp_path, 50, 10, PATIENCE), tmp_path / "out", tmp_path / "undisturbed"
    start = time.monotonic()
    assert finished(study, undisturbed)[0] == 1
    alone, chance = time.monotonic() - start, random.Random(1)
    require_only_the_faulty_failed(undisturbed, 10)
    for i in range(10):
        process = started(study, out)
        time.sleep(chance.uniform(0.02, 0.25) * alone)
        killed(process, whole_group=i % 2 == 0)
    assert finished(study, out)[0] == 1
    require_only_the_faulty_failed(out, 10)
    assert (out / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes() and len(rows(out)) == 500


@needs_compiler
@ONLY_LINUX
def test_a_full_disk_costs_the_runs_in_flight_alone(tmp_path: Path):
    """A file may be 4 kB large: run 1 fits, with ten times the rows run 2 does not."""
    study, out = study_in(tmp_path, 3, 2, 60.0), tmp_path / "out"
    text = 'scenario = "loop.toml"\nrecord = "all"\n[vary]\n"simulation.stop_time" = [0.1, 10.0]\n'
    study.write_text(text, encoding="utf-8")
    limited = f"ulimit -f 8; exec {sys.executable} -m orchestrator sweep {study} --out {out} --quiet --workers 1"
    ended = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, check=False)
    assert ended.returncode == 3 and "make room" in ended.stderr and "Traceback" not in ended.stderr
    made = {path: path.stat().st_mtime_ns for path in manifests(out)}
    assert len(made) == 1 and not list(out.glob("runs/.*"))
    assert finished(study, out)[0] == 0 and len(rows(out)) == 2
    assert {path: path.stat().st_mtime_ns for path in made} == made, "none is made twice"
