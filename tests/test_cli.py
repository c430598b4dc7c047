"""The command line: exit status, messages, and the files that a run leaves."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from fmus.robot.module import robot_table
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.library import module_fmu, robot_fmu
from orchestrator.catalogue.robot_spec import catalogue, load_robot
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.masters.options import master_options
from orchestrator.coupling.run.results import read_fields, read_table
from orchestrator.landing.contract import check_variables, is_met
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.command import orchestrate
from tests.fmus import build
from tests.scenarios import LANDING, OSCILLATOR, ROOT, exact_oscillator

pytestmark = pytest.mark.usefixtures("coarse_pictures")
COMMAND = [sys.executable, "-m", "orchestrator"]


def shipped_fmu(name: str) -> Path:
    """Return the FMU of one of our modules, or of a robot of the catalogue."""
    return robot_fmu(load_robot(name)) if name in catalogue() else module_fmu(name)


def launched(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own; there is never a traceback."""
    command = [*COMMAND, *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300.0)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def manifest(directory: Path) -> dict:
    return json.loads((directory / "manifest.json").read_text())


@pytest.fixture(scope="module")
def oscillator_run(tmp_path_factory) -> tuple[subprocess.CompletedProcess[str], Path]:
    out = tmp_path_factory.mktemp("runs") / "oscillator"
    return launched("run", OSCILLATOR, "--out", out, "--stop", 2, "--timeout", 60), out


@pytest.fixture(scope="module")
def landing_run(tmp_path_factory) -> tuple[subprocess.CompletedProcess[str], Path]:
    out = tmp_path_factory.mktemp("runs") / "landing"
    return launched("run", LANDING, "--out", out, "--stop", 0.05, "--quiet"), out


def test_help_imports_nothing_heavy():
    code = "import sys, orchestrator.cli.commands; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"numpy", "numba", "matplotlib", "fmpy", "pydantic"} & set(done.stdout.split())


def test_help_names_every_command():
    done = launched("--help")
    assert done.returncode == 0
    assert all(name in done.stdout for name in ("build", "list", "validate", "check", "run", "compare", "report"))


def test_list_shows_scenarios_robots_and_masters():
    done = orchestrate("list")
    names = [*vocabulary.robots(), *master_options(), *(p.stem for p in (ROOT / "scenarios").glob("*.toml"))]
    assert done.returncode == 0 and all(name in done.stdout for name in names)


def test_new_files_are_valid_and_never_overwritten(tmp_path: Path):
    robot, scenario = tmp_path / "mine.toml", tmp_path / "line.toml"
    assert orchestrate("new", "robot", robot).stdout == f"{robot}\n"
    assert orchestrate("new", "scenario", tmp_path / "line").stdout == f"{scenario}\n"
    done = orchestrate("validate", scenario, "--robot", robot)
    assert done.returncode == 0 and done.stdout.startswith(f"{scenario}: valid; 3 FMUs")
    assert all(line.startswith("line-landing: ") for line in done.stderr.splitlines()), done.stderr  # what is built
    done = orchestrate("new", "scenario", scenario)
    assert done.returncode == 2 and "exists already" in done.stderr


