"""FMPy: its runner of system structures, which steps all FMUs and then moves all values."""

from __future__ import annotations

import sys
from time import process_time

from benchmarks.pack.engines import child

NAME, TITLE, LIBRARY = "fmpy", "FMPy", "fmpy"


def drive(path: str, H: float, steps: int, every: int, signals: list[str]) -> tuple[list[list[float]], float]:
    """Return every so many rows; a run of one step goes before, whose time is taken off: there is no hook at the start."""
    from fmpy.ssp.simulation import simulate_ssp

    def simulated(n: int):
        begin = process_time()
        found = simulate_ssp(path, stop_time=(n - 0.5) * H, step_size=H)
        return found, process_time() - begin

    simulated(1)
    _, loading = simulated(1)
    found, whole = simulated(steps)
    rows = [[float(found[signal][i]) for signal in signals] for i in range(every - 1, steps, every)]
    return rows, max(whole - loading, 0.0)


if __name__ == "__main__":
    child.main(drive, sys.argv[1:])
