"""Landings with a controller: what a scenario may say, coupled against monolithic, energy, foreign controllers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.catalogue import library
from orchestrator.catalogue.modules import of_module
from orchestrator.coupling.errors import InputError
from orchestrator.landing import audit
from orchestrator.landing import build as landing
from orchestrator.landing.contract import best_contract, check_fmu, is_met
from orchestrator.landing.monolithic import solve
from orchestrator.landing.monolithic.linear import at_rest
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.landing.resolve import resolve
from orchestrator.report.page.curves import plots_of
from orchestrator.report.page.whatif import whatif_of
from orchestrator.report.signals import panels_for
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.systems import LandingSystem
from orchestrator.runs.whatif import leave
from orchestrator.scenario.read import load
from orchestrator.scenario.types import LandingScenario
from tests.scenarios import SCENARIOS, scenario

RIG, POINT9 = "rig_10m_controlled", "landing_200m_point9_setdown"
QUICK = {"landing__position": 3.0, "landing__height": 0.01, "controller__parameters__ramp_time": 0.4}
"""It touches at about 0.3 s, beside the middle, so that it rolls, and is down at 0.8 s."""
SAME_LAW = ("controller.thrust", "controller.torque.x")
WEIGHT = 38.0 * 9.8


def one(name: str = RIG, **values: object) -> LandingScenario:
    found = scenario(name, **{"stop": 1.0} | values)
    assert isinstance(found, LandingScenario)
    return found


def problems(*overrides: str, name: str = RIG) -> list[str]:
    with pytest.raises(InputError) as caught:
        resolve(load(SCENARIOS / f"{name}.toml", overrides))
    return caught.value.problems


# -- what a scenario may say -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ('controller.model="cable"', "cable is no controller"),
        ('controller.model="setdwn"', "no model 'setdwn'; did you mean setdown?"),
        ('controller.fmu="a.fmu"', "a.fmu"),
        ("controller.parameters.ramp_tim=1.0", "unknown key; did you mean ramp_time?"),
        ("controller.parameters.final_share=2.0", "must be at least 0 and at most 1"),
        ("robot.inputs.thrust=100.0", "robot.inputs.thrust: is what the controller gives"),
        ("robot.inputs.torque.x={time=[0,1],value=[0,1]}", "robot.inputs.torque.x: is what the controller gives"),
        ("controller.parameters.sample_time=0.0125", "0.005 s does not divide the controller's sample_time, 0.0125 s"),
        ("simulation.macro_step=0.04", "0.04 s does not divide the controller's sample_time, 0.02 s"),
    ],
)
def test_what_cannot_be_is_refused(override, said):
    assert any(said in problem for problem in problems(override)), problems(override)


def test_a_controller_knows_its_robot_unless_it_is_told_otherwise():
    of = resolve(one(robot__parameters__mass=55.0)).controller
    assert of is not None and of.settings["mass"] == 55.0 and of.settings["max_thrust"] == 820.0
    assert of.settings["inertia.xx"] == pytest.approx(5.42 * 55.0 / 38.0, rel=1e-3)
    wrong = resolve(one(robot__parameters__mass=55.0, controller__parameters__mass=38.0)).controller
    assert wrong is not None and wrong.settings["mass"] == 38.0


def test_without_the_section_there_is_no_controller():
    plain = resolve(one("rig_10m"))
    assert plain.controller is None and landing.problem(plain).controller is None


# -- coupled and monolithic --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def runs():
    """Coupled at two macro steps, and the reference."""
    coupled = {h: run_coupled(one(macro_step=h, **QUICK)) for h in (0.01, 0.005)}
    return coupled, solve(lambda: landing.problem(one(**QUICK)), coupled[0.005].table["time"])


def test_coupled_comes_to_monolithic(runs):
    """The same law: touch-down at the same instant, and an error of the exchange's order, 3 where touch falls inside a step."""
    coupled, reference = runs
    for name in ("robot.body.position.z", *SAME_LAW):
        exact = reference.signals[name]
        coarse, fine = (
            np.max(np.abs(run.table[name] - exact[:: round(h / 0.005)])) / np.ptp(exact) for h, run in coupled.items()
        )
        assert fine < coarse / 2.0**2.5, name
    assert (
        np.max(np.abs(coupled[0.005].table["robot.body.position.z"] - reference.signals["robot.body.position.z"]))
        < 1e-8
    )
    for run in coupled.values():
        touched = reference.signals["controller.touch_time"][-1]
        assert run.table["controller.touch_time"][-1] == pytest.approx(touched, rel=1e-12) and touched > 0.0
        assert set(run.table["controller.phase"]) == {0.0, 1.0, 2.0}