def test_a_robot_s_file_gives_the_same_as_the_catalogue(landing_run, tmp_path: Path):
    """By name, from another folder; a robot that changes nothing."""
    (tmp_path / "same.toml").write_text('extends = "fptlir"')
    arguments = ["--robot", "same.toml", "--out", "out", "--stop", 0.05, "--quiet", "--no-pictures"]
    done = orchestrate("run", LANDING.stem, *arguments, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    ours, theirs = read_table(landing_run[1] / "results.csv"), read_table(tmp_path / "out" / "results.csv")
    assert all(np.array_equal(ours[name], theirs[name]) for name in ours)
    assert len(manifest(tmp_path / "out")["provenance"]["robot.model"]["sha256"]) == 64


def test_another_mass_is_answered_once_with_its_inertia(tmp_path: Path):
    mass = 'robot.parameters.mass={ value = 76000, unit = "g" }'
    options = [
        "--out",
        tmp_path / "out",
        "--stop",
        0.01,
        "--quiet",
        "--no-pictures",
        "--masters",
        "jacobi,gauss_seidel",
    ]
    done = orchestrate("compare", LANDING.stem, *options, "--set", mass)
    assert done.returncode in (0, 1), done.stderr
    assert done.stderr.count("robot.parameters.mass: inertia scaled by 2 with the mass") == 1
    resolved = manifest(tmp_path / "out" / "jacobi_0.005s")["resolved"]["robot"]["parameters"]
    assert resolved["mass"] == 76.0 and resolved["inertia.zz"] == 17.0


@pytest.mark.parametrize("command", ["run", "compare", "validate"])
def test_wrong_input_ends_with_status_2_and_leaves_nothing(command: str, tmp_path: Path):
    out = tmp_path / "out"
    options = [] if command == "validate" else ["--out", out]
    done = orchestrate(command, LANDING, *options, "--set", "robot.parameters.mas=1", "--set", "landing.position=999.0")
    assert done.returncode == 2 and not out.exists() and done.stdout == ""
    assert "did you mean mass?" in done.stderr and "off the span" in done.stderr


@pytest.mark.parametrize("arguments", [["run"], ["fly"], ["run", OSCILLATOR, "--macro-step", "fast"]])
def test_wrong_usage_ends_with_status_2(arguments: list[str]):
    assert launched(*arguments).returncode == 2


@pytest.mark.parametrize("command", ["run", "compare"])
def test_an_existing_output_directory_is_not_touched(command: str, tmp_path: Path):
    done = orchestrate(command, OSCILLATOR, "--out", tmp_path)
    assert done.returncode == 2 and "exists already" in done.stderr and list(tmp_path.iterdir()) == []


def test_an_output_directory_that_cannot_be_made_is_found_before_the_run(tmp_path: Path):
    (tmp_path / "file").write_text("")
    done = orchestrate("run", OSCILLATOR, "--out", tmp_path / "file" / "out")
    assert done.returncode == 2 and "cannot be made" in done.stderr


def test_a_run_leaves_its_files(oscillator_run):
    done, out = oscillator_run
    assert done.returncode == 0 and f"results in {out}" in done.stdout
    assert orchestrate("report", out).returncode == 0 and (out / "report.html").is_file()
    files = ("results.csv", "iterations.csv", "summary.json", "plots/overview.png", "plots/iterations.png")
    assert all((out / name).is_file() for name in files)
    content = manifest(out)
    assert content["complete"] is True and content["error"] is None
    assert content["resolved"]["simulation"]["stop_time"] == 2.0
    assert len(content["fmus"]["left"]["sha256"]) == 64
    assert not [path for path in out.rglob("*") if path.name.startswith(".")]


def test_a_run_meets_the_analytic_solution(oscillator_run):
    """The scenario's own tolerance, a thousandth of peak-to-peak, holds against the exact solution too."""
    _, out = oscillator_run
    table = read_table(out / "results.csv")
    steps = read_table(out / "iterations.csv")
    assert next(iter(table)) == "time" and len(steps["time"]) == len(table["time"]) - 1 == 200
    exact = exact_oscillator(table["time"])
    assert np.max(np.abs(table["left.position"] - exact[0])) < 1e-3 * np.ptp(exact[0])
    assert np.max(np.abs(table["right.position"] - exact[1])) < 1e-3 * np.ptp(exact[1])


STIFF = {"coupling_stiffness": 1e6, "stiffness": 1e3, "initial_position": 1.0}


@pytest.mark.parametrize("right", [{}, STIFF], ids=["mild", "stiff"])
@pytest.mark.parametrize("master", [name for name, master in MASTERS.items() if master.IMPLICIT])
def test_oscillator_with_every_implicit_master(master: str, right: dict[str, float]):
    """At H = 10 ms within 1e-3 of the range; omega H of the coupling is 0.15 and 14."""
    options = [f"components.right.parameters.{name}={value}" for name, value in right.items()]
    table = run_coupled(load(OSCILLATOR, options, master=master)).table
    exact = exact_oscillator(table["time"], *right.values())
    assert np.max(np.abs(table["left.position"] - exact[0])) < 1e-3 * np.ptp(exact[0])
    assert np.max(np.abs(table["right.position"] - exact[1])) < 1e-3 * np.ptp(exact[1])


PAIR = ("--masters", "iqn_ils,nepce")


def test_compare_orders_verdict_and_report(tmp_path: Path):
    out = tmp_path / "comparison"
    options = ["--stop", 1, "--macro-steps", "0.02,0.01", "--quiet", "--no-pictures"]
    done = launched("compare", OSCILLATOR, "--out", out, *options, *PAIR)
    content = json.loads((out / "comparison.json").read_text())
    assert done.stderr == "" and done.returncode == (0 if content["verdict"] == "pass" else 1)
    assert [run["macro_step"] for run in content["runs"]] == [0.02, 0.01, 0.02, 0.01]
    for master, order in (("iqn_ils", 4.0), ("nepce", 2.0)):  # waveform, and values held
        assert content["observed_order"][master]["left.position"] == pytest.approx(order, abs=0.2)
    table = read_table(out / "reference.csv")
    exact = exact_oscillator(table["time"])
    estimate = content["reference"]["estimated_error"]["left.position"]
    assert np.max(np.abs(table["left.position"] - exact[0])) <= estimate
    assert manifest(out / "iqn_ils_0.01s")["complete"] is True
    assert not (out / "plots").exists()
    done = orchestrate("report", out)
    assert done.returncode == 0 and (out / "report.html").is_file() and (out / "plots" / "convergence.png").is_file()


def test_a_missed_tolerance_ends_with_status_1(tmp_path: Path):
    options = ["--stop", 0.5, "--set", "simulation.tolerances.left.position=1e-9"]
    done = orchestrate("compare", OSCILLATOR, "--out", tmp_path / "out", *options)
    assert done.returncode == 1 and "FAIL" in done.stdout
    assert {"plots", "iqn_ils_0.01s/plots"} <= {
        str(p.parent.relative_to(tmp_path / "out")) for p in tmp_path.rglob("*.png")
    }


def test_a_failure_in_mid_run_keeps_the_results(tmp_path: Path):
    """At 1e308 m/s, without a spring, the position overflows after 1.8 s."""
    zero = [f"components.{side}.parameters.{key}=0.0" for side in ("left", "right") for key in ("stiffness", "damping")]
    zero += ["components.right.parameters.coupling_stiffness=0.0", "components.right.parameters.coupling_damping=0.0"]
    options = [text for key in [*zero, "components.left.parameters.initial_velocity=1e308"] for text in ("--set", key)]
    out = tmp_path / "out"
    done = orchestrate("run", OSCILLATOR, "--out", out, "--master", "jacobi", "--no-pictures", *options)
    assert done.returncode == 3 and "left" in done.stderr
    content = manifest(out)
    assert content["complete"] is False and "left" in content["error"]
    table = read_table(out / "results.csv")
    assert 1.5 < table["time"][-1] < 2.0 and np.all(np.isfinite(table["left.position"]))


CTRL_C = """
import os, signal, sys
from orchestrator.cli import commands
from orchestrator.runs import coupled
run = coupled.run_coupled
press = lambda time: time > 0.5 and os.kill(os.getpid(), signal.SIGINT)
coupled.run_coupled = lambda scenario, progress, *rest: run(scenario, press, *rest)
commands.main(sys.argv[1:])
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT for one process there")
def test_ctrl_c_keeps_the_results(tmp_path: Path):
    out = tmp_path / "out"
    command = [sys.executable, "-c", CTRL_C, "run", OSCILLATOR, "--out", str(out), "--quiet", "--no-pictures"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 130 and "interrupted at t = 0.51 s" in done.stderr and "Traceback" not in done.stderr
    assert manifest(out)["complete"] is False and manifest(out)["error"] == "interrupted at t = 0.51 s"
    assert read_table(out / "results.csv")["time"][-1] == pytest.approx(0.51)


def test_a_landing_leaves_shape_and_tension(landing_run):
    done, out = landing_run
    assert done.returncode == 0 and done.stderr == ""
    fields, table = read_fields(out / "fields.h5"), read_table(out / "results.csv")
    n, m = fields["tension"].shape
    assert fields["position"].shape == (n, m, 3) and n == len(table["time"]) == 11
    assert np.allclose(fields["position"][:, [0, -1], 2], 0.0, atol=1e-9)  # supports do not move
    assert not any("_mean" in name or "shape[" in name or "node[" in name or "port[2]" in name for name in table)
    m = fields["node_arc_length"].size
    assert fields["node_position"].shape == fields["node_slope"].shape == (n, m, 3) and 2 < m <= 64
    assert np.allclose(fields["node_position"][:, [0, -1]], fields["position"][:, [0, -1]], rtol=0.0, atol=1e-12)
    assert (out / "plots" / "shapes.png").is_file()


def test_a_landing_books_the_same_energy_on_both_sides_of_the_contact(landing_run):
    """Cable, wheel and law: each to 1e-6 of the energy exchanged, which is the tolerance of the iteration."""
    summary = json.loads((landing_run[1] / "summary.json").read_text())
    balance = summary["interface_balance"]["contact1"]
    work = sum(abs(value) for name, value in summary["interface_work_J"].items() if "force" in name)
    assert balance["exchanged_J"] > 0.5 * work > 0.0
    for name in ("cable_residual_J", "wheel_residual_J", "law_residual_J"):
        assert balance[name] <= 1e-6 * balance["exchanged_J"]


def test_a_robot_is_swapped_with_as_many_contacts_as_wheels(tmp_path: Path):
    out = tmp_path / "out"
    done = orchestrate("run", LANDING, "--robot", "hybrid_robot_2", "--out", out, "--stop", 0.01, "--no-pictures")
    assert done.returncode == 0
    assert {"contact1.normal_force", "contact2.normal_force"} <= set(read_table(out / "results.csv"))


def test_a_foreign_robot_gives_the_same_as_the_same_one_of_the_catalogue(landing_run, tmp_path: Path):
    robot = shutil.copy(shipped_fmu("fptlir"), tmp_path / "mine.fmu")
    out = tmp_path / "out"
    done = orchestrate("run", LANDING, "--robot", robot, "--out", out, "--stop", 0.05, "--no-pictures")
    assert done.returncode == 0, done.stderr
    ours, theirs = read_table(landing_run[1] / "results.csv"), read_table(out / "results.csv")
    assert np.allclose(ours["robot.body.position.z"], theirs["robot.body.position.z"], rtol=0.0, atol=1e-12)


def test_an_fmu_that_is_no_robot_is_refused_by_name(landing_run):
    done = orchestrate("validate", LANDING, "--robot", shipped_fmu("contact"))
    assert done.returncode == 2 and "body.position" in done.stderr and "orchestrator check" in done.stderr


@pytest.mark.parametrize(("name", "kind"), [("fptlir", "robot"), ("cable", "cable"), ("contact", "contact")])
def test_check_finds_the_contract_of_our_fmus(landing_run, name: str, kind: str):
    done = orchestrate("check", shipped_fmu(name))
    assert done.returncode == 0 and f"meets the {kind} contract" in done.stdout


def test_check_says_what_a_wrong_fmu_lacks(landing_run):
    done = orchestrate("check", shipped_fmu("contact"), "--contract", "robot")
    assert done.returncode == 1 and "does not meet the robot contract" in done.stdout and "missing" in done.stdout


@pytest.mark.parametrize("kind", ["cable", "contact"])
def test_our_modules_meet_the_contract(kind: str):
    findings = check_variables(kind, vocabulary.of_module(kind))
    assert is_met(findings) and all(finding.verdict == "ok" for finding in findings)


@pytest.mark.parametrize("n_wheels", [1, 2, 3, 4])
def test_our_robots_meet_the_contract(n_wheels: int):
    findings = check_variables("robot", {v.name: v for v in robot_table(n_wheels).variables})
    assert all(finding.verdict == "ok" for finding in findings)


def test_units_and_causalities_are_part_of_the_contract():
    from dataclasses import replace

    known = {v.name: v for v in robot_table(1).variables}
    known["roll"] = replace(known["roll"], unit="deg")
    known["pitch"] = replace(known["pitch"], causality="input")
    del known["body.velocity.y"]
    broken = {finding.what: finding.note for finding in check_variables("robot", known) if finding.verdict != "ok"}
    assert "deg" in broken["output roll"]
    assert "input" in broken["output pitch"]
    assert "body.velocity.y" in broken["output body.velocity.{x,y,z}"]


def hanging(folder: Path) -> Path:
    """A scenario of two FMUs, one of which sleeps for a minute at 0.1 s."""
    path = folder / "hanging.toml"
    path.write_text(
        f"""title = "An FMU that hangs"
[simulation]
stop_time = 0.3
macro_step = 0.05
tolerances = {{ "b.x" = 1e-2 }}
[components.a]
fmu = "{build("odd")}"
inputs.u = 1.0
[components.b]
fmu = "{build("odd")}"
parameters = {{ fault = 3, fault_time = 0.1 }}
""",
        encoding="utf-8",
    )
    return path


def test_an_fmu_that_hangs_ends_the_run(tmp_path: Path):
    """x = t for u = 1: what was reached before 0.1 s is kept, and the process does not wait for the FMU."""
    out, clock = tmp_path / "out", monotonic()
    options = ["--out", out, "--master", "gauss_seidel", "--no-pictures", "--set", "simulation.timeout=1.0"]
    done = launched("run", hanging(tmp_path), *options)
    assert done.returncode == 3 and monotonic() - clock < 40.0, done.stderr
    assert (
        "b, t = 0.1 s: the step of 0.05 s: no answer within 1 s" in done.stderr and f"results in {out}" in done.stdout
    )
    table = read_table(out / "results.csv")
    assert table["time"] == pytest.approx([0.0, 0.05, 0.1]) and table["a.x"] == pytest.approx(table["time"])
    content = manifest(out)
    assert content["complete"] is False and "no answer" in content["error"]


def test_an_fmu_that_hangs_ends_a_comparison(tmp_path: Path):
    """No reference can be made either; the runs that were made are kept."""
    out, clock = tmp_path / "out", monotonic()
    masters = ["--masters", "jacobi,gauss_seidel", "--timeout", 1]
    done = launched("compare", hanging(tmp_path), "--out", out, "--no-pictures", *masters)
    assert done.returncode == 3 and monotonic() - clock < 50.0, done.stderr
    assert done.stderr.count("no answer within 1 s") == 3 and f"results so far in {out}" in done.stdout
    for master in ("jacobi", "gauss_seidel"):
        table = read_table(next(out.glob(f"{master}*")) / "results.csv")
        assert table["time"] == pytest.approx([0.0, 0.05, 0.1])
    assert manifest(out)["complete"] is False
