"""FMUs in processes of their own: the same bits as in ours, and whatever they do there, nothing is lost and nothing silent."""

from __future__ import annotations

import signal
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from orchestrator.coupling.fmu.derivatives import Partials
from orchestrator.coupling.fmu.failure import CRASHED, NOT_FINITE, TIMEOUT, FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.isolated import Limits
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import compiled, needs_compiler

CALLS = {  # call → what of an error names it; those of the last two do not cost the run
    "load": "loading it", "instantiate": "loading it", "setup": "initialisation", "enter": "initialisation",
    "exit": "end of initialisation", "set": "writing u", "get": "reading y", "step": "the step of 0.01 s",
    "save": "saving the state", "restore": "restoring the state", "forget": "freeing a state",
    "derivative": "the directional derivative", "terminate": "the end of the run", "free": "freeing it",
}  # fmt: skip
ENDS = {
    "crash": "was ended by SIGSEGV", "exit": "ended with exit code 0", "exec": "went on as another program",
    "hang": "no answer within 1 s", "leak": "its memory is limited to 100 MB", "parent": "was ended by SIGKILL",
}  # fmt: skip
HARMLESS = ("flood", "cwd", "modes", "nan")
LATER = ("set", "get", "step", "save", "restore", "forget")
"""Calls that fail in the middle of a run here."""
LIMITS = Limits(timeout=1.0, memory=100.0)


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


@pytest.fixture
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
    log, said, messages = run(LIMITS, derivative=call == "derivative")
    assert perf_counter() - start < 20.0
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
        assert sum("line" in line for line in messages) >= 500 and len(messages) <= 1001
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
        ("derivative", "exit"), ("terminate", "crash"), ("free", "exit"), ("get", "hang"), ("get", "nan"), ("step", "parent"),
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
