"""ecos: its fixed-step algorithm, on an SSP archive."""

from __future__ import annotations

import contextlib
import ctypes
import sys
from pathlib import Path
from time import process_time

from benchmarks.pack.engines import child

NAME, TITLE, LIBRARY = "ecos", "ecos", "ecospy"


def drive(path: str, H: float, steps: int, every: int, signals: list[str]) -> tuple[list[list[float]], float]:
    """Return every so many rows. The first step, which loads, is not timed."""
    with contextlib.suppress(OSError):  # the library does not look where the package `tbb` puts it
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation

    names = [signal.replace(".", "::", 1) for signal in signals]
    rows, begin = [], 0.0
    with EcosSimulation(ssp_path=path, step_size=H) as simulation:
        simulation.init(parameter_set=None)
        for i in range(1, steps + 1):
            simulation.step()
            begin = begin or process_time()
            if i % every == 0:
                rows.append([simulation.get_real(name) for name in names])
    return rows, process_time() - begin


if __name__ == "__main__":
    child.main(drive, sys.argv[1:])
