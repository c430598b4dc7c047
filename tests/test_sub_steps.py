"""Multi-rate coupling: FMUs that make several steps in one of the master's, with every master.

Expected values: the FMUs are exact inside a step for what they are told of the other side; so sub-steps change nothing
where they are told all of it (`waveform`), or nothing but a held value, and make the rest better by their number squared.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import SubStepped
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, GraphError
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.runs.components import opened
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.fmus import MILD, compiled, described, fmu, needs_compiler, oscillator, oscillator_solution, started
from tests.scenarios import OSCILLATOR
from tests.systems import IMPLICIT, ITERATED, POINT, POSITIONS, faulty_oscillator, run

pytestmark = pytest.mark.portable

VARIES = 'canHandleVariableCommunicationStepSize="true"'


@pytest.mark.parametrize(("master", "options", "order"), POINT, ids=lambda v: str(v))
def test_order_is_kept(master: str, options: dict, order: int):
    errors = []
    for H in (0.02, 0.01):
        log = run(oscillator(**MILD, steps=(2, 3)), master, H, 2.0, POSITIONS, **options)
        assert log.error is None and log.unconverged == 0
        assert log.solves["a"] % 2 == 0 and log.solves["b"] % 3 == 0
        errors.append(np.max(np.abs(log.values - oscillator_solution(log.time, **MILD))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("master", IMPLICIT)
def test_waveform_exchange_is_the_same_however_many_steps(master: str):
    """Means and slopes put together are those of the whole: the same motion and work, to the iteration's tolerance."""
    options = {} if master == "semi_implicit" else {"tolerance": 1e-11}
    logs = [
        run(oscillator(**MILD, waveform=True, steps=steps), master, 0.05, 1.0, POSITIONS, **options)
        for steps in ((1, 1), (3, 4))
    ]
    assert logs[1].error is None and logs[1].unconverged == 0
    assert logs[1].values == pytest.approx(logs[0].values, abs=1e-10)
    assert logs[1].energy["a.force"] == pytest.approx(logs[0].energy["a.force"], abs=1e-9)


def test_held_inputs_stay_held():
    """Jacobi of order 0 gives no slopes: four steps with one value are one."""
    logs = [run(oscillator(**MILD, steps=steps), "jacobi", 0.01, 0.5, POSITIONS) for steps in ((1, 1), (4, 4))]
    assert logs[1].values == pytest.approx(logs[0].values, abs=1e-12)


def test_inputs_without_a_slope_get_one():
    """b follows a, whose motion it is told between both ends: held in n pieces of H/n, an error of C/n² beside the rest.

    From n = 1 to 2 and from 2 to 4 it changes by C (1 - 1/4) and by C (1/4 - 1/16), a quarter of it.
    """
    motions = []
    for n in (1, 2, 4):
        parts = {
            "a": fmu("link", "a", mass=10.0, ground_stiffness=10.0, initial_position=0.1),
            "b": fmu("link", "b", mass=1.0, stiffness=100.0, damping=1.0, steps=n),
        }
        pairs = [("a.position", "b.left.position"), ("a.velocity", "b.left.velocity")]
        graph = Graph(parts, [Connection(*pair) for pair in pairs])
        motions.append(run(graph, "gauss_seidel", 0.05, 2.0, ["b.position"], extrapolation=1).values[:, 0])
    first, second = np.max(np.abs(np.diff(motions, axis=0)), axis=1)
    assert first / second == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("master", ITERATED)
def test_step_control_with_sub_steps(master: str):
    options = {"local_tolerance": 1e-6, "tolerance": 1e-10}
    logs = [
        run(oscillator(**MILD, waveform=True, steps=steps), master, 0.1, 1.0, POSITIONS, **options)
        for steps in ((1, 1), (2, 3))
    ]
    assert logs[1].error is None
    assert [step.subdivisions for step in logs[1].steps] == [step.subdivisions for step in logs[0].steps]
    assert logs[1].values == pytest.approx(logs[0].values, abs=1e-9)


@pytest.mark.parametrize("master", ITERATED)
def test_sub_steps_in_place_of_sub_division(master: str):
    """An FMU that makes no step longer than 2.5 ms has four of them; nothing is discarded, nobody else steps finer."""
    graph = faulty_oscillator(fault=1, longest_step=2.6e-3)
    parts = {**graph.components, "c": fmu("odd", "c", fault=1, longest_step=2.6e-3, steps=4)}
    graph.components["c"].close()
    log = run(Graph(parts, graph.connections), master, 0.01, 0.1, POSITIONS)
    assert log.error is None
    assert all(step.subdivisions == 0 for step in log.steps)


def test_discrete_inputs_are_held_and_states_are_complete():
    """x' = u with u = 1 … 2 over the step: mean 1.5; back to the start, the same again, bit for bit."""
    odd = fmu("odd", "odd", steps=4)
    assert isinstance(odd, SubStepped) and odd.made_up == ["u_rate"]
    started(odd)
    inputs, outputs = odd.group(["u_rate", "held_in", "u"]), odd.group(["x", "count", "u_rate"])
    inputs.values[:] = 2.0, 7.0, 1.5
    inputs.set()
    state, seen = odd.save(), []
    for _ in range(2):
        odd.step(0.0, 0.5)
        outputs.get()
        seen.append(outputs.values.tolist())
        odd.restore(state)
    odd.release(state)
    assert seen[0] == seen[1] == [pytest.approx(0.75, rel=1e-14), 4.0, 2.0]
    assert odd.read("held_in") == 7.0
    odd.close()


