"""Workspace and limits: formulas against geometry, the least margin of made-up signals, and what runs say of themselves."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from fmus.kernels.rotations import from_euler, rotate
from orchestrator.catalogue.library import robot_fmu
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.cli.printing import print_comparison
from orchestrator.coupling.errors import InputError
from orchestrator.landing import workspace
from orchestrator.landing.limits import landing_only, limits_of
from orchestrator.landing.resolve import resolve
from orchestrator.landing.safety import UNITS, Limit, Limits, Safety, judge, series
from orchestrator.landing.workspace import NoRoom
from orchestrator.report.limits import limits as draw_limits
from orchestrator.report.page import report
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.systems import LandingSystem
from orchestrator.scenario.read import load
from tests.scenarios import LANDING, OSCILLATOR

pytestmark = pytest.mark.usefixtures("coarse_pictures")
TIME = np.linspace(0.0, 10.0, 1001)
ROBOT = 'title = "A robot"\nextends = "fptlir"\n'


def swing(size: float, at: float) -> np.ndarray:
    """A bump of `size` at the time `at` (s), where its top is, on a communication point."""
    return size * np.exp(-((TIME - at) ** 2))


def table(**changes: np.ndarray) -> dict[str, np.ndarray]:
    """The signals of a landing of two wheels on a line that slopes by 0.1 rad under the first; it touches at 1 s."""
    zero, closed = np.zeros(1001), 1.0 * (TIME >= 1.0)
    found = {
        "time": TIME,
        "robot.body.position.z": 5.0 + zero,
        "robot.roll": zero,
        "robot.pitch": zero,
        "robot.yaw": zero,
    }
    for k, slope in ((1, 0.1), (2, 0.0)):
        tangent = (0.0, math.cos(slope), math.sin(slope))
        found |= {f"cable.port[{k}].tangent.{axis}": t + zero for axis, t in zip("xyz", tangent, strict=True)}
        found |= {
            f"contact{k}.status": closed,
            f"contact{k}.slip_velocity": zero,
            f"contact{k}.normal_force": 100.0 * closed,
        }
    return found | {f"cable.tension_{place}": 2e4 + zero for place in ("left", "mid", "right")} | changes


def held(errors: dict[str, float] | None = None, fault: str | None = None, **changes: np.ndarray) -> Safety:
    """Those signals against made-up limits."""
    values = {"roll": 0.5, "yaw": 0.3, "pitch": 1.0, "z": 1.25, "slip": 0.05, "airborne": 0.2, "tension": 0.4}
    references = {"z": 5.0, "tension": 1e5}
    known = {n: Limit(n, x, UNITS[n], "made up", None, references.get(n)) for n, x in values.items()}
    known["wheel_force"] = Limit("wheel_force", 500.0, "N", "made up")
    return judge(Limits(known, {}), table(**changes), errors=errors, fault=fault)


# -- formulas -------------------------------------------------------------------------------------------------


def test_table_2_by_its_own_formulas():
    """What Table 2 prints, where its formulas give it; roll by the slope of the text and yaw are off by a few digits."""
    rows = workspace.table_2()
    assert [row.what for row in rows] == ["roll"] * 4 + ["pitch", "yaw", "z"]
    assert [row.agrees for row in rows] == [False, False, True, True, True, False, True]
    assert rows[0].ours == pytest.approx((-19.63, 9.43), abs=0.005) and rows[0].printed == (-19.9, 9.1)
    assert rows[2].ours == pytest.approx((-19.93, 9.13), abs=0.005) and rows[3].printed == (-9.1, 19.9)
    assert rows[4].ours == pytest.approx((-62.99, 62.99), abs=0.005)
    assert rows[5].ours == pytest.approx((-16.348, 16.348), abs=0.0005) and rows[5].printed == (-16.34, 16.34)
    assert rows[6].ours == pytest.approx((0.0, 1.25))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_the_limit_of_roll_the_rim_of_the_rotor_plane_meets_the_line(side: float):
    """The line above the plane (the robot hangs) or below it (it stands): turned about the point under the wheel."""
    arm, width = 0.162, 1.25
    q = np.zeros(4)
    from_euler(workspace.roll(arm, width).value, 0.0, 0.0, q)
    rims = [rotate(q, 0.0, 0.5 * y * width, -side * arm)[2] for y in (-1.0, 1.0)]
    assert min(abs(height) for height in rims) == pytest.approx(0.0, abs=1e-15)


def test_the_limit_of_yaw_before_it_is_simplified_solves_its_equation():
    psi = workspace.yaw_before_simplifying(0.08, 0.018, 0.15)
    assert math.tan(psi) == pytest.approx((0.08 - 0.018 / math.cos(psi)) / 0.15, rel=1e-12)
    assert psi > workspace.yaw(0.08, 0.018, 0.15).value  # the simplified one is on the safe side


def test_at_the_limit_of_pitch_the_thrust_carries_the_weight():
    tilt = workspace.pitch(38.0, 9.8, 820.0).value
    assert 820.0 * math.cos(tilt) == pytest.approx(38.0 * 9.8, rel=1e-14)
    with pytest.raises(NoRoom, match="does not carry its weight of 980 N"):
        workspace.pitch(100.0, 9.8, 820.0)


def test_slope_and_heading_turn_as_roll_and_yaw_do():
    """A robot that lies along the line has its roll and yaw."""
    q = np.zeros(4)
    from_euler(0.2, 0.0, 0.0, q)
    assert workspace.slope(np.array([rotate(q, 0.0, 3.0, 0.0)])) == pytest.approx(0.2)
    from_euler(0.0, 0.0, 0.2, q)
    assert workspace.heading(np.array([rotate(q, 0.0, 3.0, 0.0)])) == pytest.approx(0.2)


def test_formulas_show_their_numbers():
    assert workspace.z(3.45, 1.2, 1.0).filled == "3.45 m - 1.2 m - 1 m"
    assert workspace.yaw(0.08, 0.018, 0.15).filled == "arctan((0.08 m - 2 · 0.018 m) / 0.15 m)"
    with pytest.raises(NoRoom, match="no wider than two cables"):
        workspace.yaw(0.03, 0.018, 0.15)


# -- the least margin -----------------------------------------------------------------------------------------

OFF = np.where((TIME > 4.0) & (TIME < 4.5), 0.0, 1.0 * (TIME >= 1.0))
EXCEEDED = {
    "roll": ({"robot.roll": swing(-0.45, 3.0)}, -0.55, 3.0, 1),
    "yaw": ({"robot.yaw": swing(0.4, 5.0)}, 0.4, 5.0, 1),
    "pitch": ({"robot.pitch": swing(-1.2, 2.0)}, -1.2, 2.0, None),
    "z": ({"robot.body.position.z": 5.0 - swing(1.5, 6.0)}, 1.5, 6.0, None),
    "slip": ({"contact2.status": 2.0 * (TIME >= 1.0), "contact2.slip_velocity": np.full(1001, 0.01)}, 0.09005, 10.0, 2),
    "airborne": ({"contact2.status": OFF}, 0.49, 4.5, 2),
    "tension": ({"cable.tension_right": 2e4 + swing(3e4, 7.0)}, 0.5, 7.0, None),
    "wheel_force": ({"contact2.normal_force_max": swing(900.0, 8.0)}, 900.0, 8.0, 2),
}  # fmt: skip


@pytest.mark.parametrize("name", EXCEEDED)
def test_the_worst_of_each_limit_with_its_time_and_wheel(name: str):
    changes, worst, time, wheel = EXCEEDED[name]
    safety = held(**changes)
    found = safety.limits[name]
    assert (found.worst, found.time, found.wheel) == (pytest.approx(worst, rel=1e-9), pytest.approx(time), wheel)
    assert found.margin == pytest.approx(found.limit - abs(worst)) and found.margin < 0.0
    assert safety.safe is False and safety.named("exceeded") == [name]
    assert safety.words == f"NOT SAFE until 10 s: {name} exceeded"


def test_a_landing_within_all_limits_is_safe():
    """Its roll counts against the slope of the line: none is 0.1 rad under wheel 1."""
    safety = held()
    assert safety.safe is True and set(safety.limits) == set(UNITS)
    assert safety.words == f"SAFE until 10 s: {', '.join(UNITS)} kept"
    assert safety.limits["roll"].worst == pytest.approx(-0.1) and safety.limits["roll"].margin == pytest.approx(0.4)
    assert safety.limits["wheel_force"].worst == 100.0 and safety.limits["tension"].worst == pytest.approx(0.2)


def test_a_wheel_that_rolls_or_sticks_does_not_slide():
    moving = {"contact1.slip_velocity": np.full(1001, 1.0)}
    assert held(**moving).limits["slip"].worst == 0.0  # status 1: what the elastic bristle gives is no slip


def test_the_load_on_a_wheel_is_the_resultant_of_its_walls_within_the_step():
    """0.766 of the sum of the wall forces, as its radial force says wherever it touches."""
    touching = 1.0 * (TIME >= 1.0)
    loads = {"contact1.radial_force": 76.6 * touching, "contact1.normal_force_max": 300.0 * touching}
    assert held(**loads).limits["wheel_force"].worst == pytest.approx(229.8)


def test_a_margin_smaller_than_the_estimated_error_is_not_clear():
    close = {"robot.pitch": swing(0.999, 2.0)}
    assert held({"robot.pitch": 1e-4}, **close).safe is True
    safety = held({"robot.pitch": 2e-3}, **close)
    assert safety.safe is False and safety.limits["pitch"].verdict == "unclear"
    assert safety.words == "NOT CLEARLY SAFE until 10 s: margin of pitch smaller than the estimated error"
    off = np.where((TIME > 4.0) & (TIME < 4.2), 0.0, 1.0 * (TIME >= 1.0))  # 0.19 s, to the macro step of 10 ms
    assert held(**{"contact1.status": off}).limits["airborne"].verdict == "unclear"


def test_what_is_not_finite_is_beyond_any_limit():
    broken = np.where(TIME[700] == TIME, np.nan, 0.0)
    found = held(**{"robot.pitch": broken}).limits["pitch"]
    assert found.verdict == "exceeded" and found.time == TIME[700]


def test_who_falls_off_or_ends_early_is_never_safe():
    fallen = held(**{"contact2.status": np.where(TIME > 9.0, 3.0, 1.0 * (TIME >= 1.0))})
    assert fallen.safe is False and "the cable left the groove of contact2" in fallen.words
    early = held(fault="interrupted at t = 10 s")
    assert early.safe is False and early.words.startswith("NOT SAFE until 10 s: the run ended before its time")


def test_who_has_not_touched_is_not_judged():
    waiting = held(**{f"contact{k}.status": np.zeros(1001) for k in (1, 2)})
    assert waiting.safe is None and waiting.words == "NOT JUDGED until 10 s: no wheel has touched the line"
    assert judge(Limits({}, {}), table()).safe is None
    flying = held(**{f"contact{k}.status": np.where(TIME > 9.9, 0.0, 1.0 * (TIME >= 1.0)) for k in (1, 2)})
    assert flying.safe is True and flying.words.endswith("; in the air at the end")


def test_a_limit_without_its_signal_is_said_not_to_be_judged():
    signals = {name: values for name, values in table().items() if name != "robot.yaw"}
    known = {"yaw": Limit("yaw", 0.3, "rad", "made up"), "pitch": Limit("pitch", 1.0, "rad", "made up")}
    safety = judge(Limits(known, {"slip": "no limit given"}), signals)
    assert safety.safe is True and safety.words == "SAFE until 10 s: pitch kept"
    assert safety.not_judged == {"slip": "no limit given", "yaw": "robot.yaw is not among the signals"}


def test_the_picture_shows_every_limit(tmp_path: Path):
    safety = held(**EXCEEDED["airborne"][0])
    figure = draw_limits(tmp_path / "limits.png", safety.limits, table(**EXCEEDED["airborne"][0]))
    assert (tmp_path / "limits.png").is_file() and len(figure.axes) == len(UNITS)
    for axis, found in zip(figure.axes, safety.limits.values(), strict=True):
        limit = math.degrees(found.limit) if found.unit == "rad" else found.limit
        assert axis.get_ylim()[0] <= 0.0 and axis.get_ylim()[1] > limit


# -- from scenario and robot ----------------------------------------------------------------------------------


def of(*overrides: str, scenario: str = "landing_200m_point9", robot: str | None = None) -> Limits:
    """The limits of a shipped landing."""
    return limits_of(resolve(landing_only(load(scenario, overrides, robot))))


def test_limits_of_the_flagship_are_those_of_the_paper():
    found = of()
    degrees = {name: math.degrees(found.known[name].value) for name in ("roll", "yaw", "pitch")}
    assert degrees == pytest.approx({"roll": 14.53, "yaw": 16.35, "pitch": 62.99}, abs=0.005)
    assert found.known["z"].value == pytest.approx(1.25) and found.known["tension"].reference == 98370.0
    assert found.missing == dict.fromkeys(("slip", "airborne", "wheel_force"), "no limit given")
    assert found.known["roll"].formula is not None and found.known["roll"].source.startswith("eq. 1 of Jia et al. 2025")


def test_the_scenario_comes_before_the_robot_and_this_before_the_geometry(tmp_path: Path):
    robot = tmp_path / "own.toml"
    own = '[limits]\nroll = { value = 10, unit = "deg", source = "the maker" }\n'
    own += 'wheel_force = { value = 1.5, unit = "kN", source = "the maker" }\n'
    robot.write_text(ROBOT + own, encoding="utf-8")
    found = of("limits.roll={ value = 200, unit = 'mrad', source = 'the owner' }", robot=str(robot))
    assert (found.known["roll"].value, found.known["roll"].source) == (pytest.approx(0.2), "the owner")
    assert (found.known["wheel_force"].value, found.known["wheel_force"].source) == (1500.0, "the maker")
    assert of(robot=str(robot)).known["roll"].value == pytest.approx(math.radians(10.0))


def test_the_rated_strength_is_the_conductor_s_unless_the_scenario_has_one():
    """Its source is shown, and that of the share: a factor of safety of 2.5 of codes."""
    conductors, own = of().known["tension"], of("limits.rated_strength={ value = 50, unit = 'kN', source = 'a test' }")
    assert (conductors.value, conductors.reference) == (0.4, 98370.0) and "LGJ-120/70" in conductors.source
    assert own.known["tension"].reference == 50e3 and own.known["tension"].source.endswith("rated strength: a test")


def test_a_limit_can_be_switched_off():
    found = of("limits.roll=false", "limits.z={ value = false, source = 'assumed', reason = 'no line below' }")
    assert "roll" not in found.known and found.missing["roll"] == "switched off: command line"
    assert found.missing["z"] == "switched off: assumed: no line below"


def test_what_the_geometry_does_not_say_is_said():
    graph = of(robot=str(robot_fmu(load_robot("fptlir"))))
    assert set(graph.known) == {"yaw", "tension"} and "comes as an FMU" in graph.missing["roll"]
    heavy = of("robot.parameters.mass=100.0")
    assert heavy.missing["pitch"] == "the largest thrust, 820 N, does not carry its weight of 980 N"
    assert "pitch" in of(robot="fptlir_100kg").known
    rig = of(scenario="rig_10m")
    assert rig.missing["z"].startswith("switched off: Jia et al. 2025") and rig.known["tension"].reference == 78110.0


def test_a_robot_that_stands_is_judged_by_its_own_geometry():
    """Rotor plane 0.353 m above the line; with its centre of mass above the line it topples from any angle."""
    found = of(robot="hybrid_robot_2")
    assert found.known["roll"].value == pytest.approx(math.atan2(2.0 * 0.3532, 0.9), abs=1e-4)
    assert found.known["z"].value == pytest.approx(3.45 - 0.3 - 1.0)
    toppling = of("robot.parameters.center_of_mass.z=-0.3", robot="hybrid_robot_2")
    assert {"roll", "pitch"} <= set(toppling.missing) and "topples" in toppling.missing["roll"]


BAD = {
    "limits.rol=0.2": "limits.rol: unknown key; did you mean roll?",
    "limits.roll=20.0": "limits.roll: 20.0 is more than half a turn: rad unless a unit is given",
    "limits.z=-1.0": "limits.z: -1.0 must be a finite number, not negative",
    "limits.slip=nan": "limits.slip: nan must be a finite number",
    "limits.airborne=inf": "limits.airborne: inf must be a finite number",
    "limits.wheel_force=true": "limits.wheel_force: True must be a finite number",
    "limits.yaw={ value = 3.0, unit = 'm' }": "limits.yaw: unit 'm' does not fit; possible here: rad, deg",
    "limits.rated_strength=0.0": "limits.rated_strength: 0.0 must be greater than 0",
}  # fmt: skip


@pytest.mark.parametrize("override", BAD)
def test_a_bad_limit_is_refused_with_place_cause_and_cure(override: str):
    with pytest.raises(InputError) as caught:
        load("landing_200m_point9", [override])
    assert caught.value.exit_status == 2 and BAD[override] in str(caught.value)


def test_limits_that_lack_what_they_are_counted_by_are_refused(tmp_path: Path):
    text = LANDING.read_text(encoding="utf-8").partition("[limits]")[0] + "[limits]\n"
    text = text.replace('conductor = "jia2025_200m"', "")
    for given, wanted in (("tension = 0.5", "rated_strength"), ("safe_clearance = 1.0", "conductor_spacing")):
        file = tmp_path / "a.toml"
        file.write_text(text + given, encoding="utf-8")
        with pytest.raises(InputError, match=f"give .*limits.{wanted}|without limits.{wanted}"):
            load(file)
    with pytest.raises(InputError, match="unknown key"):
        load(OSCILLATOR, ["limits.roll=0.2"])
    with pytest.raises(InputError, match="is a graph of FMUs"):
        landing_only(load(OSCILLATOR))


# -- runs -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> orchestrator.Run:
    """The start of the flagship, with a limit that it does not keep."""
    out = tmp_path_factory.mktemp("limits") / "run"
    return orchestrator.run("landing_200m_point9", stop=0.3, set={"limits.z": 0.05, "limits.slip": 1.0}, out=out)


def test_a_run_says_whether_it_was_safe(run: orchestrator.Run):
    assert (run.verdict, run.safe, run.exit_status) == ("within", False, 1)
    assert run.safety == "NOT SAFE until 0.3 s: z exceeded" and run.safety in run.warnings
    z, sunk = run.limits["z"], run["robot.body.position.z"].values
    assert z.worst == pytest.approx(sunk[0] - sunk.min(), abs=1e-9) and z.margin == pytest.approx(0.05 - z.worst)
    assert z.estimated_error == run.estimated_error["robot.body.position.z"]
    roll = run["robot.roll"].values - np.arctan2(
        run["cable.port[1].tangent.z"].values, run["cable.port[1].tangent.y"].values
    )
    assert abs(run.limits["roll"].worst) == np.max(np.abs(roll)) and run.limits["roll"].wheel == 1


def test_the_summary_has_the_limits_and_reads_back(run: orchestrator.Run):
    assert run.directory is not None
    content = json.loads((run.directory / "summary.json").read_text(encoding="utf-8"))
    assert content["safe"] is False and set(content["limits"]) == {"roll", "yaw", "pitch", "z", "slip", "tension"}
    assert all(
        {"limit", "worst", "margin", "time", "unit", "wheel", "source"} <= set(x) for x in content["limits"].values()
    )
    assert content["limits"]["roll"]["unit"] == "rad" and set(content["not_judged"]) == {"airborne", "wheel_force"}
    read = orchestrator.load_run(run.directory)
    assert (read.safe, read.safety, read.limits) == (run.safe, run.safety, run.limits) and read.exit_status == 1


def test_pictures_and_page_show_the_limits(run: orchestrator.Run):
    assert run.directory is not None and (run.directory / "plots" / "limits.png").is_file()
    page = report(run.directory, run.directory / "no template").read_text(encoding="utf-8")
    assert "NOT SAFE until 0.3 s: z exceeded" in page and "EXCEEDED" in page and 'alt="plots/limits"' in page


def test_the_same_signals_within_the_paper_s_limits_are_safe(run: orchestrator.Run):
    system = LandingSystem(resolve(landing_only(load("landing_200m_point9"))))
    safety = system.safety(run.table, run.fields, run.estimated_error)
    assert safety.safe is True and safety.words == "SAFE until 0.3 s: roll, yaw, pitch, z, tension kept"
    assert replace(safety, faults=["fell"]).safe is False


def test_a_comparison_judges_its_runs_and_the_reference(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "all"
    found = orchestrator.compare("landing_200m_point9", stop=0.1, set={"limits.tension": 0.2}, out=out, pictures=False)
    assert found.passed and found.reference.safe is False and found.results[0].safe is False and found.exit_status == 1
    mine, theirs = found.results[0].limits["tension"], found.reference.safety["limits"]["tension"]
    assert mine.worst == pytest.approx(theirs["worst"], rel=1e-3) and mine.time == theirs["time"]
    read = orchestrator.load_comparison(out)
    assert read.reference.safety == found.reference.safety and read.exit_status == 1
    print_comparison(read)
    shown = capsys.readouterr().out
    assert "reference: NOT SAFE until 0.1 s: tension exceeded" in shown and "EXCEEDED" in shown
    page = report(out).read_text(encoding="utf-8")
    assert "safety, reference" in page and "tension exceeded" in page and (out / "plots" / "limits.png").is_file()


SLIPPERY = ("simulation.stop_time=1.0", "simulation.macro_step=0.005", "contact.parameters.friction_coefficient=0.01")


def slid(*overrides: str) -> tuple[float, dict[str, np.ndarray]]:
    """How far (m) the robot has slid on the inclined rig, and all signals."""
    system = LandingSystem(resolve(landing_only(load("rig_10m_inclined", [*SLIPPERY, *overrides]))))
    signals = run_coupled(system).table
    return float(series("slip", signals)[1][-1]), signals


def test_a_locked_wheel_slides_as_far_as_its_contact_goes():
    """But for what the swing of the robot turns the wheel, and for the way of one macro step."""
    slip, signals = slid()
    way = abs(signals["contact1.cable.s"][-1] - signals["contact1.cable.s"][0])
    turned = 0.075 * np.ptp(signals["robot.roll"])
    assert way > 0.1 and abs(slip - way) < turned + 0.005 * np.max(signals["contact1.slip_velocity"])


def test_a_wheel_that_turns_freely_goes_as_far_and_does_not_slide():
    free = ("robot.parameters.wheel[1].braked=false", "robot.parameters.wheel[1].inertia=1e-4")
    slip, signals = slid("contact.parameters.friction_coefficient=0.5", *free)
    assert abs(signals["contact1.cable.s"][-1] - signals["contact1.cable.s"][0]) > 0.1 and slip < 1e-3


def test_a_graph_is_no_landing():
    found = orchestrator.run(OSCILLATOR, stop=0.1, estimate="none")
    assert (found.safe, found.safety, found.limits, found.exit_status) == (None, "", {}, 0)


@pytest.mark.slow
def test_the_flagship_is_safe_and_without_damping_the_physical_one_is_not():
    safe = orchestrator.run("landing_200m_point9")
    assert safe.safe is True and safe.exit_status == 0
    assert orchestrator.run("landing_200m_point9_physical").safe is True
    swinging = orchestrator.run("landing_200m_point9_undamped")
    assert swinging.safe is False and [n for n, x in swinging.limits.items() if x.verdict != "kept"] == ["roll"]
