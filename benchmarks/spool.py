"""What it costs that results go to disk as they come: runs with and without, in turns.

    python -m benchmarks.spool [ROUNDS]

The flagship (2 s at 5 ms, 600 signals a row) and the oscillator (10 s at 1 ms, 7 signals). Printed: CPU time of the loop in
µs a macro step, and the median over the rounds of the ratio within a round. With and without, tables are written once,
at the end; that is not counted.
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.clock import Loop, ratio, turns
from orchestrator.coupling.run.simulate import simulate
from orchestrator.runs.components import master_of, opened, recorded
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.read import load

RUNS = {"landing_200m_point9": (2.0, 0.005), "oscillator": (10.0, 0.001)}
"""Scenario → stop time and macro step, s."""


def made(system: System, on_disk: bool) -> float:
    """Make a run; return the CPU time of its loop, s."""
    simulation, loop = system.scenario.simulation, Loop()
    with opened(system) as graph, tempfile.TemporaryDirectory() as folder:
        wanted, master = recorded(graph, system.scenario), master_of(system.scenario, graph)
        place = Path(folder) if on_disk else None
        log = simulate(graph, master, 0.0, simulation.stop_time, simulation.macro_step, wanted, loop, folder=place)
        cost = loop.spent()
        log.raise_error()
    return cost


def main(rounds: int = 7) -> None:
    """Print a line for each scenario."""
    for name, (stop, step) in RUNS.items():
        settings = [f"simulation.stop_time={stop}", f"simulation.macro_step={step}"]
        system = resolve(load(name, settings))
        contestants = {"without": partial(made, system, False), "with": partial(made, system, True)}
        turns(contestants, 1)  # compiles
        times = turns(contestants, rounds)
        each = {kind: 1e6 * float(np.median(values)) * step / stop for kind, values in times.items()}
        by = ratio(times, "with", "without")
        print(
            f"{name}: {each['without']:.0f} µs a step in memory, {each['with']:.0f} µs to disk; {100 * (by - 1):+.1f} %"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
