"""Power residual of the interfaces, error estimate of a run, step control.

Expected values: conservation of energy (test FMUs are exact inside a step), the matrix exponential, definitions.
"""

from __future__ import annotations

import signal
from functools import cache

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.exchange import EXCHANGES
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.stepping.step_control import SAFETY, StepControl
from orchestrator.landing.resolve import Landing, resolve
from orchestrator.runs import estimate
from orchestrator.runs.coupled import Coupled, run_coupled
from orchestrator.runs.estimate import estimate_error
from orchestrator.runs.summary import summary
from orchestrator.runs.systems import LandingSystem
from orchestrator.scenario.read import load
from orchestrator.scenario.types import LandingScenario, Scenario
from tests.fmus import fmu
from tests.scenarios import LANDING, OSCILLATOR, exact_oscillator
from tests.systems import ITERATED, run

pytestmark = pytest.mark.portable

RECORD = ["a.position", "a.velocity", "b.position", "b.velocity"]


def spring_between(master: str, H: float, **options) -> Log:
    """Two masses, 1 kg and 2 kg (the second on 100 N/m), and a linear spring between, nothing damped."""
    a = fmu("link", "a", mass=1.0, initial_position=0.1)
    b = fmu("link", "b", mass=2.0, ground_stiffness=100.0)
    s = fmu("spring", "s", stiffness=1e3, exponent=1.0, two_sided=1.0)
    pairs = []
    for side in "ab":
        pairs += [(f"{side}.{v}", f"s.{side}.{v}") for v in ("position", "position_mean")]
        pairs += [(f"s.{side}.{v}", f"{side}.{v}") for v in ("force", "force_rate")]
    return run(Graph({"a": a, "b": b, "s": s}, [Connection(*p) for p in pairs]), master, H, 0.5, RECORD, **options)


def energy(log: Log) -> np.ndarray:
    xa, va, xb, vb = log.values.T
    return 0.5 * va**2 + vb**2 + 50.0 * xb**2 + 500.0 * (xa - xb) ** 2


@pytest.mark.parametrize(("master", "H"), [("gauss_seidel", 0.005), ("gauss_seidel", 0.001), ("iqn_ils", 0.02)])
def test_energy_residual_is_the_energy_the_coupling_makes(master, H):
    """Masses take what is booked on them, the spring stores what it books itself: the rest is the sum's drift."""
    log = spring_between(master, H)
    made = energy(log) - energy(log)[0]
    residual = sum(log.energy_residual.values())
    assert list(log.energy_residual) == ["a.force", "b.force"]
    assert residual == pytest.approx(made, abs=1e-12)
    if master == "gauss_seidel":
        assert np.max(np.abs(made)) > 1e-4


def test_power_residual_is_reported_for_every_step():
    log = spring_between("gauss_seidel", 0.005)
    largest = np.max(np.abs(list(log.power_residual.values())), axis=0)
    assert [step.power_residual for step in log.steps] == pytest.approx(largest)
    assert np.max(largest) == pytest.approx(np.max(np.abs(np.diff(list(log.energy_residual.values())))) / 0.005)


@pytest.mark.parametrize("master", ITERATED)
def test_power_residual_of_a_converged_step_is_the_tolerance_s(master):
    """Residual relative to the largest load, 105 N, times tolerance, at speeds below 3.2 m/s; two sides."""
    log = spring_between(master, 0.01, tolerance=1e-9)
    assert max(step.power_residual for step in log.steps) < 2e-9 * 105.0 * 3.2


def test_rejected_sub_steps_leave_no_residual():
    log = spring_between("iqn_ils", 0.05, local_tolerance=1e-6, tolerance=1e-12)
    assert sum(step.subdivisions for step in log.steps) > 0
    assert sum(log.energy_residual.values()) == pytest.approx(energy(log) - energy(log)[0], abs=1e-9)


def test_not_booked_where_the_giver_is_not_told_the_motion():
    a, b = fmu("link", "a", mass=1.0), fmu("link", "b", mass=1.0, stiffness=10.0, initial_position=0.1)
    log = run(Graph({"a": a, "b": b}, [Connection("b.left.force", "a.force")]), "jacobi", 0.01, 0.1)
    assert log.energy_residual == {} and np.isnan(log.steps[-1].power_residual)


