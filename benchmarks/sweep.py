"""What a sweep costs: a small map coupled and monolithic, and a thousand landings; and whether two workers are worth it.

    python -m benchmarks.sweep            the bars; a quarter of an hour
    python -m benchmarks.sweep --quick    one second of each landing, and fewer of them: whether it runs

Wall time is what an engineer waits for, and says what else the machine was doing. CPU time is that of
the runs alone, by their manifests: what two workers take more than one of it, they cost each other.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.face.first_use import compile_modules
from fmus.kernels import notice
from orchestrator.coupling.run.results import read_json
from orchestrator.runs.batch import run_batch
from orchestrator.runs.job import Job

SCENARIO = "landing_200m_point9_physical"
POINTS = [100.0 - 8.0 * i for i in range(11)]
MASSES = [10.0, 38.0, 55.0]
BATCH = "--batch"
COUPLED, SPEED_UP, MONOLITHIC, THOUSAND = 180.0, 1.8, 40.0, 600.0
"""Bars: s for a map of 11 points and 3 masses, times one worker, s for that map, s for 1,000 landings."""


@dataclass(frozen=True)
class Cost:
    """Of a batch: wall time, and CPU time of the workers, s."""

    wall: float
    cpu: float


def jobs(solver: str, count: int, stop: float) -> list[Job]:
    """Return `count` landings of `stop` s, the first of them those of the map."""
    found = []
    for i in range(count):
        turn, place = divmod(i, len(POINTS) * len(MASSES))
        point, mass = POINTS[place % len(POINTS)] + 0.1 * turn, MASSES[place // len(POINTS)]
        values = {"landing.position": point, "robot.parameters.mass": mass, "simulation.stop_time": stop}
        found.append(Job(SCENARIO, values, solver=solver, keep=False))
    return found


def cost(solver: str, count: int, stop: float, workers: int) -> Cost:
    """Return what it costs to make the runs, from the start of the program to its end."""
    start = time.perf_counter()
    line = [sys.executable, "-m", "benchmarks.sweep", BATCH, solver, str(count), str(stop), str(workers)]
    cpu = subprocess.run(line, check=True, capture_output=True, text=True).stdout
    return Cost(time.perf_counter() - start, float(cpu))


def batch(solver: str, count: str, stop: str, workers: str) -> None:
    """Make the runs; print the CPU time that they took, s."""
    with tempfile.TemporaryDirectory() as store:
        done = run_batch(jobs(solver, int(count), float(stop)), Path(store), int(workers))
        faults = [one.failure for one in done if one.failure is not None]
        if faults:
            raise SystemExit(faults[0])
        print(sum(read_json(one.directory / "manifest.json")["cpu_s"] for one in done if one.directory is not None))


def told(name: str, count: int, workers: int, found: Cost, bar: float) -> None:
    """Print a row."""
    numbers = f"{found.wall:8.1f} {found.cpu:8.1f} {found.cpu / count:12.2f} {bar:7.0f}"
    print(f"{name:24} {count:5} {workers:7} {numbers}", flush=True)


def main() -> int:
    """Print the table; return 1 where a bar is missed."""
    quick = "--quick" in sys.argv
    notice.muted = True
    compile_modules()
    stop, few, many = (1.0, 6, 24) if quick else (25.0, len(POINTS) * len(MASSES), 1000)
    for solver in ("monolithic", "coupled"):
        cost(solver, 1, 0.1, 1)  # compiles what is not compiled yet
    print(f"load at the start: {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors; landings of {stop:g} s")
    print(f"{'':24} {'runs':>5} {'workers':>7} {'wall, s':>8} {'CPU, s':>8} {'CPU a run, s':>12} {'bar, s':>7}")
    both, alone = cost("coupled", few, stop, 2), cost("coupled", few, stop, 1)
    told("map, coupled at 5 ms", few, 2, both, COUPLED)
    told("map, coupled at 5 ms", few, 1, alone, np.inf)
    small, large = cost("monolithic", few, stop, 2), cost("monolithic", many, stop, 2)
    told("map, monolithic", few, 2, small, MONOLITHIC)
    told("landings, monolithic", many, 2, large, THOUSAND)
    ratio = alone.wall / both.wall
    print(
        f"speed-up of two workers: {ratio:.2f} (bar {SPEED_UP}); their CPU time by that of one: {both.cpu / alone.cpu:.2f}"
    )
    print(f"load at the end: {os.getloadavg()[0]:.1f}")
    kept = both.wall <= COUPLED and small.wall <= MONOLITHIC and large.wall <= THOUSAND and ratio >= SPEED_UP
    return int(not (quick or kept))


if __name__ == "__main__":
    if sys.argv[1:2] == [BATCH]:
        batch(*sys.argv[2:])
        raise SystemExit
    raise SystemExit(main())