def test_books_balance_with_a_controller(runs):
    """The work of thrust and torque is among the terms, and is most of what the robot gives up in height."""
    coupled, reference = runs
    found = audit.of_monolithic({"time": reference.time, **reference.signals}, reference.estimated_error)
    assert found is not None and found.drift < 1e-6 * found.exchanged
    found = audit.of_coupled(coupled[0.005].table, [1e-4])
    assert found is not None and found.within
    assert abs(found.terms["robot.control_work"][-1]) > 0.1 * found.exchanged
    assert found.drift < 1e-4 * found.exchanged


def test_commands_stand_between_instants(runs):
    """Four macro steps an instant; what the robot does between them changes nothing."""
    coupled, _ = runs
    thrust = coupled[0.005].table["controller.thrust"]
    assert all(np.ptp(thrust[k : k + 4]) == 0.0 for k in range(0, thrust.size - 4, 4))
    assert np.ptp(thrust) > 0.5 * WEIGHT


@pytest.mark.parametrize("master", ["interface_jacobian", "gauss_seidel", "jacobi", "semi_implicit"])
def test_every_kind_of_master_sees_the_same_law(master):
    """On the way down nothing is coupled but the controller: its commands are those of the reference to round-off."""
    made = one(stop=0.1, master=master, landing__height=0.2)
    found = run_coupled(made)
    assert found.log.error is None
    reference = integrate(lambda: landing.problem(made), found.table["time"])
    for name in (*SAME_LAW, "robot.body.position.z"):
        assert np.max(np.abs(found.table[name] - reference.signals[name])) < 1e-9 * WEIGHT, name


def test_point_9_rolls_less_than_when_it_is_let_go():
    """3.8 degrees let go; with the rotors' last fifth of the thrust it is held."""
    times = np.linspace(0.0, 6.0, 301)
    let_go, set_down = (
        integrate(lambda name=name: landing.problem(one(name, stop=6.0)), times, 1e-6).signals["robot.roll"]
        for name in ("landing_200m_point9", POINT9)
    )
    assert np.degrees(np.max(np.abs(let_go))) > 3.0
    assert np.max(np.abs(set_down)) < 0.3 * np.max(np.abs(let_go))


def test_modes_are_those_of_the_robot_that_is_down():
    """As with the last share of the weight held by hand; the feedback is no part of them."""
    flown = at_rest(landing.problem(one(landing__height=0.0, controller__parameters__final_share=0.5)))
    held = at_rest(landing.problem(one("rig_10m", robot__inputs__thrust=0.5 * WEIGHT)))
    assert np.max(np.abs(flown.q - held.q)) < 1e-9


# -- foreign controllers -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def foreign() -> Path:
    return library.module_fmu("setdown")


def test_a_controller_may_be_any_fmu(foreign, runs):
    """Ours under a path: the same run to the bit, but nothing stands for it in the monolithic solver."""
    section = f'controller={{fmu="{foreign}",parameters={{descent_speed=0.1,ramp_time=0.4}}}}'
    start = ["landing.height=0.01", "landing.position=3.0"]
    bare = load(SCENARIOS / "rig_10m.toml", ["simulation.stop_time=0.5", *start, section])
    assert isinstance(bare, LandingScenario) and not landing.has_monolithic(resolve(bare))
    assert landing.problem(bare).controller is None
    ours, theirs = runs[0][0.005].table, run_coupled(bare).table
    for name in ("robot.body.position.z", *SAME_LAW):
        assert np.array_equal(theirs[name], ours[name][: theirs["time"].size])


def test_the_contract_knows_a_controller(foreign):
    kind, findings = check_fmu(foreign)
    assert kind == "controller" and is_met(findings)
    assert {f.verdict for f in findings if not f.what.startswith("co-")} <= {"ok"}
    for name in ("cable", "contact", "robot"):
        assert best_contract(of_module(name)) == name


# -- what people see ---------------------------------------------------------------------------------------------


def test_thrust_and_torque_are_shown(runs):
    table = runs[0][0.005].table
    panels = [panel.label for panel in panels_for(table)]
    plots = {plot.title: [signal.name for signal in plot.signals] for plot in plots_of(table, {})}
    assert {"Thrust", "Torque"} <= set(panels) & set(plots)
    assert plots["Thrust"] == ["controller.thrust"] and plots["Torque"] == ["controller.torque.x"]


def test_a_page_says_why_it_has_no_what_if(tmp_path):
    folder = tmp_path / "run"
    leave(RunDirectory(folder), LandingSystem(resolve(one())))
    found = whatif_of(folder, tmp_path).about
    assert found is not None and "a controller flies this landing" in found["reason"] and found["starts"] == []
    assert not (folder / "start.bin").exists()
