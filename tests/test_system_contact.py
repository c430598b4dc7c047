"""The contact in whole runs: falling off, sticking and sliding on a slope, a driven wheel, the end of the line."""

import numpy as np
import pytest
from typer.testing import CliRunner

from fmus.module.variables import ModuleError
from orchestrator.cli import commands as cli
from orchestrator.landing import audit
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.scenarios import LANDING, scenario

pytestmark = pytest.mark.portable

FREE = {"robot.parameters.wheel[1].braked": "false"}
PUSH = {"robot.parameters.initial.velocity.x": 2.0, "landing.height": 0.02}


def monolithic(one, tolerance=1e-9):
    times = np.arange(round(one.simulation.stop_time / 0.005) + 1) * 0.005
    signals = integrate(lambda: landing.problem(one), times, tolerance).signals
    return {"time": times} | signals


def test_falling_off_is_seen_and_the_books_still_balance():
    """Pushed sideways at 2 m/s: it rides up a wall of the groove, leaves it, and falls freely from then on."""
    one = scenario(stop=0.6, **PUSH)
    coupled, reference = run_coupled(one), monolithic(one)
    assert coupled.fallen == ["contact1"]
    for table in (coupled.table, reference):
        gone = table["contact1.status"] == 3
        first = int(np.argmax(gone))
        assert 0.0 < table["time"][first] < 0.3
        assert np.all(gone[first:])
        assert np.all(table["contact1.normal_force"][first:] == 0.0)
        fall = np.diff(table["robot.gravitational_energy"][first:] + table["robot.kinetic_energy"][first:])
        # the coupled run's iteration stops at 1e-8 of the largest force it has tried: 1e-4 N stay on the wheel
        assert np.max(np.abs(fall)) < 1e-8 * np.max(table["robot.kinetic_energy"])
    assert coupled.energy.drift < 1e-5 * coupled.energy.exchanged
    assert audit.of_monolithic(reference, {}).drift < 1e-6 * audit.of_monolithic(reference, {}).exchanged


def test_falling_off_ends_in_a_clear_verdict(tmp_path):
    sets = [part for key, value in PUSH.items() for part in ("--set", f"{key}={value}")]
    arguments = ["run", str(LANDING), "--stop", "0.4", "--quiet", *sets]
    result = CliRunner().invoke(cli.app, [*arguments, "--out", str(tmp_path / "fallen")])
    assert result.exit_code == 1
    assert "the robot has fallen off" in result.output + (result.stderr if result.stderr_bytes else "")


@pytest.mark.parametrize(("factor", "slides"), [(0.85, True), (1.15, False)])
@pytest.mark.parametrize("kind", ["coupled", "monolithic"])
def test_slides_where_the_wedge_effect_says(kind, factor, slides):
    """The rig inclined by 5 degrees: the walls at half the groove angle raise the friction to μ' = μ/sin(θ/2), so that
    it slides when μ < tan 5° sin 50° = 0.0670. It comes down sliding; below the limit it goes on, above it comes to
    rest: from some cm/s in less than 2 s at the deceleration 0.15 g sin 5°."""
    mu = factor * np.tan(np.radians(5.0)) * np.sin(np.radians(50.0))
    one = scenario("rig_10m_inclined", 5.0, **{"contact.parameters.friction_coefficient": mu})
    table = run_coupled(one).table if kind == "coupled" else monolithic(one)
    late = table["contact1.cable.s"][table["time"] >= 4.0]
    if slides:
        assert late[-1] - late[0] > 0.03
    else:
        assert np.ptp(late) < 5e-3  # the braked wheel rolls as the body swings: 5 cm times 0.1 rad


def test_a_driven_wheel_travels_and_both_solvers_agree():
    """2 N m on a free wheel in the middle of the line: the traction accelerates the robot, and the wheel rolls.

    The wheel passes from element to element, which are 4 cm and more long here.
    """
    fine = {"n_elements": 30, "grading": 30.0, "grading_position": 5.0}
    mesh = {f"cable.parameters.{name}": value for name, value in fine.items()}
    one = scenario("rig_10m", 1.0, **FREE, **mesh, **{"robot.inputs.wheel[1].drive_torque": 2.0})
    coupled, reference = run_coupled(one), monolithic(one)
    nodes = landing.problem(one).cable.model.s
    s = reference["contact1.cable.s"]
    assert np.sum((nodes > min(s)) & (nodes < max(s))) >= 5
    assert abs(s[-1] - s[0]) > 0.3
    table, way = coupled.table, s[-1] - s[0]
    # 6e-6 where the contact knows the cable's curvature, 1e-4 without it at any macro step
    assert np.max(np.abs(table["contact1.cable.s"] - s)) < 2e-5 * abs(way)
    assert table["robot.body.position.y"] == pytest.approx(reference["robot.body.position.y"], abs=2e-5 * abs(way))
    assert coupled.energy.drift < 1e-5 * coupled.energy.exchanged
    late = reference["time"] >= 0.3  # it comes down spinning and slides at first
    distance = [reference[f"cable.port[1].position.{a}"] - reference[f"robot.wheel[1].position.{a}"] for a in "xyz"]
    surface = np.linalg.norm(distance, axis=0) * reference["robot.wheel[1].angular_velocity.x"]
    rolled = np.trapezoid(surface[late], reference["time"][late])
    assert s[-1] - s[late][0] == pytest.approx(-rolled, rel=0.02)  # it slides where it nearly lifts off
    books = audit.of_monolithic(reference, {})
    assert books.drift < 1e-6 * books.exchanged


def test_lands_near_a_support():
    """20 cm from the support the line is stiff: coupled and monolithic still agree."""
    one = scenario(stop=0.3, **{"landing.position": 0.2})
    table, reference = run_coupled(one).table, monolithic(one)
    scale = np.ptp(reference["robot.body.position.z"])
    assert 1e-4 < scale < 0.1
    assert np.max(np.abs(table["robot.body.position.z"] - reference["robot.body.position.z"])) < 1e-3 * scale


def test_running_past_the_support_is_a_clear_error():
    """Driven towards the end of the rig, 10 cm away."""
    drive = {"robot.inputs.wheel[1].drive_torque": -4.0, "landing.position": 9.9}
    one = scenario("rig_10m", 3.0, **FREE, **drive)
    with pytest.raises(ModuleError, match="past a support"):
        monolithic(one)
    coupled = run_coupled(one)
    assert coupled.log.error is not None
    assert "past a support" in str(coupled.log.error)
    assert coupled.table["contact1.cable.s"][-1] > 9.8


def test_point_tends_to_the_same_motion_as_waveform():
    """The exchanges differ in what happens inside a step alone: halving the step of `point` (order 2, less at touch) must
    bring its roll nearer to that of `waveform`, whose own error at 2.5 ms is a hundredth."""
    stop, step = 0.5, 0.0025
    sets = [f"simulation.stop_time={stop}", "simulation.master=iqn_ils"]
    expected = run_coupled(load(LANDING, [*sets, f"simulation.macro_step={step}"])).table["robot.roll"]
    errors = []
    for parts in (2, 4):
        one = load(LANDING, [*sets, f"simulation.macro_step={step / parts}", "simulation.exchange=point"])
        errors.append(np.max(np.abs(run_coupled(one).table["robot.roll"][::parts] - expected)))
    assert errors[1] < 0.5 * errors[0]
