"""FMI to the letter: what an FMU may rely on, and what it may say."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator.coupling import simulate
from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.fmu import printf
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.messages import Messages
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.runs.files import read_run
from tests.fmus import compiled, described, needs_compiler

pytestmark = needs_compiler
H, STOP = 0.1, 2.0


def letter(name: str, **parameters: float) -> Fmu:
    fmu = Fmu(compiled("letter2"), name)
    fmu.set_parameters(parameters)
    return fmu


def pair(**parameters: float) -> Graph:
    """Return two FMUs in a loop, `parameters` being those of the first."""
    parts = {"a": letter("a", **parameters), "b": letter("b", start=0.0)}
    return Graph(parts, ["a.x -> b.u", "b.x -> a.u"])


# -- no state from before the present point ----------------------------------------------------------------


def test_a_step_of_a_master_that_never_goes_back_is_final():
    """x' = -x by 2000 Euler steps of 1 ms: 0.999^2000 = 0.1352; an FMU that took its steps for tentative stays at 0.905."""
    with Graph({"a": letter("a", tentative=1.0)}, []) as graph:
        assert simulate(graph, "jacobi", 0.0, STOP, H).signal("a.x")[-1] == pytest.approx(0.999**2000, rel=1e-12)


@pytest.mark.parametrize("master", MASTERS)
def test_tentative_or_not_makes_no_difference_to_any_master(master: str):
    """States at the beginning of a step are restored to that point, not to one before it: both FMUs do the same steps."""
    ends = []
    for tentative in (0.0, 1.0):
        with pair(tentative=tentative) as graph:
            ends.append(simulate(graph, master, 0.0, STOP, H).values[-1])
    assert np.array_equal(*ends)


def test_while_an_older_state_is_kept_a_step_says_so():
    """Kept at 0.1 s: the step from there may say that none lies before, the next one must not; released, it may again."""
    fmu, said = letter("a"), []
    call = fmu.fmi.do_step
    fmu.fmi.do_step = lambda t, h, none_before: (said.append(none_before), call(t, h, none_before))[1]
    with fmu:
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()
        fmu.step(0.0, H)
        state = fmu.save()
        fmu.step(0.1, H)
        fmu.step(0.2, H)
        fmu.restore(state)
        fmu.step(0.1, H)
        fmu.release(state)
        fmu.step(0.2, H)
    assert said == [True, True, False, True, True]


# -- what it says --------------------------------------------------------------------------------------------

FORMATS, WORDS, STRAY = 11.0, 12.0, 13.0
"""Faults of tests/fmus/letter2.c: a message with arguments, of two lines, and with a directive that has no argument."""


def failed(fault: float, master: str = "jacobi") -> Log:
    with Graph({"a": letter("a", fault=fault, fault_time=1.05)}, []) as graph:
        return simulate(graph, master, 0.0, STOP, H)


def test_a_message_is_put_together_from_its_arguments():
    """By printf's rules; what comes after it, of status OK, is not the cause."""
    log = failed(FORMATS)
    assert log.time[-1] == pytest.approx(1.0)
    text = "tyre model failed: 1234.5 N is above 1000 (123% of what is allowed), N, 1.500   |7"
    assert f"the FMU says: [error] {text}" in str(log.error)


def test_the_second_line_belongs_to_the_cause():
    assert "[error] Newton's method failed. A smaller step may help, or 50% of the load" in str(failed(WORDS).error)


def test_a_message_that_is_no_format_ends_nothing():
    """``%s`` without an argument: C would read where nothing is. What is put there is chance; that it goes on is not."""
    assert "100 % of" in str(failed(STRAY).error)


def test_floods_are_bounded():
    messages = Messages()
    for i in range(10**5):
        messages.add(1, f"number {i}")
    kept = list(messages)
    assert (messages.count, messages.warnings, len(kept)) == (10**5, 10**5, 1001)
    assert (
        kept[0] == "[warning] number 0"
        and kept[-1] == "[warning] number 99999"
        and kept[500] == "… 99000 more messages …"
    )


