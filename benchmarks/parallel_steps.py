"""What stepping two FMUs in threads saves: Jacobi, steps that work for a set time, one by one against side by side.

    python -m benchmarks.parallel_steps [STEPS]

Two FMUs in C (compiled here), each busy for the time in the first column. The contestants take turns; printed are the
medians of all macro steps in µs, and the ratio of serial to parallel for threads always and for `auto`, with its choice.
"""

from __future__ import annotations

import sys
import threading
from time import perf_counter

import numpy as np

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import compiled

H = 1e-3
ROUNDS = 5
DURATIONS = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3)  # s of work in a step


def steps(duration: float, parallel: str, count: int) -> tuple[np.ndarray, bool]:
    """Return the times of `count` macro steps, s, without the first ten, and whether threads were used at the end."""
    parts = {name: Fmu(compiled("lag2"), name) for name in "pq"}
    for part in parts.values():
        part.set_parameters({"start": 1.0, "duration": -duration})
    graph = Graph(parts, [Connection("p.y", "q.u"), Connection("q.y", "p.u")])
    alive, stamps, threads = threading.active_count(), [], [False]

    def on_step(_: object) -> None:
        stamps.append(perf_counter())
        threads[0] = threading.active_count() > alive

    master = MASTERS["jacobi"](graph, parallel=parallel)  # type: ignore[call-arg]
    simulate(graph, master, 0.0, (count + 11) * H, H, ["p.y"], on_step)
    graph.close()
    return np.diff(stamps)[10:], threads[0]


def main(count: int) -> None:
    """Print the table."""
    print("work in a step, µs   serial   threads  ratio      auto  ratio  auto chose")
    for duration in DURATIONS:
        times: dict[str, list[np.ndarray]] = {"never": [], "always": [], "auto": []}
        chosen = []
        for _ in range(ROUNDS):
            for parallel, found in times.items():
                made, threads = steps(duration, parallel, count)
                found.append(made)
                if parallel == "auto":
                    chosen.append(threads)
        serial, threaded, auto = (1e6 * float(np.median(np.concatenate(found))) for found in times.values())
        ratios = f"{serial:8.1f} {threaded:9.1f} {serial / threaded:6.2f} {auto:9.1f} {serial / auto:6.2f}"
        print(f"{1e6 * duration:18.0f} {ratios}  threads {sum(chosen)} times of {len(chosen)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
