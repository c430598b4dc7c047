"""The dynamic contract: what is right passes, and each fault is told from the others by its rows."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from orchestrator.catalogue.library import module_fmu, robot_fmu
from orchestrator.catalogue.robot_spec import catalogue, load_robot
from orchestrator.cli import commands as cli
from orchestrator.coupling.fmu.archive import sha256_of
from orchestrator.landing.trial import contact as contacts
from orchestrator.landing.trial.answers import attitude
from orchestrator.landing.trial.body import Body, Wrench
from orchestrator.landing.trial.dynamic import Trial, put_on_trial
from orchestrator.landing.trial.row import ACCURACY, deviation
from orchestrator.runs.systems import LandingSystem
from tests.fmus import build, compiled, needs_compiler
from tests.robots_in_c import EXITS, FAILS, FAULTS, HANGS, robot_in_c


def failures(trial: Trial) -> dict[str, str]:
    """Return what failed, and what it points to."""
    assert trial.failure == ""
    return {row.name: row.why for row in trial.rows if row.verdict == "FAIL"}


# -- what is right --------------------------------------------------------------------------------------------

QUICK = ("fptlir", "hybrid_robot_1", "linedrone")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in catalogue()])
def test_the_robots_of_the_catalogue_pass_whole(name: str) -> None:
    trial = put_on_trial(robot_fmu(load_robot(name)), "robot")
    assert [row for row in trial.rows if row.verdict != "pass"] == []


@needs_compiler
@pytest.mark.parametrize("n_wheels", [1, 3])
def test_a_robot_that_does_not_say_what_it_is_is_found_from_its_answers(n_wheels: int) -> None:
    trial = put_on_trial(robot_in_c(n_wheels=n_wheels, silent=True), "robot")
    assert failures(trial) == {}
    assert any("its own answers" in row.source for row in trial.rows)


@pytest.mark.parametrize("rollback", [True, False])
def test_a_robot_with_the_least_that_is_needed(rollback: bool) -> None:
    """No units, means, slopes or energies: those rows are not testable, and say why."""
    trial = put_on_trial(build("robot", rollback=rollback), "robot")
    assert failures(trial) == {}
    open_rows = {row.name: row.why for row in trial.rows if row.verdict == "not testable"}
    assert all(open_rows.values()) and {"mounts", "work is energy", "wheel[1].force_rate acts"} <= set(open_rows)
    assert ("state replay" in open_rows) is not rollback
    masters = next(row for row in trial.rows if row.name == "masters")
    assert ("gauss_seidel" in masters.found) is not rollback


def test_our_cable_passes_whole() -> None:
    assert [row for row in put_on_trial(module_fmu("cable"), "cable").rows if row.verdict != "pass"] == []


def test_our_contact_passes() -> None:
    assert failures(put_on_trial(module_fmu("contact"), "contact")) == {}


# -- faults ---------------------------------------------------------------------------------------------------

ALL_LOADS = {f"wheel[1].{what}.{axis} acts" for what in ("force", "moment") for axis in "xyz"}
MOMENTS = {name for name in ALL_LOADS if "moment" in name}
SLOPES = {"wheel[1].force_rate acts", "wheel[1].moment_rate acts"}
EXPECTED: dict[str, tuple[set[str], str, str]] = {
    "wrong sign": (
        {"wheel[1].force.x acts", "reciprocity", "work is energy"},
        "wheel[1].force.x acts",
        "wrong way round",
    ),
    "one axis ignored": (
        {"wheel[1].force.y acts", "reciprocity", "work is energy"},
        "wheel[1].force.y acts",
        "is ignored",
    ),
    "moments ignored": ({*MOMENTS, "reciprocity", "work is energy"}, "wheel[1].moment.z acts", "is ignored"),
    "no lever": (
        {"reciprocity", "work is energy"},
        "wheel[1].force.x acts",
        "lever about the centre of mass is missing",
    ),
    "body's frame": (ALL_LOADS | {"work is energy"}, "wheel[1].moment.y acts", "taken in the body's frame"),
    "old outputs": ({"outputs of the step"}, "outputs of the step", "the step before"),
    "late loads": (ALL_LOADS, "wheel[1].force.x acts", "a step late"),
    "wrong mean": ({"wheel[k].position_mean"}, "wheel[k].position_mean", "the value at the end of the step"),
    "rotation in one step only": ({"wheel[k].rotation"}, "wheel[k].rotation", "something else"),
    "state forgotten": ({"state replay"}, "state replay", "does not come back"),
    "slopes ignored": (SLOPES, "wheel[1].force_rate acts", "it is ignored"),
    "slopes from the start": (SLOPES, "wheel[1].moment_rate acts", "from the start of the step"),
    "no gyroscope": ({"all loads over 0.3 s"}, "all loads over 0.3 s", "gyroscopic"),
    "starts elsewhere": ({"start"}, "start", "elsewhere"),
    "falls upwards": ({"free fall", "work is energy"}, "free fall", "upwards"),
    "axle too long": ({"axles"}, "axles", "not"),
    "pitch down": ({"start", "mounts", "roll, pitch, yaw"}, "roll, pitch, yaw", "another convention"),
}
"""Fault → rows that must fail, the row that names it, and what that says."""


@cache
def tried(fault: str) -> Trial:
    """Return what came of the robot in C with a fault."""
    return put_on_trial(robot_in_c(fault), "robot")


@needs_compiler
@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_told_by_its_rows(fault: str) -> None:
    found = failures(tried(fault))
    needed, names_it, says = EXPECTED[fault]
    assert names_it in found and says in found[names_it], found
    assert needed <= set(found)


@needs_compiler
def test_no_two_faults_look_alike() -> None:
    found = [failures(tried(fault)) for fault in FAULTS]
    assert len({(frozenset(rows), rows[EXPECTED[f][1]]) for f, rows in zip(FAULTS, found, strict=True)}) == len(FAULTS)


@needs_compiler
@pytest.mark.parametrize(
    "fault", ["wrong mean", "rotation in one step only", "state forgotten", "old outputs", "axle too long"]
)
def test_a_fault_in_one_place_is_found_in_one_place(fault: str) -> None:
    assert set(failures(tried(fault))) == EXPECTED[fault][0]


@needs_compiler
@pytest.mark.parametrize("fault", ["wrong sign", "moments ignored", "no lever"])
def test_a_fault_shows_without_parameters_too(fault: str) -> None:
    found = failures(put_on_trial(robot_in_c(fault, silent=True), "robot"))
    assert EXPECTED[fault][1] in found


@needs_compiler
def test_an_fmu_without_a_contract_is_tried_for_what_any_must_do() -> None:
    trial = put_on_trial(compiled("lag2"), "any")
    assert failures(trial) == {} and {"state replay", "a fresh instance", "macro step"} <= {
        row.name for row in trial.rows
    }


# -- contacts that are made up --------------------------------------------------------------------------------


def press(**changes: np.ndarray) -> contacts.Press:
    """A wheel that touches from the second of four steps on."""
    arm = np.array([[0.0, 0.0, 0.06 - 0.001 * i] for i in range(4)])
    force = np.array([[0.0, 0.0, f] for f in (0.0, 1.0, 2.0, 3.0)])
    shown = {"penetration": np.array([-1e-3, 1e-3, 2e-3, 3e-3]), "normal_force": force[:, 2], "wheel.force": force}
    shown |= {"cable.force": -force, "wheel.moment": 0.0 * force, "cable.moment": -np.cross(arm, force)}
    return contacts.Press(arm, 0.0 * arm, shown | changes)


def test_faults_of_a_contact_are_told() -> None:
    right, force = press(), press()["wheel.force"]
    rows = [contacts._open, contacts._pushes, lambda p: contacts._grows(p, 4), lambda p: contacts._balanced([p])]
    assert [row(right).verdict for row in rows] == ["pass"] * 4
    from_afar = press(**{"wheel.force": force + np.array([0.0, 0.0, 1.0])})
    pulling = press(**{"wheel.force": -force, "cable.force": force})
    softening = press(normal_force=force[::-1, 2])
    unbalanced = press(**{"cable.force": -0.9 * force})
    wrong = (from_afar, pulling, softening, unbalanced)
    assert [row(fault).verdict for row, fault in zip(rows, wrong, strict=True)] == ["FAIL"] * 4


# -- the reference itself -------------------------------------------------------------------------------------


def test_newton_and_euler_keep_momentum_and_energy() -> None:
    """A free body with a spinning wheel: angular momentum and energy stay, to the order of the reference's steps."""
    J, axle = np.diag([2.0, 3.0, 4.0]), np.array([[1.0, 0.0, 0.0]])
    body = Body(5.0, J, np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.1]]), axle, np.array([0.05]))
    none = np.zeros((1, 3))
    kick = Wrench(none, np.array([[0.4, 3.0, -2.0]]))
    gained = body.ride(kick, np.zeros(3), 0.2, 200)
    work_of_kick = 0.5 * gained[3] @ J @ gained[3]
    assert work_of_kick > 0.0
    twice = [body.ride(kick, np.zeros(3), 0.4, n) for n in (40, 80, 160)]
    errors = [np.max(np.abs(a - b)) for a, b in pairwise(twice)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


def test_attitude_is_that_of_the_contract() -> None:
    roll, pitch, yaw = attitude([0.3, 0, 0]), attitude([0, 0.3, 0]), attitude([0, 0, 0.3])
    assert np.allclose(attitude([0.3, 0.3, 0.3]), yaw @ pitch @ roll, atol=1e-15)
    assert roll[2, 1] > 0.0 and pitch[2, 0] < 0.0 and yaw[1, 0] > 0.0


def test_a_large_estimate_excuses_nothing() -> None:
    held = deviation(np.array([0.0]), np.array([1.0]), estimate=10.0)
    assert not held.good and held.allowed == pytest.approx(0.1 + ACCURACY)
    assert replace(held, size=0.05).good


# -- the command ----------------------------------------------------------------------------------------------


def command(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    told = capsys.readouterr()
    return int(ended.value.code or 0), told.out, told.err


@needs_compiler
def test_the_command_says_what_it_ran_and_what_it_has_not_tested(capsys, tmp_path: Path) -> None:
    status, out, _ = command(capsys, "check", robot_in_c("moments ignored"))
    assert status == 0 and "neither initialised nor stepped" in out
    assert "meets the robot contract as far as it can be read" in out and "not tested: whether it obeys" in out
    status, out, _ = command(capsys, "check", "--run", robot_in_c("moments ignored"), "--json", tmp_path / "found.json")
    assert status == 1 and "wheel[1].moment.x: " in out.replace(" acts", "") and "findings fail" in out
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["passed"] is False and {row["verdict"] for row in found["rows"]} == {"pass", "FAIL", "not testable"}
    status, out, _ = command(capsys, "check", "--run", robot_in_c())
    assert status == 0 and out.rstrip().endswith("passes")


@needs_compiler
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--run", "--read-only"], "choose one"),
        (["--run", "--macro-step", "0"], "greater than 0"),
        (["--contract", "boat"], "boat"),
    ],
)
def test_wrong_input_ends_with_status_2(capsys, options, message) -> None:
    status, _, err = command(capsys, "check", robot_in_c(), *options)
    assert status == 2 and message in err


