"""Two test FMUs in a loop, p' = q and q' = -p, run by another engine in a process of its own.

    python -m tests.engines cosim FILE.fmu STEP COUNT

Both engines step all FMUs and then move all outputs: libcosim (by libcosimpy) and ecos (by ecospy, which needs oneTBB).
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import sys
from pathlib import Path

U, Y, GAIN, START = 1, 2, 3, 4
"""Value references of tests/fmus/lag2.xml."""


def cosim(path: str, H: float, n: int) -> list[list[float]]:
    """Return p and q after each of `n` steps of `H` s by libcosim's fixed-step algorithm."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution, observer = CosimExecution.from_step_size(round(H * 1e9)), CosimObserver.create_last_value()
    p, q = (execution.add_local_slave(CosimLocalSlave(path, name)) for name in "pq")
    execution.real_initial_value(p, START, 1.0)
    execution.real_initial_value(q, GAIN, -1.0)
    execution.connect_real_variables(p, Y, q, U)
    execution.connect_real_variables(q, Y, p, U)
    execution.add_observer(observer)
    rows = []
    for _ in range(n):
        execution.step()
        rows.append([observer.last_real_values(slave, [Y])[0] for slave in (p, q)])
    return rows


def ecos(path: str, H: float, n: int) -> list[list[float]]:
    """Return p and q after each of `n` steps of `H` s by ecos."""
    with contextlib.suppress(OSError):  # the library does not look where the package `tbb` puts it
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        for name in "pq":
            structure.add_model(name, path)
        structure.make_real_connection("p::y", "q::u")
        structure.make_real_connection("q::y", "p::u")
        structure.add_parameter_set("start", {"p::start": 1.0, "q::gain": -1.0})
        with EcosSimulation(structure=structure, step_size=H) as simulation:
            simulation.init(parameter_set="start")
            return [_stepped(simulation) for _ in range(n)]


def _stepped(simulation) -> list[float]:
    simulation.step()
    return [simulation.get_real("p::y"), simulation.get_real("q::y")]


ENGINES = {"cosim": cosim, "ecos": ecos}

if __name__ == "__main__":
    engine, fmu, length, count = sys.argv[1:]
    print(json.dumps(ENGINES[engine](fmu, float(length), int(count))))
