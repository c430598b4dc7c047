"""What a master costs beside the FMUs: two trivial FMUs in C, Jacobi, against a bare FMPy loop and libcosim.

    python -m benchmarks.master_overhead [STEPS [ROUNDS]]

p' = q, q' = -p by two FMUs of a line each (FMI 2.0, compiled here); both states are recorded. All contestants take turns.
Printed, in µs of CPU time a macro step: the whole loop (median), and by the bare loop over FMPy's lists (median of the
ratios within a round); also what the steps of the FMUs, and the calls that set and get, take when they are made alone.
libcosim takes part if `libcosimpy` can be imported: called from Python for every step, and in its own loop in C++.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from benchmarks.clock import Loop, ratio, spent, turns
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import compiled

H = 1e-3
PARAMETERS = {"p": {"start": 1.0, "gain": 1.0}, "q": {"start": 0.0, "gain": -1.0}}
PEER = "bare loop, FMPy"
OURS = ("jacobi", "gauss_seidel", "iqn_ils", "interface_jacobian")


def graph() -> Graph:
    """Return the two FMUs in a loop."""
    parts = {}
    for name, values in PARAMETERS.items():
        parts[name] = Fmu(compiled("lag2"), name)
        parts[name].set_parameters(values)
    return Graph(parts, [Connection("p.y", "q.u"), Connection("q.y", "p.u")])


def ours(master: str, steps: int) -> float:
    """Run one of our masters."""
    system, loop = graph(), Loop()
    log = simulate(system, MASTERS[master](system), 0.0, (steps + 1) * H, H, ["p.y", "q.y"], loop)
    cost = loop.spent()
    system.close()
    assert log.error is None
    return cost


def repeated(call: Callable[[], object], steps: int) -> float:
    """Return the CPU time of `steps` calls, s."""

    def loop() -> None:
        for _ in range(steps):
            call()

    return spent(loop)


def calls(steps: int) -> float:
    """Make the set and get calls of one step alone: 2 set, 4 get as in `ours`."""
    system = graph()
    system.initialize(0.0)
    recorded = [Fmu.group(node.fmu, ["y"]) for node in system.nodes]
    made = [node.inputs.runs[0].set_call for node in system.nodes]
    made += [group.runs[0].get_call for group in [*(node.outputs for node in system.nodes), *recorded]]
    cost = repeated(lambda: [call() for call in made], steps)
    system.close()
    return cost


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


def steps_alone(steps: int) -> float:
    """Make the two steps of a macro step alone, through FMPy."""
    (a, b), _ = slaves()
    return repeated(lambda: (a.doStep(0.0, H), b.doStep(0.0, H)), steps)


def bare_fmpy(steps: int) -> float:
    """Run the same exchange written with FMPy's lists."""
    (a, b), references = slaves()
    u, y, t, rows = [references["u"]], [references["y"]], 0.0, []

    def loop() -> None:
        nonlocal t
        for _ in range(steps):
            a.doStep(t, H)
            b.doStep(t, H)
            t += H
            p, q = a.getReal(y), b.getReal(y)
            a.setReal(u, q)
            b.setReal(u, p)
            rows.append((p[0], q[0]))

    return spent(loop)


def libcosim(steps: int, *, own_loop: bool) -> float:
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
    cost = spent(lambda: execution.step(steps)) if own_loop else repeated(lambda: execution.step(1), steps)
    _, _, values = observer.time_series_real_samples(p, y, 1, steps)
    assert np.isfinite(values[-1])
    return cost


def contestants(steps: int) -> dict[str, Callable[[], float]]:
    """Return who takes part."""
    found: dict[str, Callable[[], float]] = {PEER: partial(bare_fmpy, steps)}
    found |= {master: partial(ours, master, steps) for master in OURS}
    found |= {"steps alone, FMPy": partial(steps_alone, steps), "set, get alone": partial(calls, steps)}
    try:
        logging = import_module("libcosimpy.CosimLogging")
        logging.log_output_level(logging.CosimLogLevel.WARNING)
        found["libcosim, step by step"] = partial(libcosim, steps, own_loop=False)
        found["libcosim, its own loop"] = partial(libcosim, steps, own_loop=True)
    except ImportError:
        print("libcosimpy is not installed: libcosim does not take part")
    return found


def main(steps: int = 5000, rounds: int = 10) -> None:
    """Print the table."""
    times = turns(contestants(steps), rounds)
    print(f"{'':24}{'µs of CPU a macro step':>24}{'by the bare loop':>20}")
    for name, values in times.items():
        print(f"{name:24}{1e6 * np.median(values) / steps:24.1f}{ratio(times, name, PEER):20.2f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