@pytest.mark.parametrize(
    ("text", "arguments", "expected"),
    [
        ("%d%% of %s", (5, 0), "5% of (null)"),
        ("%5d|%-5d|%05d|%+d", (1, 2, 3, 4), "    1|2    |00003|+4"),
        ("%u", (-1,), "4294967295"),
        ("%lu %llx", (-1, 255), "18446744073709551615 ff"),
        ("%d", (2**32 - 5,), "-5"),
        ("%s", (8,), "%s"),  # nothing stands in the first page of memory
        ("50 % of the load", (), "50 % of the load"),
    ],
)
@pytest.mark.skipif(not printf.APART, reason="the arguments of this platform come otherwise")
def test_directives(text: str, arguments: tuple[int, ...], expected: str):
    """As ``printf`` of C, see its standard (ISO 9899, 7.21.6.1)."""
    assert printf.formatted(text, (*[0.0] * printf.NUMBERS, *arguments)) == expected


# -- how it answers ------------------------------------------------------------------------------------------

TERMINATES = 10.0


@pytest.mark.parametrize("master", ["jacobi", "iqn_ils", "interface_jacobian"])
def test_one_that_asks_for_the_end_has_it(master: str):
    """fmi2Discard with fmi2Terminated: nothing has failed, and what was reached is complete."""
    parts = {"a": letter("a", fault=TERMINATES, fault_time=1.05), "b": letter("b", start=0.0)}
    with Graph(parts, ["a.x -> b.u", "b.x -> a.u"]) as graph:
        log = simulate(graph, master, 0.0, STOP, H)
    assert log.error is None and log.time[-1] == pytest.approx(1.0) and np.isfinite(log.values).all()
    assert log.ended == "a asks for the end of the simulation at t = 1 s"


@pytest.mark.parametrize("status", [-1.0, 5.0, 77.0])
def test_a_status_that_is_none_is_an_error(status: float):
    log = failed(status)
    assert log.error is not None and log.time[-1] == pytest.approx(1.0)


# -- scenarios -----------------------------------------------------------------------------------------------

GRAPH = """
title = "two of them"
connections = {connections}
simulation = {{ stop_time = 2.0, macro_step = 0.1, master = "{master}", estimate = "none"{more} }}
components.a = {{ fmu = "{file}"{a} }}
components.b = {{ fmu = "{file}", parameters = {{ start = 0.0 }}{a} }}
"""
LOOP = '["a.x -> b.u", "b.x -> a.u"]'


def written(
    folder: Path, file: Path, connections: str = LOOP, master: str = "iqn_ils", more: str = "", a: str = ""
) -> Path:
    path = folder / "graph.toml"
    path.write_text(GRAPH.format(file=file, connections=connections, master=master, more=more, a=a), encoding="utf-8")
    return path


def discrete(folder: Path) -> Path:
    """Return the FMU with input and output declared discrete."""
    return described(
        compiled("letter2"),
        folder,
        ('"input" variability="continuous"', '"input" variability="discrete"'),
        ('"output" variability="continuous"', '"output" variability="discrete"'),
    )


def test_a_loop_of_reals_declared_discrete_is_said_and_can_be_declared_continuous(tmp_path: Path):
    """Declared continuous it is what it is of the FMU whose description says so: the same numbers."""
    said = orchestrator.run(written(tmp_path, discrete(tmp_path)))
    assert any("declared discrete" in note and "a.x -> b.u, b.x -> a.u" in note for note in said.wiring)
    cured = orchestrator.run(written(tmp_path, discrete(tmp_path), a=', continuous = ["x", "u"]'))
    right = orchestrator.run(written(tmp_path, compiled("letter2")))
    assert not any("discrete" in note for note in [*cured.wiring, *right.wiring])
    assert np.array_equal(cured.table["a.x"], right.table["a.x"])
    assert not np.allclose(said.table["a.x"], right.table["a.x"], rtol=0.0, atol=1e-3)  # iterated, it is another result


def test_signals_are_chosen_local_ones_too(tmp_path: Path):
    """rate is u - x."""
    run = orchestrator.run(written(tmp_path, compiled("letter2"), more=', record = ["a.rate", "a.x", "a.u"]'))
    assert [*run.table] == ["time", "a.rate", "a.x", "a.u"]
    assert np.array_equal(run.table["a.rate"], run.table["a.u"] - run.table["a.x"])


def test_a_signal_that_is_none_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"simulation\.record: a\.rat: no such signal; did you mean a\.rate\?"):
        orchestrator.run(written(tmp_path, compiled("letter2"), more=', record = ["a.rat"]'))


def test_without_a_numeric_output_a_run_ends_properly(tmp_path: Path):
    """With its pictures, and a word on what to do."""
    silent = described(
        compiled("letter2"),
        tmp_path,
        ('causality="output"', 'causality="local"'),
        ('<Outputs><Unknown index="2" dependencies=""/></Outputs>', ""),
    )
    run = orchestrator.run(written(tmp_path, silent, connections="[]", master="jacobi"), out=tmp_path / "out")
    assert run.manifest["complete"] and run.manifest["pictures"] is None and [*run.table] == ["time"]
    assert any("no FMU has a numeric output" in note for note in run.wiring)


