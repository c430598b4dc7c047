"""What stepping two FMUs in threads saves: Jacobi, steps that work for a set time, one by one against side by side.

    python -m benchmarks.parallel_steps [STEPS [ROUNDS]]

Two FMUs in C (compiled here), each busy for the time in the first column. The contestants take turns. Threads save wall
time, not CPU time, and only where another processor is free: printed are the wall time of a macro step in µs (median), the
ratio of serial to parallel for threads always and for `auto`, with its choice, and the CPU time of threads by that of
serial steps (medians of the ratios within a round).
"""

from __future__ import annotations

import sys
import threading
from functools import partial
from time import perf_counter, process_time

import numpy as np

from benchmarks.clock import ratio, turns
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import compiled

H = 1e-3
DURATIONS = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3)  # s of work in a step
PARALLEL = ("never", "always", "auto")
WARM_UP = 10


class Contest:
    """Steps that work for `duration` s; wall times and choices are noted, CPU times returned.

    Attributes
    ----------
    wall : way → median wall time of a macro step in each round, s
    threads : way → whether threads were used at the end of each round
    """

    def __init__(self, duration: float, count: int):
        self.duration, self.count = duration, count
        self.wall: dict[str, list[float]] = {way: [] for way in PARALLEL}
        self.threads: dict[str, list[bool]] = {way: [] for way in PARALLEL}

    def run(self, way: str) -> float:
        """Run and return the CPU time, s."""
        parts = {name: Fmu(compiled("lag2"), name) for name in "pq"}
        for part in parts.values():
            part.set_parameters({"start": 1.0, "duration": -self.duration})
        graph = Graph(parts, [Connection("p.y", "q.u"), Connection("q.y", "p.u")])
        alive, stamps, threads = threading.active_count(), [], [False]

        def on_step(_: object) -> None:
            stamps.append((perf_counter(), process_time()))
            threads[0] = threading.active_count() > alive

        master = MASTERS["jacobi"](graph, parallel=way)  # type: ignore[call-arg]
        simulate(graph, master, 0.0, (self.count + WARM_UP + 1) * H, H, ["p.y"], on_step)
        graph.close()
        wall, cpu = np.array(stamps)[WARM_UP:].T
        self.wall[way].append(float(np.median(np.diff(wall))))
        self.threads[way].append(threads[0])
        return float(cpu[-1] - cpu[0])


def main(count: int = 100, rounds: int = 5) -> None:
    """Print the table."""
    print("work in a step, µs   serial   threads  ratio      auto  ratio  CPU by serial  auto chose")
    for duration in DURATIONS:
        contest = Contest(duration, count)
        cpu = turns({way: partial(contest.run, way) for way in PARALLEL}, rounds)
        wall = {way: np.array(times) for way, times in contest.wall.items()}
        serial, threaded, auto = (1e6 * np.median(times) for times in wall.values())
        gains = [ratio(wall, "never", way) for way in ("always", "auto")]
        row = f"{1e6 * duration:18.0f} {serial:8.1f} {threaded:9.1f} {gains[0]:6.2f} {auto:9.1f} {gains[1]:6.2f}"
        chosen = contest.threads["auto"]
        print(f"{row}{ratio(cpu, 'always', 'never'):15.2f}  threads {sum(chosen)} times of {len(chosen)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