def fixed(folder: Path, name: str, steps: int, *changes: tuple[str, str]) -> SubStepped:
    """A lag in C that cannot vary its step."""
    path = compiled("lag3")
    folder = folder / name
    folder.mkdir()
    return SubStepped(described(path, folder, (VARIES, ""), *changes), name, steps)


@needs_compiler
def test_a_step_that_cannot_vary_is_kept_where_others_are_halved(tmp_path: Path):
    """H = 10 ms in halves, because c makes no more than 5 ms; the lag makes four steps of 2.5 ms all the same."""
    parts = {"lag": fixed(tmp_path, "lag", 4), "c": fmu("odd", "c", fault=1, longest_step=5.1e-3)}
    graph = Graph(parts, [Connection("lag.y[1]", "c.u")])
    lengths = []
    step = parts["lag"].fmi.do_step
    parts["lag"].fmi.do_step = lambda t, h, none_before: lengths.append(h) or step(t, h, none_before)
    log = run(graph, "iqn_ils", 0.01, 0.02, ["lag.count"])
    assert log.error is None
    assert all(report.subdivisions == 1 for report in log.steps)
    assert log.values[:, 0].tolist() == [0.0, 4.0, 8.0]
    assert lengths == pytest.approx([2.5e-3] * len(lengths), rel=1e-12)


@needs_compiler
@pytest.mark.parametrize("steps", [1, 3])
def test_a_step_that_cannot_vary_is_not_halved(steps: int, tmp_path: Path):
    lag = (
        fixed(tmp_path, "lag", steps) if steps > 1 else Fmu(described(compiled("lag3"), tmp_path, (VARIES, "")), "lag")
    )
    graph = Graph({"lag": lag, "c": fmu("odd", "c", fault=1, fault_time=0.01, longest_step=5e-3)}, [])
    log = run(graph, "iqn_ils", 0.01, 0.04, ["lag.count"])
    assert log.error is not None and (log.error.component, log.error.status, len(log.time)) == ("lag", 3, 2)
    assert "would have to be halved (the step of 0.01 s came back with discard" in log.error.message
    assert "lag cannot vary its step" in log.error.message


@needs_compiler
def test_steps_that_cannot_vary_are_refused_where_they_must(tmp_path: Path):
    lag = fixed(tmp_path, "lag", 2)
    with pytest.raises(GraphError, match="local_tolerance varies the step, which lag cannot"):
        MASTERS["iqn_ils"](Graph({"lag": lag}, []), local_tolerance=1e-6)
    lag.close()


@needs_compiler
def test_a_fixed_internal_step_must_divide_the_communication_step(tmp_path: Path):
    """Internal step 2 ms: H = 10 ms whole or in five, not in two; H = 5 ms in none."""
    internal = (VARIES, f'{VARIES} fixedInternalStepSize="0.002"')
    path = described(compiled("lag3"), tmp_path, internal)
    for steps, H, good in ((1, 0.01, True), (5, 0.01, True), (2, 0.01, False), (1, 0.005, False)):
        graph = Graph({"lag": SubStepped(path, "lag", steps)}, [])
        master = MASTERS["jacobi"](graph)
        if good:
            assert simulate(graph, master, 0.0, 0.02, H).error is None
        else:
            with pytest.raises(ValueError, match=r"no multiple of its fixed internal step of 0\.002 s; change"):
                simulate(graph, master, 0.0, 0.02, H)
        graph.close()


def test_steps_in_a_scenario():
    """The oscillator with three steps of the right one: the same motion to the scenario's tolerance, three times its solves."""
    runs = []
    for steps in (1, 3):
        scenario = load(OSCILLATOR, ["simulation.stop_time=0.5", f"components.right.steps={steps}"])
        coupled = run_coupled(scenario)
        assert coupled.log.error is None
        runs.append(coupled)
    assert [run.log.solves["right"] // run.log.solves["left"] for run in runs] == [1, 3]
    motions = [run.table["right.position"] for run in runs]
    tolerance = runs[0].scenario.simulation.tolerances["right.position"]
    assert motions[1] == pytest.approx(motions[0], abs=tolerance * np.ptp(motions[0]))
    with pytest.raises(InputError, match=r"components\.right\.steps: 0 must be greater than or equal to 1"):
        load(OSCILLATOR, ["components.right.steps=0"])


@needs_compiler
def test_validation_finds_a_fixed_internal_step(tmp_path: Path):
    """Wrong input, before anything is run."""
    path = described(compiled("lag3"), tmp_path, (VARIES, f'{VARIES} fixedInternalStepSize="0.002"'))
    scenario = tmp_path / "lag.toml"
    times = "[simulation]\nstop_time = 0.02\nmacro_step = 0.01\n"
    scenario.write_text(f'title = "A lag"\n{times}[components.lag]\nfmu = "{path}"\nsteps = 2\n', encoding="utf-8")
    with pytest.raises(InputError, match="no multiple of its fixed internal step"), opened(load(scenario)):
        pass
    with opened(load(scenario, ["components.lag.steps=5"])) as graph:
        assert graph.components["lag"].steps == 5  # type: ignore[attr-defined]
