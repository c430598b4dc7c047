"""What FMUs in processes of their own cost, and what they save: a landing, and two FMUs that work for a set time.

    python -m benchmarks.isolated [STOP [ROUNDS]]

First the landing of ``landing_200m_point9_physical`` over STOP (1) s: no FMU in a process of its own, the robot alone, all of
them. Then `jacobi` with two FMUs in C (compiled here) that work for the time in the first column: both in this process one
after the other, in threads, and in processes of their own. The contestants take turns. Processes cost and save wall time:
printed are the wall time of a macro step (median of a run; the least of the rounds, for others on the machine only add to
it), what a way costs more, and by what factor it is faster (median over the rounds of the ratio within one).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.clock import Times, ratio, turns
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.fmus import compiled

SCENARIO = Path(__file__).parents[1] / "scenarios" / "landing_200m_point9_physical.toml"
APART = {"none": (), "robot": ("robot",), "all": ("cable", "robot", "contact")}
DURATIONS = (0.0, 1e-4, 3e-4, 1e-3, 3e-3)  # s of work in a step
WAYS = {"one by one": ("never", False), "threads": ("always", False), "processes": ("auto", True)}
H, COUNT, WARM_UP = 1e-3, 100, 10


class Stamps:
    """Notes the clock at each macro step."""

    def __init__(self) -> None:
        self.found: list[float] = []

    def __call__(self, _: object) -> None:
        self.found.append(perf_counter())

    def median(self) -> float:
        """Return the median wall time of a macro step, s, without the first ones."""
        return float(np.median(np.diff(self.found)[WARM_UP:]))


def landing(apart: tuple[str, ...], stop: float) -> float:
    """Return the wall time of a macro step of the landing, s."""
    stamps = Stamps()
    chosen = [f"{name}.isolate=true" for name in apart]
    run_coupled(load(SCENARIO, [f"simulation.stop_time={stop}", *chosen]), stamps)
    return stamps.median()


def two(duration: float, parallel: str, isolate: bool) -> float:
    """Return the wall time of a macro step of two FMUs that work for `duration` s each, s."""
    stamps = Stamps()
    parts = {name: Fmu(compiled("lag2"), name, isolate=isolate) for name in "pq"}
    for part in parts.values():
        part.set_parameters({"start": 1.0, "duration": -duration})
    with Graph(parts, ["p.y -> q.u", "q.y -> p.u"]) as graph:
        master = MASTERS["jacobi"](graph, parallel=parallel)  # type: ignore[call-arg]
        simulate(graph, master, 0.0, COUNT * H, H, ["p.y"], stamps)
    return stamps.median()


def more(times: Times, name: str, peer: str) -> float:
    """Return what a contestant takes more than its peer, s, in the best round of each."""
    return float(np.min(times[name]) - np.min(times[peer]))


def main(stop: float = 1.0, rounds: int = 5) -> None:
    """Print both tables."""
    contest: dict[str, Callable[[], float]] = {name: partial(landing, apart, stop) for name, apart in APART.items()}
    times = turns(contest, rounds)
    print("landing, in processes of their own    ms a macro step    ms more")
    for name, values in times.items():
        print(f"{name:38}{1e3 * np.min(values):15.2f}{1e3 * more(times, name, 'none'):11.3f}")
    print(f"\nwork in a step, µs{'':6}{''.join(f'{way:>14}' for way in WAYS)}    times faster: threads, processes")
    for duration in DURATIONS:
        times = turns({way: partial(two, duration, *how) for way, how in WAYS.items()}, rounds)
        walls = "".join(f"{1e6 * np.min(values):14.1f}" for values in times.values())
        gains = [ratio(times, "one by one", way) for way in ("threads", "processes")]
        print(f"{1e6 * duration:18.0f}{'':6}{walls}{gains[0]:25.2f}{gains[1]:11.2f}")


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((float, int), sys.argv[1:], strict=False)))
