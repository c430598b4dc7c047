"""What a master costs beside the FMUs: two trivial FMUs in C, Jacobi, against a bare FMPy loop and libcosim.

    python -m benchmarks.master_overhead [STEPS]

p' = q, q' = -p by two FMUs of a line each (FMI 2.0, compiled here); both states are recorded. All contestants take
turns, and the best round of each counts. Printed, in µs a macro step: the whole loop, the time inside doStep, and what
is left; for our Jacobi also what the set and get calls of that rest take when they are made alone. libcosim takes part
if `libcosimpy` can be imported: once called from Python for every step, and once in its own loop in C++.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from time import perf_counter

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import compiled

H = 1e-3
PARAMETERS = {"p": {"start": 1.0, "gain": 1.0}, "q": {"start": 0.0, "gain": -1.0}}
ROUNDS = 10
Times = tuple[float, float | None]
"""Whole and inside doStep (None where it cannot be seen), µs a macro step."""


def graph() -> Graph:
    """Return the two FMUs in a loop."""
    parts = {}
    for name, values in PARAMETERS.items():
        parts[name] = Fmu(compiled("lag2"), name)
        parts[name].set_parameters(values)
    return Graph(parts, [Connection("p.y", "q.u"), Connection("q.y", "p.u")])


def ours(master: str, steps: int) -> Times:
    """Run one of our masters."""
    system = graph()
    log = simulate(system, MASTERS[master](system), 0.0, (steps + 1) * H, H, ["p.y", "q.y"])
    system.close()
    assert log.error is None
    return log.wall / steps * 1e6, sum(log.wall_components.values()) / steps * 1e6


def calls(steps: int) -> Times:
    """Make the set and get calls of one step alone: 2 set, 4 get as in `ours`."""
    system = graph()
    system.initialize(0.0)
    recorded = [Fmu.group(node.fmu, ["y"]) for node in system.nodes]
    made = [node.inputs.runs[0].set_call for node in system.nodes]
    made += [group.runs[0].get_call for group in [*(node.outputs for node in system.nodes), *recorded]]
    wall = timed(lambda: [call() for call in made], steps)
    system.close()
    return wall, None


def timed(function: Callable[[], object], steps: int) -> float:
    """Return the time of one call, µs."""
    clock = perf_counter()
    for _ in range(steps):
        function()
    return (perf_counter() - clock) / steps * 1e6


@cache
def slaves() -> tuple[list[FMU2Slave], dict[str, int]]:
    """Return two instances behind FMPy and the value references."""
    path = str(compiled("lag2"))
    description, folder = read_model_description(path), str(extract(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    made = []
    for name, values in PARAMETERS.items():
        slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="lag2", instanceName=name)
        slave.instantiate()
        slave.setReal([references[n] for n in values], list(values.values()))
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        made.append(slave)
    return made, references


def bare_fmpy(steps: int) -> Times:
    """Run the same exchange written with FMPy's lists."""
    (a, b), references = slaves()
    u, y, t, rows, inside = [references["u"]], [references["y"]], 0.0, [], 0.0
    clock = perf_counter()
    for _ in range(steps):
        start = perf_counter()
        a.doStep(t, H)
        b.doStep(t, H)
        inside += perf_counter() - start
        t += H
        p, q = a.getReal(y), b.getReal(y)
        a.setReal(u, q)
        b.setReal(u, p)
        rows.append((p[0], q[0]))
    return (perf_counter() - clock) / steps * 1e6, inside / steps * 1e6


def libcosim(steps: int, *, own_loop: bool) -> Times:
    """Run libcosim's fixed-step algorithm (Jacobi), a time-series observer on both states."""
    api = {name: getattr(import_module(f"libcosimpy.{name}"), name) for name in ("CosimExecution", "CosimObserver")}
    slave_of = import_module("libcosimpy.CosimSlave").CosimLocalSlave
    kinds = import_module("libcosimpy.CosimEnums").CosimVariableType
    execution = api["CosimExecution"].from_step_size(round(H * 1e9))
    u, y, gain, start = 1, 2, 3, 4
    places = []
    for name, values in PARAMETERS.items():
        place = execution.add_local_slave(slave_of(fmu_path=str(compiled("lag2")), instance_name=name))
        execution.real_initial_value(place, gain, values["gain"])
        execution.real_initial_value(place, start, values["start"])
        places.append(place)
    p, q = places
    execution.connect_real_variables(p, y, q, u)
    execution.connect_real_variables(q, y, p, u)
    observer = api["CosimObserver"].create_time_series(steps + 2)
    execution.add_observer(observer)
    for place in places:
        observer.start_time_series(place, y, kinds.REAL)
    execution.step(1)
    clock = perf_counter()
    for _ in range(1 if own_loop else steps):
        execution.step(steps if own_loop else 1)
    wall = (perf_counter() - clock) / steps * 1e6
    _, _, values = observer.time_series_real_samples(p, y, 1, steps)
    assert np.isfinite(values[-1])
    return wall, None


def contestants() -> dict[str, Callable[[int], Times]]:
    """Return who takes part."""
    found: dict[str, Callable[[int], Times]] = {"jacobi": lambda n: ours("jacobi", n), "set, get alone": calls}
    for master in ("gauss_seidel", "iqn_ils", "interface_jacobian"):
        found[master] = lambda n, master=master: ours(master, n)
    found["bare loop, FMPy"] = bare_fmpy
    try:
        logging = import_module("libcosimpy.CosimLogging")
        logging.log_output_level(logging.CosimLogLevel.WARNING)
        found["libcosim, step by step"] = lambda n: libcosim(n, own_loop=False)
        found["libcosim, its own loop"] = lambda n: libcosim(n, own_loop=True)
    except ImportError:
        print("libcosimpy is not installed: libcosim does not take part")
    return found


def main() -> None:
    """Print the table."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    found = contestants()
    best: dict[str, Times] = {}
    for _ in range(ROUNDS):
        for name, run in found.items():
            best[name] = min(best.get(name, (np.inf, None)), run(steps), key=lambda times: times[0])
    print(f"{'':24}{'whole':>8}{'doStep':>8}{'rest':>8}   µs a macro step")
    for name, (whole, inside) in best.items():
        share = "" if inside is None else f"{inside:8.1f}{whole - inside:8.1f}"
        print(f"{name:24}{whole:8.1f}{share}")


if __name__ == "__main__":
    main()
