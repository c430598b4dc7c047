"""Inputs over time in scenarios: what they may say, and landings in which the thrust changes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from orchestrator.cli.commands import app
from orchestrator.coupling.errors import InputError
from orchestrator.landing import audit
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic import solve
from orchestrator.landing.monolithic.linear import at_rest
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.over_time import OverTime, held
from orchestrator.scenario.read import load
from orchestrator.scenario.types import GraphScenario, LandingScenario
from tests.fmus import build
from tests.scenarios import LANDING, OSCILLATOR, scenario

WEIGHT = 38.0 * 9.8
THRUST = "robot.inputs.thrust"


def child(folder: Path, text: str, base: str = LANDING.stem, name: str = "a.toml") -> Path:
    path = folder / name
    path.write_text(f'extends = "{base}"\n{text}\n', encoding="utf-8")
    return path


def thrust(path: Path, *overrides: str) -> OverTime:
    one = load(path, overrides)
    assert isinstance(one, LandingScenario)
    return one.robot.inputs["thrust"]


def problems(path: Path, *overrides: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return caught.value.problems


# -- what a scenario may say -------------------------------------------------------------------------------------


def test_a_table_with_unit_and_source(tmp_path):
    text = '[robot.inputs.thrust]\ntime = [0, 1]\nvalue = [0.3724, 0]\nunit = "kN"\nsource = "planned"'
    one = load(child(tmp_path, text))
    assert one.robot.inputs["thrust"] == OverTime(time=[0.0, 1.0], value=[372.4, 0.0])
    provenance = one.provenance[THRUST]
    assert (provenance.source, provenance.written) == ("planned", "2 values in kN")
    assert held(one.robot.inputs) == {}
    copy = one.changed(macro_step=0.01)
    assert copy.robot.inputs == one.robot.inputs
    assert json.loads(json.dumps(one.model_dump()))["robot"]["inputs"]["thrust"]["value"] == [372.4, 0.0]


def test_a_table_on_the_command_line():
    found = thrust(LANDING, f"{THRUST}={{time=[0,1],value=[372.4,0]}}")
    assert found == OverTime(time=[0.0, 1.0], value=[372.4, 0.0])
    steps = thrust(LANDING, f'{THRUST}={{time=[0,1],value=[372.4,0],interpolation="step"}}')
    assert steps.course().before(1.0) == 372.4


def test_a_column_of_a_file_relative_to_the_scenario(tmp_path):
    (tmp_path / "in").mkdir()
    csv = tmp_path / "in" / "thrust.csv"
    csv.write_text('"time","thrust","F"\n0,372.4,1\n1,0,2\n1,5,3\n', encoding="utf-8")
    one = load(child(tmp_path, 'robot.inputs.thrust = { file = "in/thrust.csv", source = "measured" }'))
    assert one.robot.inputs["thrust"] == OverTime(time=[0.0, 1.0, 1.0], value=[372.4, 0.0, 5.0])
    provenance = one.provenance[THRUST]
    assert provenance.sha256 == hashlib.sha256(csv.read_bytes()).hexdigest()
    assert provenance.source == "measured" and str(csv) in provenance.written
    other = child(tmp_path, 'robot.inputs.torque.x = { file = "in/thrust.csv", column = "F", unit = "kN.m" }')
    assert load(other).robot.inputs["torque.x"].value == [1000.0, 2000.0, 3000.0]


def test_a_table_is_replaced_whole(tmp_path):
    child(tmp_path, "robot.inputs.thrust = { time = [0, 1], value = [1, 2] }")
    assert thrust(child(tmp_path, "robot.inputs.thrust = 5.0", "a.toml", "b.toml")) == 5.0
    again = child(tmp_path, 'robot.inputs.thrust = { value = [7], time = [0], unit = "kN" }', "b.toml", "c.toml")
    assert thrust(again).value == [7000.0]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("{time=[0,1],value=[1]}", "2 times and 1 values; give one value for each time"),
        ("{time=[],value=[]}", "the table is empty"),
        ("{time=[0,2,1],value=[1,2,3]}", "time[3] = 1 s is before time[2] = 2 s; put the entries in order"),
        ("{time=[0,1],value=[1,nan]}", "value[2]: nan must be a finite number"),
        ("{time=[0,inf],value=[1,1]}", "time[2]: inf must be a finite number"),
        ('{time=[0,1],value=[1,"a"]}', "value[2]: 'a' must be a number, true or false"),
        ("{time=[0,1],valeu=[1,2]}", "valeu: unknown key; did you mean value?"),
        ("{time=[0,1]}", 'give time = […] and value = […], or file = "FILE.csv"'),
        ('{time=[0,1],value=[1,2],file="a.csv"}', 'give time = […] and value = […], or file = "FILE.csv"'),
        ('{time=[0],value=[1],column="a"}', "column is one of a file"),
        ('{time=[0],value=[1],interpolation="cubic"}', "interpolation: 'cubic' must be 'linear' or 'step'"),
        ('{time=[0],value=[1],unit="kg"}', "kg"),
        ('{time=[0],value=[1],source="assumed"}', "what is assumed needs its reason"),
        ('{file="none.csv"}', "none.csv: cannot be read (No such file or directory); check the path"),
    ],
)
def test_wrong_tables_are_refused(value, said):
    found = problems(LANDING, f"{THRUST}={value}")
    assert found[0].startswith(f"--set: {THRUST}"), found
    assert any(said in problem for problem in found), found


def test_wrong_files_and_places_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text("time,thrusts\n0,1\n", encoding="utf-8")
    (found,) = problems(child(tmp_path, 'robot.inputs.thrust = { file = "a.csv" }'))
    assert "a.csv has no column thrust; did you mean thrusts?" in found
    table = "{time=[0],value=[1]}"
    assert "did you mean thrust?" in problems(LANDING, f"robot.inputs.trust={table}")[0]
    assert "is no input; its causality is output" in problems(LANDING, f"robot.inputs.roll={table}")[0]
    assert any(
        "only inputs and tunable parameters follow a table" in p
        for p in problems(LANDING, f"robot.parameters.mass={table}")
    )


# -- landings ----------------------------------------------------------------------------------------------------

KINKED = "{time=[0,0.1234,0.1234,0.3017,0.5],value=[300,0,200,-50,100]}"
"""Kinks and a jump, none at a communication point."""


@pytest.fixture(scope="module")
def kinked():
    one = scenario(stop=0.5, **{THRUST: KINKED, "robot.inputs.torque.x": "{time=[0,0.5],value=[3,-3]}"})
    coupled = run_coupled(one)
    return coupled, solve(lambda: landing.problem(one), coupled.table["time"])


def test_coupled_is_monolithic(kinked):
    """The thrust of a step is its projection on linear functions: what that leaves of a jump J at the end of a step h is of
    the order J h³/m times the frequency of what is excited, 1e-5 of the range and less."""
    coupled, reference = kinked
    for name in ("robot.body.position.z", "robot.roll"):
        values = reference.signals[name]
        assert np.max(np.abs(coupled.table[name] - values)) < 2e-5 * np.ptp(values)


def test_books_balance_with_a_thrust_over_time(kinked):
    """As tight as with a constant one, the work of the thrust among the terms (tests/test_system_energy.py)."""
    coupled, reference = kinked
    books = audit.of_monolithic({"time": reference.time} | reference.signals, reference.estimated_error)
    assert books.within and coupled.energy.within
    assert coupled.energy.drift < 5e-6 * coupled.energy.exchanged
    work = coupled.table["robot.control_work"][-1]
    assert abs(work) > 1.0
    assert work == pytest.approx(reference.signals["robot.control_work"][-1], rel=1e-3)


def test_inputs_over_time_are_among_the_signals(kinked):
    """The value of the table at each communication point, not the mean that the robot was given; one that is held is none."""
    coupled, reference = kinked
    time = coupled.table["time"]
    for name in ("thrust", "torque.x"):
        course = coupled.scenario.robot.inputs[name].course()
        expected = [course.reached(t) for t in time]
        for table in (coupled.table, reference.signals):
            np.testing.assert_array_equal(table[f"robot.{name}"], expected)
    after = np.searchsorted(time, 0.1234)
    at = time[after]
    assert coupled.table["robot.thrust"][after] == pytest.approx(
        200.0 - 250.0 * (at - 0.1234) / (0.3017 - 0.1234), rel=1e-12
    )
    assert "robot.torque.y" not in coupled.table and "robot.torque.y" not in reference.signals
    assert coupled.log.units["robot.thrust"] == "N" and coupled.log.units["robot.torque.x"] == "N.m"
    assert reference.estimated_error["robot.thrust"] == 0.0


def test_monolithic_steps_end_at_the_kinks():
    """So the method keeps its order: 16 times the tolerance doubles the steps, and the error is 8 times as large."""
    one, times = scenario(stop=0.4, **{THRUST: KINKED}), np.linspace(0.0, 0.4, 5)
    runs = [
        integrate(lambda: landing.problem(one), times, tol).signals["robot.body.position.z"]
        for tol in (1e-11, 1.6e-8, 2.56e-7)
    ]
    errors = [np.max(np.abs(run - runs[0])) for run in runs[1:]]
    assert np.log2(errors[1] / errors[0]) == pytest.approx(3.0, abs=0.2)
    assert errors[0] < 1e-8


def test_a_constant_table_is_a_constant_to_the_last_bit():
    tables = [
        run_coupled(scenario(stop=0.1, **{THRUST: value})).table for value in (150.0, "{time=[0,0.05],value=[150,150]}")
    ]
    for name, values in tables[0].items():
        np.testing.assert_array_equal(values, tables[1][name], err_msg=name)


def set_down(lasting: float, after: float = 1.0):
    """A robot that is held for 0.2 s, then set down within `lasting` (s)."""
    end = 0.2 + lasting
    steps = f'{{time=[0,0.2],value=[{WEIGHT},0],interpolation="step"}}'
    table = f"{{time=[0,0.2,{end}],value=[{WEIGHT},{WEIGHT},0]}}" if lasting else steps
    return run_coupled(scenario("rig_10m_setdown", end + after, **{THRUST: table})).table


@pytest.mark.parametrize(("lasting", "said"), [(5.0, 1.03), (2.0, 1.2), (0.5, 1.4), (0.0, 2.8)])
def test_set_down_slowly_or_let_go(lasting, said):
    """A thrust equal to the weight holds it exactly. The peaks are those of docs/howto/inputs_over_time.md, to the digit that
    is written there; let go, at least twice the weight, as anything that falls on a spring from rest at its length."""
    table = set_down(lasting)
    still = table["time"] < 0.2
    assert np.ptp(table["robot.body.position.z"][still]) < 1e-12
    assert np.all(table["contact1.normal_force"][still] < 1e-6)
    peak = np.max(table["contact1.radial_force"]) / WEIGHT
    assert peak == pytest.approx(said, abs=0.005 if lasting == 5.0 else 0.05)
    assert peak > (1.0 if lasting else 2.0)


def test_rest_and_modes_are_those_with_what_stays_of_the_thrust():
    """Held and set down: the robot hangs on the line with its whole weight, as if there had been no thrust."""
    ours, theirs = (at_rest(landing.problem(scenario(name))) for name in ("rig_10m_setdown", "rig_10m"))
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-9)
    half = at_rest(landing.problem(scenario("rig_10m_setdown", **{THRUST: "{time=[0,1],value=[0,186.2]}"})))
    middle = ours.q.size // 12 * 6 + 2
    assert half.q[middle] > ours.q[middle] + 1e-3


def test_a_component_that_has_no_input_for_the_slope_is_named():
    """A plant from elsewhere: `flow` has none, `heat` has one by its unit."""
    one = GraphScenario.model_validate(
        {
            "title": "plant",
            "simulation": {"stop_time": 0.2, "macro_step": 0.1, "master": "jacobi"},
            "components": {
                "p": {
                    "fmu": str(build("plant")),
                    "inputs": {name: {"time": [0.0, 1.0], "value": [0.0, 2.0]} for name in ("flow", "heat")},
                }
            },
        }
    )
    notes = run_coupled(one).notes
    assert "p: flow given as the mean over each macro step, without slope: the FMU has no input flow_rate" in notes
    assert not any("heat given" in note for note in notes)


@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_robot_that_is_held_is_within(tmp_path, command):
    """It does not move at all: its place has the error of the mesh, in proportion to the sag, and its energy round-off."""
    found = CliRunner().invoke(app, [command, "rig_10m_setdown", "--stop", "0.1", "--out", str(tmp_path / "held")])
    assert found.exit_code == 0, found.output
    assert "the energy drifts" not in found.output
    assert "MISSED" not in found.output


# -- general graphs ----------------------------------------------------------------------------------------------


def test_a_component_of_a_graph_follows_a_table():
    """The oscillator's left mass is fed by its neighbour; the right one's force is free."""
    one = load(
        OSCILLATOR, ["components.right.inputs.force={time=[0,0.777,2],value=[0,30,-10]}", "simulation.stop_time=2.0"]
    )
    table = run_coupled(one).table
    course = one.components["right"].inputs["force"].course()
    k, d, kc, dc = 10.0, 0.1, 100.0, 1.0

    def rate(t, y):
        x, v = y[:2], y[2:]
        pull = kc * (x[1] - x[0]) + dc * (v[1] - v[0])
        return [*v, pull - k * x[0] - d * v[0], course.after(t) - pull - k * x[1] - d * v[1]]

    y, t = np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    for end in (0.777, 2.0):
        y, t = solve_ivp(rate, (t, end), y, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1], end
    assert table["right.position"][-1] == pytest.approx(y[1], abs=1e-5)
    np.testing.assert_array_equal(table["right.force"], [course.reached(t) for t in table["time"]])
    assert any("fed by" in p for p in _refused("components.left.inputs.force={time=[0],value=[1]}"))


def _refused(override: str) -> list[str]:
    with pytest.raises((InputError, ValueError)) as caught:
        run_coupled(load(OSCILLATOR, [override]))
    return [str(caught.value)]
