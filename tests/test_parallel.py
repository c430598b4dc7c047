"""Components stepped in threads: the same bits, the same errors, less time; threads end with the run."""

from __future__ import annotations

import threading
from time import perf_counter, sleep

import numpy as np
import pytest

from orchestrator.coupling.fmu.failure import TIMEOUT
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.parallel import processors
from tests.fmus import MILD, compiled, needs_compiler, oscillator

pytestmark = needs_compiler
NAMES = ("p", "q", "r")
PARALLEL = [name for name in MASTERS if name != "reduced_interface"]


def lags(*, ring: bool = True, isolate: bool = False, **parameters: dict) -> Graph:
    """Three integrators: in a ring p → q → r → p, or (all independent in a round) without connections to each other."""
    parts = {name: Fmu(compiled("lag2"), name, isolate=isolate) for name in NAMES}
    for k, (name, part) in enumerate(parts.items()):
        part.set_parameters({"start": 1.0 + k, "gain": -1.0, **parameters.get(name, {})})
    pairs = [("p.y", "q.u"), ("q.y", "r.u"), ("r.y", "p.u")] if ring else [(f"{n}.y", f"{n}.u") for n in NAMES]
    return Graph(parts, [Connection(*pair) for pair in pairs])


def run(master: str, graph: Graph, parallel: str, steps: int = 20, **options) -> tuple[Log, Master]:
    made = MASTERS[master](graph, parallel=parallel, **options)  # type: ignore[call-arg]
    log = simulate(graph, made, 0.0, steps * 0.01, 0.01)
    graph.close()
    return log, made


@pytest.mark.parametrize("master", PARALLEL)
def test_bit_identical_to_serial_stepping(master: str):
    for ring in (True, False):
        if master == "interface_jacobian" and not ring:
            continue  # it needs components to iterate over
        before = threading.active_count()
        serial, _ = run(master, lags(ring=ring), "never")
        threaded, _ = run(master, lags(ring=ring), "always")
        assert serial.error is None and threaded.error is None
        assert np.array_equal(serial.values, threaded.values)
        assert serial.solves == threaded.solves
        assert threading.active_count() == before


def test_threads_are_used_and_end_with_the_run():
    seen = []
    graph = lags()
    simulate(
        graph, MASTERS["jacobi"](graph, parallel="always"), 0.0, 0.05, 0.01,
        on_step=lambda _: seen.append(threading.active_count()),
    )  # fmt: skip
    graph.close()
    assert seen == [threading.active_count() + 2] * 5  # the caller steps one of the three itself


@pytest.mark.skipif(processors() < 2, reason="one processor")
def test_auto_uses_threads_for_long_steps_alone():
    """Three steps that sleep for 10 ms: 30 ms one by one, 20 ms by two threads; nothing to win where a step takes 1 µs.

    A busy machine wakes sleepers late, but that slows both: two thirds of the time, held against nine tenths.
    """
    counts, stamps = [], []

    def on_step(_: object) -> None:
        counts.append(threading.active_count())
        stamps.append(perf_counter())

    before, long = threading.active_count(), {name: {"duration": 10e-3} for name in NAMES}
    graph = lags(**long)
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.2, 0.01, on_step=on_step)
    graph.close()
    assert log.error is None
    assert counts[0] == before < counts[-1]
    assert np.array_equal(log.values, run("jacobi", lags(), "never")[0].values)
    assert np.median(np.diff(stamps)[-10:]) < 0.9 * np.median(np.diff(stamps)[:4])
    graph = lags()
    simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.2, 0.01, on_step=on_step)
    graph.close()
    assert counts[-1] == before


def test_fmus_that_hold_the_interpreter_stay_in_one_thread():
    before, counts = threading.active_count(), []
    graph = oscillator(**MILD)
    master = MASTERS["jacobi"](graph, parallel="always")
    simulate(graph, master, 0.0, 0.05, 0.01, on_step=lambda _: counts.append(threading.active_count()))
    graph.close()
    assert counts == [before] * 5


