"""A robot that `orchestrator new robot` writes: it builds, passes its trial, and lands as ours does."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from pythonfmu import FmuBuilder

from orchestrator.catalogue.library import robot_fmu
from orchestrator.catalogue.project import FOLDERS, class_name, variables, write_project
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.trial.dynamic import put_on_trial
from orchestrator.scenario.read import load
from tests.fmus import needs_compiler
from tests.robots_in_c import packed

COURSE = {
    "wheel[1].force.x": 30.0,
    "wheel[1].force.z": 500.0,
    "wheel[1].moment.y": 4.0,
    "wheel[1].force_rate.y": 900.0,
    "thrust": 50.0,
}
PER_STEP = 1e-12
"""Relative round-off of a step, generously: the same method in another order of operations."""


def in_python(folder: Path, n_wheels: int = 1) -> Path:
    """Write and build the project in Python."""
    project = write_project(folder / "py_robot", "python", n_wheels)
    options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "needsExecutionTool": False}
    return Path(FmuBuilder.build_FMU(str(project / "py_robot.py"), dest=str(project), **options))


@pytest.fixture(
    scope="module",
    params=["python", pytest.param("c", marks=needs_compiler), pytest.param("fmi3", marks=needs_compiler)],
)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of a project of each kind."""
    folder = tmp_path_factory.mktemp(request.param)
    return in_python(folder) if request.param == "python" else packed(write_project(folder / "c_robot", request.param))


def test_it_is_valid_and_passes_its_trial_whole(built: Path) -> None:
    assert validate_fmu(str(built)) == []
    trial = put_on_trial(built, "robot")
    assert trial.failure == "" and [row for row in trial.rows if row.verdict != "pass"] == []


def moved(path: Path, steps: int, H: float) -> dict[str, float]:
    """Return the outputs of a robot after some steps under steady loads and slopes."""
    with Fmu(path) as fmu:
        fmu.set_parameters(
            {"initial.position.z": 3.0, "initial.velocity.y": 0.4, "initial.pitch": 0.2, "initial.yaw": -0.7}
        )
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()
        group, outputs = fmu.group(list(COURSE)), [v.name for v in variables(1) if v.causality == "output"]
        group.values[:] = list(COURSE.values())
        for i in range(steps):
            group.set()
            fmu.step(i * H, H)
        shown = fmu.group(outputs)
        shown.get_finite()
        return dict(zip(outputs, shown.values.tolist(), strict=True))


def test_it_moves_as_ours_does(built: Path) -> None:
    """Runge-Kutta of order 4 in steps of 1 ms in both; means, of other quadratures of order 4, differ by H h^4."""
    steps, H = 60, 5e-3
    ours, theirs = (moved(path, steps, H) for path in (robot_fmu(load_robot("fptlir")), built))
    size = max(map(abs, ours.values()))
    for name, value in ours.items():
        assert theirs[name] == pytest.approx(
            value, abs=1e-9 if "_mean" in name or "rotation" in name else PER_STEP * steps * size
        )


@needs_compiler
def test_the_scenario_beside_it_is_in_order(tmp_path: Path) -> None:
    project = write_project(tmp_path / "c_robot", "c")
    packed(project)
    scenario = load(project / "landing.toml")
    assert Path(scenario.robot.fmu).name == "c_robot.fmu" and scenario.robot.model is None


@needs_compiler
@pytest.mark.slow
def test_it_lands_as_ours_does(tmp_path: Path) -> None:
    """To what the master's iteration leaves."""
    from orchestrator.runs.coupled import run_coupled

    project = write_project(tmp_path / "c_robot", "c")
    packed(project)
    options = ["simulation.stop_time=0.3"]
    ours, theirs = (
        run_coupled(load("scenarios/landing_200m_point9.toml", options)),
        run_coupled(load(project / "landing.toml", options)),
    )
    z, other = (run.table["robot.body.position.z"] for run in (ours, theirs))
    assert np.max(np.abs(z - other)) < 1e-9


@needs_compiler
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no CMake on this machine")
@pytest.mark.parametrize("kind", ["c", "fmi3"])
def test_cmake_builds_it(kind: str, tmp_path: Path) -> None:
    project = write_project(tmp_path / "c_robot", kind)
    for command in (["cmake", "-B", "build"], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=project, check=True, capture_output=True)
    with Fmu(project / "c_robot.fmu") as fmu:
        assert fmu.ports["wheel[1].force.x"].causality == "input"


@pytest.mark.skipif(shutil.which("make") is None or shutil.which("gcc") is None, reason="no make, no gcc")
def test_make_builds_it(tmp_path: Path) -> None:
    project = write_project(tmp_path / "c_robot", "c", 2)
    subprocess.run(["make"], cwd=project, check=True, capture_output=True)
    with Fmu(project / "c_robot.fmu") as fmu:
        assert "wheel[2].position_mean.z" in fmu.ports


@pytest.mark.parametrize("kind", ["python", "c", "fmi3"])
def test_no_word_of_the_template_is_left(kind: str, tmp_path: Path) -> None:
    project = write_project(tmp_path / "my_robot", kind, 4)
    words = [
        "NAME.",
        "CLASS",
        "FACE",
        "TITLE",
        "MOUNTS_PYTHON",
        "MOUNTS_C",
        "NUMBER_OF_WHEELS",
        "FMI_VERSION",
        "FMU_FILE",
        *FOLDERS["2.0"],
    ]
    for file in project.iterdir():
        text = file.read_text(encoding="utf-8")
        assert [word for word in words if word in text] == [], file
        assert all(len(line) <= 128 for line in text.splitlines() if file.suffix != ".xml"), file


@pytest.mark.parametrize(
    "name", ["3d", "a-b", "int", "class", "robot", "numpy", "ü", "", "a" * 61, "con", "COM1", ".."]
)
def test_names_that_no_compiler_takes_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        write_project(tmp_path / name if name else "")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("kept")
    with pytest.raises(InputError, match="exists already"):
        write_project(tmp_path / "mine")
    assert (tmp_path / "mine").read_text() == "kept"
    with pytest.raises(InputError, match="wheels"):
        write_project(tmp_path / "yours", n_wheels=5)


def test_a_class_is_not_named_as_its_module() -> None:
    assert class_name("my_robot") == "MyRobot" and class_name("Robo") == "RoboFmu"