def controlled(master: str = "iqn_ils", **options) -> Log:
    return spring_between(master, 0.1, tolerance=1e-10, absolute=1e-6, **options)


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian"])
def test_adaptive_error_follows_the_tolerance(master):
    """Local errors are below the tolerance, but in the first step, whose range to measure by begins at zero; the global
    error goes down with the tolerance."""
    exact = controlled(master, local_tolerance=1e-9).values[:, [0, 2]]
    errors = []
    for tolerance in (1e-4, 1e-6):
        log = controlled(master, local_tolerance=tolerance)
        assert max(step.estimate for step in log.steps[1:]) <= tolerance
        errors.append(float(np.max(np.abs(log.values[:, [0, 2]] - exact))))
    assert errors[1] < 0.1 * errors[0] and errors[0] < 1e-2


def test_sub_steps_grow_again():
    """After a rejection the controller lengthens again: a smooth motion needs the same sub-steps all along."""
    log = controlled(local_tolerance=1e-6)
    halves = [step.iterations for step in log.steps]
    assert log.time == pytest.approx(np.linspace(0.0, 0.5, 6))
    assert max(halves[1:]) < 2.5 * min(halves[1:])
    assert sum(step.rejected for step in log.steps[1:]) <= 4


def test_controller_finds_the_length_that_the_error_allows():
    """From 1 ms the length wanted grows to what the error allows, where it settles without overshooting much."""
    control = StepControl.__new__(StepControl)
    control.tolerance, control.last = 1e-6, 1.0
    wanted, lengths = 1e-3, []
    for _ in range(20):  # local error of order five: 1e-6 at 8 ms, 5e-7 is aimed at
        wanted = control._controlled(wanted, 1e-3, 1e-6 * (1 / 8) ** 5)
        lengths.append(wanted)
    assert lengths[-1] == pytest.approx(8e-3 * SAFETY ** (1 / 5), rel=0.02)
    assert max(lengths) < 1.3 * lengths[-1]


CASES = [
    ("finer", "iqn_ils", 0.02),
    ("finer", "iqn_ils", 0.005),
    ("finer", "gauss_seidel", 0.002),
    ("finer", "jacobi", 0.005),
    ("coarser", "iqn_ils", 0.005),
    ("coarser", "gauss_seidel", 0.002),
]


@pytest.mark.parametrize(("kind", "master", "H"), CASES)
def test_estimate_of_the_oscillator_is_within_a_factor_three(kind, master, H):
    """Against the exponential of the 4 x 4 matrix; the order is the declared one, so the rule is nearly exact."""
    settings = [f"simulation.macro_step={H}", "simulation.stop_time=2.0", f"simulation.estimate={kind}"]
    coupled = run_coupled(load(OSCILLATOR, settings, master=master))
    estimate_error(coupled)
    exact = dict(zip(("left.position", "right.position"), exact_oscillator(coupled.table["time"]), strict=True))
    assert list(coupled.estimated_error) == list(exact)
    for name, values in exact.items():
        error = np.max(np.abs(coupled.table[name] - values))
        assert 1 / 3 < coupled.estimated_error[name] / error < 3
    written = summary(coupled)["estimated_error"]
    assert {name: parts["total"] for name, parts in written.items()} == coupled.estimated_error
    assert all(parts["coupling"] == parts["total"] for parts in written.values()), "no inner steps, no mesh"


def landing(*settings: str, stop: float = 0.055) -> LandingSystem:
    return resolved(load(LANDING, [f"simulation.stop_time={stop}", *settings]))


@cache
def flagship() -> Landing:
    scenario = load(LANDING)
    assert isinstance(scenario, LandingScenario)
    return resolve(scenario)


def resolved(scenario: Scenario) -> LandingSystem:
    """The landing of a scenario that starts as the flagship does."""
    assert isinstance(scenario, LandingScenario)
    return LandingSystem(flagship().changed(scenario))


@pytest.mark.parametrize(("kind", "ratio", "inner", "stop"), [("finer", 0.5, 1.0, 0.055), ("coarser", 2.0, 2.0, 0.05)])
def test_steps_and_tolerances_change_together(kind, ratio, inner, stop):
    """Eleven macro steps: one is left over where they are doubled. The robot's inner step is its table's default.

    A finer run keeps the inner steps, which are a part of their own; in a coarser one they are doubled as well.
    """
    system = landing(f"simulation.estimate={kind}", "master.local_tolerance=1e-6")
    again = estimate.second(system)
    assert isinstance(again, LandingSystem)
    other = again.scenario
    assert other.simulation.macro_step == 0.005 * ratio and other.simulation.stop_time == pytest.approx(stop)
    in_the_run = EXCHANGES["waveform"].inner_step(0.005)
    assert again.landing.cable.settings["integration_step"] == inner * in_the_run
    assert (
        again.landing.robot.settings["integration_step"] == other.robot.parameters["integration_step"] == 0.001 * inner
    )
    changes = {name: change if ratio > 1 else 1 / change for name, change in estimate.TOLERANCES.items()}
    before = {"tolerance": 3e-6, "local_tolerance": 1e-6}  # the master's own, and the scenario's
    assert other.master == {name: pytest.approx(before[name] * change) for name, change in changes.items()}
    assert "integration_step" not in system.scenario.robot.parameters