def test_a_graph_can_start_late(tmp_path: Path):
    """The same equations two seconds later: x' = -x does not know the time."""
    path = written(tmp_path, compiled("letter2"), more=', start_time = 2.0, tolerances = { "a.x" = 1e-3 }')
    path.write_text(
        path.read_text().replace("stop_time = 2.0", "stop_time = 4.0").replace('"none"', '"finer"'), encoding="utf-8"
    )
    late, early = orchestrator.run(path), orchestrator.run(written(tmp_path, compiled("letter2")))
    assert late.time[0] == 2.0 and late.time[-1] == 4.0 and late.summary["simulated_s"] == 2.0
    assert np.allclose(late.table["a.x"], early.table["a.x"], rtol=0.0, atol=1e-12)
    assert late.estimated_error and all(np.isfinite([*late.estimated_error.values()]))


def test_a_landing_starts_at_zero():
    with pytest.raises(InputError, match=r"simulation\.start_time: a landing starts at 0 s"):
        orchestrator.load_scenario("landing_200m_point9", set={"simulation.start_time": 1.0})


def test_a_step_below_its_own_is_said(tmp_path: Path):
    own = described(
        compiled("letter2"), tmp_path, ("<ModelVariables>", '<DefaultExperiment stepSize="0.5"/><ModelVariables>')
    )
    run = orchestrator.run(written(tmp_path, own))
    assert any(
        "a: its steps of 0.1 s are below the step size of its default experiment, 0.5 s" in n for n in run.wiring
    )


def test_all_that_an_fmu_says_is_in_the_run_folder(tmp_path: Path):
    path = written(
        tmp_path, compiled("letter2"), connections="[]", a=f", parameters = {{ fault = {FORMATS}, fault_time = 1.05 }}"
    )
    path.write_text(path.read_text().replace(", parameters = { start = 0.0 }", ""), encoding="utf-8")
    out = tmp_path / "out"
    with contextlib.suppress(RunError):
        orchestrator.run(path, out=out, pictures=False)
    lines = (out / "fmu.log").read_text(encoding="utf-8").splitlines()
    assert (
        any(line.startswith("a: [error] tyre model failed") for line in lines) and "a: [ok] closing the file" in lines
    )
    assert read_run(out).messages == lines


# -- FMI 1.0 -------------------------------------------------------------------------------------------------


def lags(**parameters: float) -> Graph:
    """Return x' = y, y' = -x of two FMUs."""
    parts = {"x": Fmu(compiled("lag1"), "x"), "y": Fmu(compiled("lag1"), "y")}
    parts["x"].set_parameters({"start": 1.0} | parameters)
    parts["y"].set_parameters({"gain": -1.0})
    return Graph(parts, ["y.y -> x.u", "x.y -> y.u"])


@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel"])
def test_fmi_1_runs_with_explicit_masters_as_fmi_2_does(master: str):
    """The same equations in both, held inputs: the same numbers to the last bit."""
    with lags() as graph:
        old = simulate(graph, master, 0.0, STOP, H)
    parts = {"x": Fmu(compiled("lag2"), "x"), "y": Fmu(compiled("lag2"), "y")}
    parts["x"].set_parameters({"start": 1.0})
    parts["y"].set_parameters({"gain": -1.0})
    with Graph(parts, ["y.y -> x.u", "x.y -> y.u"]) as graph:
        new = simulate(graph, master, 0.0, STOP, H)
    assert np.array_equal(old.signal("x.y"), new.signal("x.y")) and old.signal("x.steps")[-1] == 20.0


def test_fmi_1_takes_booleans_and_says_its_faults():
    with lags(on=False) as graph:
        assert np.array_equal(simulate(graph, "jacobi", 0.0, STOP, H).signal("x.y"), np.ones(21))
    with lags(fault=3.0) as graph:
        log = simulate(graph, "jacobi", 0.0, STOP, H)
    assert "x, t = 0.6 s: the step of 0.1 s came back with error" in str(log.error)


def test_fmi_1_cannot_go_back():
    with lags() as graph, pytest.raises(ValueError, match="gauss_seidel"):
        simulate(graph, "iqn_ils", 0.0, STOP, H)
