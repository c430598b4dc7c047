"""FMUs in processes of their own: the same bits as in ours, and whatever they do there, nothing is lost and nothing silent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pytest

from orchestrator.coupling.course import Course
from orchestrator.coupling.fmu import nursery
from orchestrator.coupling.fmu.derivatives import Partials
from orchestrator.coupling.fmu.failure import CRASHED, NOT_FINITE, TIMEOUT, FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.isolated import Isolated, Limits
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import MILD, compiled, fmu, needs_compiler, oscillator, started

CALLS = {  # call → what of an error names it; those of the last two do not cost the run
    "load": "loading it", "instantiate": "loading it", "setup": "initialisation", "enter": "initialisation",
    "exit": "end of initialisation", "set": "writing u", "get": "reading y", "step": "the step of 0.01 s",
    "save": "saving the state", "restore": "restoring the state", "forget": "freeing a state",
    "derivative": "the directional derivative", "terminate": "the end of the run", "free": "freeing it",
}  # fmt: skip
ENDS = {
    "crash": "was ended by SIGSEGV", "exit": "ended with exit code 0", "exec": "went on as another program",
    "hang": "no answer within 2 s", "leak": "its memory is limited to 100 MB", "parent": "was ended by SIGKILL",
    "pour": "no answer within 2 s", "open": "it may have 50 files open",
}  # fmt: skip
HARMLESS = ("flood", "cwd", "modes", "nan")
LATER = ("set", "get", "step", "save", "restore", "forget")
"""Calls that fail in the middle of a run here."""
ENDLESS = ("hang", "pour")
"""Faults that a time-out ends; others have time, however busy the machine is."""


# -- the same bits -------------------------------------------------------------------------------------------


def lags(version: str, isolate: bool) -> Graph:
    """Return three integrators of a version of FMI in a ring; the third has a course beside, and makes two steps in one."""
    parts = {name: Fmu(compiled(f"lag{version}"), name, isolate=isolate) for name in "pqr"}
    if version == "3":
        pairs = [(a, b, i) for a, b in ("pq", "qr", "rp") for i in (1, 2)]
        return Graph(parts, [f"{a}.y[{i}] -> {b}.u[{i}]" for a, b, i in pairs])
    for k, part in enumerate(parts.values()):
        part.set_parameters({"start": 1.0 + k, "gain": -1.0} if version == "2" else {"start": 1.0 + k})
    return Graph(parts, ["p.y -> q.u", "q.y -> r.u", "r.y -> p.u"])


def same(make: Callable[[bool], Graph], master: str, steps: int = 20) -> None:
    """Run a graph here and in processes of its own, and hold them against each other, bit for bit."""
    logs = []
    for isolate in (False, True):
        with make(isolate) as graph:
            logs.append(simulate(graph, master, 0.0, 0.01 * steps, 0.01))
            assert all(isinstance(one.fmi, Isolated) is isolate for one in graph.components.values())
    here, apart = logs
    assert here.error is None and apart.error is None and len(apart.time) == steps + 1
    assert np.array_equal(here.values, apart.values)
    assert here.solves == apart.solves
    assert [s.iterations for s in here.steps] == [s.iterations for s in apart.steps]


@needs_compiler
@pytest.mark.parametrize("master", MASTERS)
def test_every_master_gives_the_same_bits(master: str):
    same(lambda isolate: lags("2", isolate), master)


@needs_compiler
@pytest.mark.parametrize(
    ("version", "master"), [("1", "jacobi"), ("1", "gauss_seidel"), ("3", "iqn_ils"), ("3", "jacobi")]
)
def test_every_version_gives_the_same_bits(version: str, master: str):
    same(lambda isolate: lags(version, isolate), master)


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian", "reduced_interface", "gauss_seidel"])
def test_fmus_in_python_give_the_same_bits(master: str):
    """Two pythonfmu FMUs; one of them makes two steps in one, but for the master that takes twins of it."""
    steps = (1, 1) if master == "reduced_interface" else (2, 1)
    same(lambda isolate: oscillator(**MILD, waveform=True, steps=steps, isolate=isolate), master)


@needs_compiler
def test_inputs_over_time_and_values_of_every_kind_come_through():
    found = []
    for isolate in (False, True):
        with Fmu(compiled("lag2"), "a", isolate=isolate) as a, fmu("odd", "b", isolate=isolate) as b, a.twin() as twin:
            a.follow({"u": Course(np.array([0.0, 1.0]), np.array([0.0, 2.0]))})
            for one in (started(a), started(twin), started(b)):
                one.step(0.0, 0.5)
            words = {name: b.read(name) for name in b.ports}
            found.append((a.read("y"), twin.read("y"), words, a.group(["y", "u", "gain"]).names))
    assert found[0] == found[1] and found[0][0] == 0.25


@needs_compiler
def test_states_that_are_kept_can_be_taken_back_in_any_order():
    with Fmu(compiled("lag2"), "a", isolate=True) as a:
        started(a).write("u", 1.0)
        states = []
        for k in range(5):
            states.append(a.save())
            a.step(0.1 * k, 0.1)
        for k in (3, 0, 4, 3):
            a.restore(states[k])
            assert a.read("y") == pytest.approx(0.1 * k, abs=1e-15)
        for state in states:
            a.release(state)


@needs_compiler
def test_without_fork_each_process_loads_all_for_itself(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(nursery, "FORKS", False)
    same(lambda isolate: lags("2", isolate), "iqn_ils", steps=3)


# -- whatever they do ----------------------------------------------------------------------------------------


def loop(isolate: bool | Limits) -> Graph:
    """Return p' = q, q' = p of a well-behaved FMU and the hostile one."""
    parts: dict[str, Fmu] = {}
    try:
        for name, file in (("p", "lag2"), ("q", "hostile2")):
            parts[name] = Fmu(compiled(file), name, isolate=isolate)
            parts[name].set_parameters({"start": 1.0})
        return Graph(parts, ["p.y -> q.u", "q.y -> p.u"])
    except BaseException:
        for part in parts.values():
            part.close()
        raise


def run(isolate: bool | Limits, derivative: bool = False) -> tuple[Log | None, str, list[str]]:
    """Run the loop for ten steps; return its log, what ended it, and what the hostile FMU has said."""
    try:
        graph = loop(isolate)
    except FmuError as error:
        return None, str(error), []
    with graph:
        log = simulate(graph, "iqn_ils", 0.0, 0.1, 0.01)
        said = str(log.error or "")
        try:
            matrix = Partials(graph.components["q"], ["y"], ["u"])() if derivative else np.zeros(1)
            said += "no derivative" if matrix is None else ""
        except FmuError as error:
            said = str(error)
    return log, said, list(graph.components["q"].log)


@pytest.fixture(scope="module")
def clean() -> Log:
    """The run without a fault, in this process."""
    log, said, _ = run(isolate=False)
    assert log is not None and said == ""
    return log


def check(call: str, fault: str, clean: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let one call misbehave and see that nothing is lost, nothing hangs, nothing is silent."""
    surroundings = Path.cwd(), {number: signal.getsignal(number) for number in signal.valid_signals()}
    monkeypatch.setenv("HOSTILE", f"{call} {fault} {0.045 if call in LATER else 0.0}")
    start = perf_counter()
    limits = Limits(timeout=2.0 if fault in ENDLESS else 60.0, memory=100.0, files=50)
    log, said, messages = run(limits, derivative=call == "derivative")
    assert perf_counter() - start < 60.0
    assert surroundings == (Path.cwd(), {number: signal.getsignal(number) for number in signal.valid_signals()})
    last = call in ("terminate", "free")
    if fault in ENDS:
        told = "\n".join(messages) if last else said
        assert f"{CALLS[call]}: " in told and ENDS[fault] in told, told
        if fault == "crash" and not last:
            assert f"about to crash in {call}" in said
    elif fault == "nan" and call in ("get", "step", "derivative"):
        assert "not a finite number" in said or said == "no derivative"
    else:
        assert said == ""
    if fault == "flood":
        assert any("[printed] line" in line for line in messages) and any("message" in line for line in messages)
        assert len(messages) == 1001 and "more messages" in messages[500]
    if log is not None:
        n = len(log.time)
        assert n >= (5 if call in LATER else 11 if last or call == "derivative" else 0)
        assert np.array_equal(log.values, clean.values[:n])
        assert log.error is None or log.error.status in (CRASHED, TIMEOUT, NOT_FINITE)