@needs_compiler
@pytest.mark.parametrize(("how", "says"), [(FAILS, "discard"), (EXITS, "ended"), (HANGS, "no answer within 2 s")])
def test_an_fmu_that_fails_on_trial_ends_with_status_3_and_what_was_found(capsys, how: str, says: str) -> None:
    status, out, err = command(capsys, "check", "--run", "--timeout", 2, robot_in_c(how))
    assert status == 3 and "free fall " in out and says in err


@needs_compiler
def test_a_landing_knows_what_became_of_its_foreign_robot(
    capsys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path))
    ours, right, wrong = None, robot_in_c(), robot_in_c("moments ignored")

    def notes(robot: Path | None) -> list[str]:
        parts = {name: SimpleNamespace(foreign=None) for name in ("cable", "contact")}
        landing = SimpleNamespace(**parts, robot=SimpleNamespace(foreign=robot))
        graph: Any = SimpleNamespace(components={"robot": SimpleNamespace(sha256=sha256_of(robot))} if robot else {})
        return list(LandingSystem._untried(cast(LandingSystem, SimpleNamespace(landing=landing)), graph))

    assert notes(ours) == [] and ["check --run" in note for note in notes(right)] == [True]
    for robot in (right, wrong):
        command(capsys, "check", "--run", robot)
    assert notes(right) == [] and "wheel[1].moment.x acts" in notes(wrong)[0]


def test_read_only_runs_nothing(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.coupling.fmu.instance.Fmu.__init__", lambda *_: pytest.fail("it was loaded"))
    status, out, _ = command(capsys, "check", "--read-only", build("robot"))
    assert status == 0 and "loads and instantiates" not in out