def test_an_inner_step_of_the_scenario_is_kept_then_halved():
    system = landing("cable.parameters.integration_step=0.002")
    again, inner = estimate.second(system), system.stepped(0.5)
    assert isinstance(again, LandingSystem) and again.landing.cable.settings["integration_step"] == 0.002
    assert inner.landing.cable.settings["integration_step"] == 0.001 and inner.scenario.simulation.macro_step == 0.005


@pytest.mark.parametrize(
    ("stop", "kind", "made"), [(0.01, "coarser", False), (0.02, "coarser", True), (0.005, "finer", True)]
)
def test_macro_steps_needed(stop, kind, made):
    system = landing(f"simulation.estimate={kind}", stop=stop)
    assert (estimate.second(system) is not None) == made


@pytest.mark.parametrize(
    ("kind", "master", "exchange", "expected"),
    [
        ("finer", "iqn_ils", "waveform", 8 / 7),
        ("finer", "iqn_ils", "point", 4 / 3),
        ("finer", "jacobi", "point", 2.0),
        ("coarser", "iqn_ils", "waveform", 1 / 7),
        ("coarser", "iqn_ils", "point", 1 / 3),
        ("coarser", "jacobi", "point", 1.0),
    ],
)
def test_factor_by_hand(kind, master, exchange, expected):
    """From d = e(H) - e(H/2), and d = e(2H) - e(H), with e ~ H^p and p = 3, 2, 1."""
    system = landing(f"simulation.estimate={kind}", f"simulation.master={master}", "master={}")
    assert estimate.factor(system.scenario, exchange) == pytest.approx(expected)


def finished() -> Coupled:
    return run_coupled(load(OSCILLATOR, ["simulation.stop_time=0.1"]))


def test_no_estimate_where_none_is_asked_for():
    coupled = run_coupled(load(OSCILLATOR, ["simulation.stop_time=0.1", "simulation.estimate=none"]))
    estimate_error(coupled)
    assert coupled.estimated_error == {} and coupled.estimate_failure == ""


def test_ctrl_c_in_the_second_run_leaves_the_first():
    coupled = finished()
    estimate_error(coupled, lambda _: lambda time: signal.raise_signal(signal.SIGINT) if time > 0.031 else None)
    assert coupled.estimate_failure == "coupling and macro step: interrupted at t = 0.035 s"
    assert coupled.log.error is None and np.isnan(list(coupled.estimated_error.values())).all()


def test_failure_of_the_second_run_is_said(monkeypatch):
    """An FMU that takes no step below 10 ms, like one of a fixed step of its own, discards the half."""
    coupled, step = finished(), Fmu.step

    def fixed(self, t: float, h: float) -> None:
        if h < 0.0099:
            raise FmuError(self.name, t, 2, "steps of 10 ms only")
        step(self, t, h)

    monkeypatch.setattr(Fmu, "step", fixed)
    estimate_error(coupled)
    assert "steps of 10 ms only" in coupled.estimate_failure
    assert list(coupled.estimated_error) == ["left.position", "right.position"]
    assert np.isnan(list(coupled.estimated_error.values())).all()


def test_unknown_estimate_names_those_there_are():
    with pytest.raises(InputError, match="'richardson' must be 'finer', 'coarser' or 'none'"):
        landing("simulation.estimate=richardson")


def test_inner_steps_are_spared_where_they_are_a_trifle():
    """From a fifth of the run, and from the whole of it: the same within a factor 3, and a trifle in both."""
    system = landing(stop=0.6)
    coupled, whole = run_coupled(system), run_coupled(system)
    estimate_error(coupled)
    whole_parts = estimate._scaled(
        whole.table, run_coupled(system.stepped(0.5)).table, whole.judged, estimate.OF_INNER_STEPS
    )
    for name in ("robot.body.position.z", "contact1.normal_force_max"):
        parts = coupled.error_parts[name]
        assert parts.inner_steps is not None and parts.inner_steps < estimate.TRIFLE * parts.total
        assert 1 / 3 < parts.inner_steps / whole_parts[name] < 3 or whole_parts[name] < 1e-3 * parts.total