@needs_compiler
@pytest.mark.parametrize(
    ("call", "fault"),
    [
        ("load", "exit"), ("instantiate", "crash"), ("exit", "exec"), ("set", "crash"), ("get", "exit"), ("step", "crash"),
        ("step", "flood"), ("step", "leak"), ("save", "crash"), ("restore", "exit"), ("forget", "crash"), ("step", "modes"),
        ("derivative", "exit"), ("terminate", "crash"), ("free", "exit"), ("get", "hang"), ("get", "nan"),
        ("step", "parent"), ("step", "pour"), ("step", "open"),
    ],
)  # fmt: skip
def test_a_hostile_call_costs_nothing_but_itself(call, fault, clean, monkeypatch):
    check(call, fault, clean, monkeypatch)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("fault", [*ENDS, *HARMLESS])
@pytest.mark.parametrize("call", CALLS)
def test_every_fault_in_every_call(call, fault, clean, monkeypatch):
    check(call, fault, clean, monkeypatch)


# -- who ends with whom --------------------------------------------------------------------------------------

HANGING = """
import sys
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.nursery import _one
quiet, hanging = (Fmu(sys.argv[1], name, isolate=True) for name in "ab")
print(_one[0].pid, quiet.fmi.pid, hanging.fmi.pid, flush=True)
hanging.enter_initialization(0.0)
hanging.exit_initialization()
hanging.step(0.0, 0.1)
"""


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_orphan_survives_however_the_parent_ends(number: int):
    command = [sys.executable, "-c", HANGING, str(compiled("hostile2"))]
    environment = os.environ | {"HOSTILE": "step hang"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as parent:
        assert parent.stdout is not None
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        sleep(0.2)
        assert len(pids) == 3 and all(map(is_alive, pids))
        parent.send_signal(number)
    until = perf_counter() + 10.0
    while any(map(is_alive, pids)) and perf_counter() < until:
        sleep(0.02)
    assert not any(map(is_alive, pids))


@needs_compiler
def test_what_is_printed_is_in_the_log_and_nowhere_else(clean, monkeypatch, capfd):
    check("step", "flood", clean, monkeypatch)
    assert capfd.readouterr() == ("", "")