@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel", "iqn_ils"])
@pytest.mark.parametrize("failing", [("q",), ("q", "r"), ("r", "p")])
def test_errors_are_those_of_serial_stepping(master: str, failing: tuple[str, ...]):
    """The first of the order that fails is the one that is named, whoever is done first."""
    faults = {
        name: {"fault": 3.0, "fault_time": 0.045, "duration": 1e-3 if name == failing[0] else 0.0} for name in failing
    }
    logs = [run(master, lags(ring=False, **faults), parallel)[0] for parallel in ("never", "always")]
    serial, threaded = logs
    assert serial.error is not None and threaded.error is not None
    assert str(threaded.error) == str(serial.error)
    assert threaded.error.component == sorted(failing)[0] and len(threaded.time) == 6
    assert np.array_equal(serial.values, threaded.values)


def test_time_out_names_the_one_that_hangs():
    before, graph = threading.active_count(), lags(q={"duration": 0.8})
    master = MASTERS["jacobi"](graph, parallel="always")
    log = simulate(graph, master, 0.0, 0.1, 0.01, timeout=0.2)
    assert log.error is not None
    assert (log.error.component, log.error.status, len(log.time)) == ("q", TIMEOUT, 1)
    while threading.active_count() > before:  # the call returns, and all threads that waited for it end
        sleep(0.05)
    for part in graph.components.values():
        assert part.abandoned
        part.abandoned = False
    graph.close()


# -- in processes of their own ----------------------------------------------------------------------------------


@pytest.mark.parametrize("parallel", ["auto", "always"])
def test_what_has_a_process_of_its_own_steps_while_others_do(parallel: str):
    """Three steps that sleep for 20 ms take 60 ms one by one; no thread is needed, and one processor is enough."""
    long = {name: {"duration": 20e-3} for name in NAMES}
    walls = {}
    for way in (parallel, "never"):
        before, stamps = threading.active_count(), []
        with lags(isolate=True, **long) as graph:
            master = MASTERS["jacobi"](graph, parallel=way)  # type: ignore[call-arg]
            log = simulate(graph, master, 0.0, 0.1, 0.01, on_step=lambda _, s=stamps: s.append(perf_counter()))
            assert threading.active_count() == before
        assert log.error is None and np.array_equal(log.values, run("jacobi", lags(), "never", 10)[0].values)
        walls[way] = np.median(np.diff(stamps))
    assert walls[parallel] < 0.7 * walls["never"]


@pytest.mark.parametrize("failing", [("q",), ("q", "r"), ("r", "p")])
@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel", "iqn_ils"])
def test_errors_beside_each_other_are_those_of_serial_stepping(master: str, failing: tuple[str, ...]):
    faults = {name: {"fault": 3.0, "fault_time": 0.045} for name in failing}
    serial = run(master, lags(ring=False, **faults), "never")[0]
    beside = run(master, lags(ring=False, isolate=True, **faults), "auto")[0]
    assert str(beside.error) == str(serial.error) and len(beside.time) == 6
    assert np.array_equal(serial.values, beside.values)


@pytest.mark.parametrize("failing", ["q", "r"])
def test_a_process_that_ends_beside_others_costs_no_result(failing: str):
    """The others have stepped by then; what is recorded ends where all have come to."""
    log = run("jacobi", lags(isolate=True, **{failing: {"fault": 20.0, "fault_time": 0.045}}), "auto")[0]
    assert log.error is not None and log.error.component == failing and "SIGSEGV" in log.error.message
    assert np.array_equal(log.values, run("jacobi", lags(), "never")[0].values[:6])


def test_choices():
    graph = lags()
    with pytest.raises(ValueError, match="parallel 'often': choose auto, always, never"):
        MASTERS["jacobi"](graph, parallel="often")
    graph.close()
