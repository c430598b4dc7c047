"""No wheel passes through the line unseen, and no wheel starts or goes where the contact law does not hold."""

import math

import numpy as np
import pytest

from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import InputError
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.landing.resolve import resolve
from orchestrator.runs.coupled import run_coupled
from tests.scenarios import scenario

HIGH = {"landing.height": 10.0}
TOUCH = math.sqrt(2.0 * 10.0 / 9.8)
"""s, free fall over 10 m."""


def drop(macro_step, stop, master=None, **sets):
    return scenario("drop_5cm", stop, master, macro_step, **sets)


def monolithic(one, step=0.005, tolerance=2e-9):
    times = np.arange(round(one.simulation.stop_time / step) + 1) * step
    return {"time": times} | integrate(lambda: landing.problem(one), times, tolerance).signals


@pytest.mark.parametrize(("macro_step", "stop", "sets"), [(0.1, 2.0, HIGH), (0.02, 2.0, HIGH), (1.0, 2.0, {})])
def test_an_implicit_master_divides_a_step_that_would_pass_through_the_line(macro_step, stop, sets):
    """A fall from 10 m moves by 1.4 m in 0.1 s, one from 5 cm by 5 m in 1 s; the groove is 34 mm deep. Both end where the
    monolithic run does, to 5 % of the height: the sub-steps end where they are short enough to see the line, not the impact."""
    one = drop(macro_step, stop, **sets)
    coupled, reference = run_coupled(one), monolithic(one, macro_step)
    assert coupled.log.error is None and not coupled.fallen
    assert sum(step.subdivisions for step in coupled.log.steps) > 5
    height = sets.get("landing.height", 0.05)
    rise = coupled.table["robot.body.position.z"][-1] - reference["robot.body.position.z"][-1]
    assert abs(rise) < 0.05 * max(height, 0.5)
    assert coupled.table["contact1.normal_force_max"].max() > 300.0


@pytest.mark.parametrize("master", ["gauss_seidel", "jacobi", "reduced_interface", "semi_implicit"])
def test_other_masters_end_with_the_reason(master):
    """They cannot divide a step: the run ends before the line is passed, and says how long a step may be."""
    coupled = run_coupled(drop(0.02, 2.0, master, **HIGH))
    error = str(coupled.log.error)
    assert "wheel and cable meet and move by 0.28 m" in error and "steps of at most 0.0022 s" in error
    assert abs(coupled.table["time"][-1] - TOUCH) < 2.0 * 0.02
    assert coupled.table["contact1.normal_force_max"].max() == 0.0


def test_a_step_that_cannot_be_divided_far_enough_ends_with_the_reason():
    """10 m at 1 s: six halvings leave 16 ms, in which it moves by 0.2 m."""
    coupled = run_coupled(drop(1.0, 2.0, **HIGH))
    assert "more than the groove is deep" in str(coupled.log.error)


def test_a_wheel_that_goes_through_the_cable_has_fallen_off_in_both_solvers():
    """Walls so soft (k = 1e5) that a fall of 1 m goes through them: the line passes the axle at the same time."""
    one = drop(0.005, 0.6, **{"landing.height": 1.0, "contact.parameters.stiffness": 1e5})
    coupled, reference = run_coupled(one), monolithic(one)
    assert coupled.fallen == ["contact1"]
    gone = [table["time"][np.argmax(table["contact1.status"] == 3)] for table in (coupled.table, reference)]
    assert gone[0] == gone[1] > 0.4
    for table in (coupled.table, reference):
        late = table["time"] > gone[0]
        assert late.any() and not table["contact1.normal_force_max"][late].any()
        assert np.all(table["contact1.status"][late] == 3)


def test_an_axle_that_turns_along_the_cable_in_mid_run_ends_it_with_the_reason():
    """Spun up at 6 rad/s it comes down at 48 degrees and turns on: beyond 50 the walls are less steep than the line."""
    spin = {"robot.parameters.initial.angular_velocity.z": 6.0, "landing.height": 0.1}
    one = drop(0.005, 0.3, **spin)
    coupled = run_coupled(one)
    assert "the axle lies along the cable" in str(coupled.log.error)
    assert 0.14 < coupled.table["time"][-1] < 0.2
    with pytest.raises(ModuleError, match="the axle lies along the cable"):
        monolithic(one)


@pytest.mark.parametrize(("name", "longest"), [("landing_200m_point9", 0.036), ("drop_5cm", 0.06), ("rig_10m", 0.06)])
def test_longest_contact_length_changes_nothing_beyond_what_touches(name, longest):
    """What touches is 67 mm long in the flagship and the drop, 72 mm in the rig, half of it on each side of the foot:
    limits of 36 mm, of 60 mm and of 5 m from the foot are the same, bit for bit."""
    key = "contact.parameters.max_contact_length"
    tables = [run_coupled(scenario(name, 1.0, **{key: x})).table for x in (longest, 5.0)]
    for signal in ("robot.body.position.z", "contact1.normal_force_max", "contact1.contact_length"):
        np.testing.assert_array_equal(tables[0][signal], tables[1][signal])
    assert 0.06 < tables[0]["contact1.contact_length"].max() < 0.075


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (
            {"robot.model": "hybrid_robot_2", "landing.position": 0.1},
            r"wheel\[1\] stands at y = -0.0\d* m, beyond the left",
        ),
        (
            {"robot.model": "linedrone", "landing.position": 199.8},
            r"wheel\[4\] stands at y = 200.\d* m, beyond the right",
        ),
        ({"robot.parameters.initial.yaw": math.radians(89.0)}, r"wheel\[1\] .*its axle lies along the cable; turn"),
        ({"robot.model": "linedrone", "robot.parameters.initial.yaw": 0.2}, r"wheel\[1\] stands beside the cable"),
        ({"robot.parameters.initial.pitch": math.radians(70.0)}, r"wheel\[1\] stands beside the cable"),
    ],
)
def test_a_wheel_without_a_place_is_refused(sets, message):
    """Place, cause, cure, for the wheel that it is, though the middle of the wheels lies well."""
    with pytest.raises(InputError, match=message):
        resolve(scenario(stop=0.1, **sets))


@pytest.mark.parametrize(
    ("model", "yaw"), [("fptlir", 0.1), ("fptlir", 0.7), ("hybrid_robot_2", 0.1), ("linedrone", 0.05)]
)
def test_no_wheel_starts_pressed_in(model, yaw):
    """A robot turned in yaw touches the walls of its grooves higher: at least one wheel touches, none is pressed."""
    one = scenario(stop=0.1, **{"robot.model": model, "robot.parameters.initial.yaw": yaw})
    signals = integrate(lambda: landing.problem(one), np.array([0.0, 1e-4])).signals
    depths = [values[0] for name, values in signals.items() if name.endswith(".penetration")]
    assert max(depths) == pytest.approx(0.0, abs=1e-6)  # the cable is curved; the law's line is straight
