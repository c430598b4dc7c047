"""libcosim: its fixed-step algorithm, on an SSP archive."""

from __future__ import annotations

import sys
from time import process_time

from benchmarks.pack.engines import child

NAME, TITLE, LIBRARY = "libcosim", "libcosim", "libcosimpy"


def drive(path: str, H: float, steps: int, every: int, signals: list[str]) -> tuple[list[list[float]], float]:
    """Return every so many rows; the first step, which loads, is not timed."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution = CosimExecution.from_ssp_file(path, round(H * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = [_place(execution, signal) for signal in signals]
    rows, begin = [], 0.0
    for i in range(1, steps + 1):
        if not execution.step():
            raise RuntimeError(f"libcosim failed at t = {i * H:g} s")
        begin = begin or process_time()
        if i % every == 0:
            rows.append([observer.last_real_values(*place)[0] for place in places])
    return rows, process_time() - begin


def _place(execution, signal: str) -> tuple[int, list[int]]:
    """Return the simulator's number and the variable's reference."""
    name, _, variable = signal.partition(".")
    slave = execution.slave_index_from_instance_name(name)
    references = {one.name.decode(): one.reference for one in execution.slave_variables(slave)}
    return slave, [references[variable]]


if __name__ == "__main__":
    child.main(drive, sys.argv[1:])
