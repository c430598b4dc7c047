"""What of an FMU can be set beside inputs and fixed parameters: structural parameters, tunable ones; and what it writes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator.coupling import simulate
from orchestrator.coupling.course import Course
from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import SubStepped
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS
from tests.fmus import compiled, described, needs_compiler

pytestmark = needs_compiler
APART = pytest.mark.parametrize("isolate", [False, True], ids=["in our process", "in its own"])
SCENARIO = """
title = "arrays and tunables"
connections = ["a.y[3] -> b.u[1]"]
simulation = {{ stop_time = 1.0, macro_step = 0.1, master = "jacobi", estimate = "none" }}
components.a = {{ fmu = "{file}", parameters = {{ n = 4, "weight[3]" = 2.0 }}, inputs = {{ "u[3]" = 5.0, gain = {gain} }} }}
components.b = {{ fmu = "{file}"{more} }}
"""
TABLE = '{ time = [0.0, 0.35, 0.8], value = [1.0, 3.0, -1.0], interpolation = "step" }'


def written(folder: Path, gain: str = TABLE, more: str = "") -> Path:
    path = folder / "sized.toml"
    path.write_text(SCENARIO.format(file=compiled("sized3"), gain=gain, more=more), encoding="utf-8")
    return path


# -- structural parameters ----------------------------------------------------------------------------------------


@APART
@pytest.mark.parametrize("n", [1, 2, 8])
def test_arrays_are_as_long_as_asked_for(n: int, isolate: bool):
    """y = weight u, element by element; the FMU refuses calls of any other size."""
    with Fmu(compiled("sized3"), "a", isolate=isolate, structure={"n": n}) as fmu:
        assert [name for name in fmu.ports if name.startswith("y[")] == [f"y[{i + 1}]" for i in range(n)]
        fmu.set_parameters({"n": n} | {f"weight[{i + 1}]": float(i) for i in range(n)})
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()
        u, y = (fmu.group([f"{name}[{i + 1}]" for i in range(n)]) for name in "uy")
        u.values[:] = np.arange(n) + 1.0
        u.set()
        fmu.step(0.0, 0.1)
        y.get()
        assert np.array_equal(y.values, np.arange(n) * (np.arange(n) + 1.0)) and fmu.read("n") == n


def test_a_second_instance_and_sub_steps_have_them_too():
    for made in (
        Fmu(compiled("sized3"), structure={"n": 5}),
        SubStepped(compiled("sized3"), "a", 2, structure={"n": 5}),
    ):
        with made, made.twin() as twin:
            assert "y[5]" in twin.ports and twin.read("n") == made.read("n") == 5


@APART
def test_a_structure_that_the_fmu_refuses_is_said(isolate: bool):
    with pytest.raises(Exception, match=r"setting structural parameters came back with error"):
        Fmu(compiled("sized3"), "a", isolate=isolate, structure={"n": 9})


def test_what_is_no_structure_is_refused():
    with (
        Fmu(compiled("sized3"), "a") as fmu,
        pytest.raises(ValueError, match=r"structure = \{'n': 3\} when the instance"),
    ):
        fmu.set_parameters({"n": 3})
    for structure in ({"gain": 1}, {"m": 1}):
        with pytest.raises(ValueError, match="is no structural parameter"):
            Fmu(compiled("sized3"), "a", structure=structure)
    for n in (0, 10**9):
        with pytest.raises(ValueError, match=r"each is 1 at least|elements, more than"):
            Fmu(compiled("sized3"), "a", structure={"n": n})
    with pytest.raises(ValueError, match="is no structural parameter"):
        Fmu(compiled("lag2"), "a", structure={"gain": 1})


def test_a_scenario_sets_them_like_parameters(tmp_path: Path):
    run = orchestrator.run(written(tmp_path))
    assert (
        np.array_equal(run.table["a.y[3]"], np.full(11, 10.0)) and "a.y[4]" in run.table and "b.y[3]" not in run.table
    )
    assert np.allclose(run.table["b.y[1]"][1:], 10.0, rtol=0.0, atol=0.0)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("components.a.parameters.n=2", r"components\.a\.inputs\.u\[3\]: unknown key"),
        ("components.a.parameters.n=0", "each is 1 at least"),
        ("components.a.parameters.n=1.5", "is not of type integer"),
        ("components.a.parameters.n=1000000000", "elements, more than"),
        ("components.b.parameters.weight={ time = [0.0], value = [1.0] }", "unknown key"),
        ("components.a.parameters.gain={ time = [0.0], value = [1.0] }", "its table stands in inputs"),
        ("components.a.inputs.gain=2.0", "one value for it stands in parameters"),
        ('components.a.inputs.weight[1]={ time = [0.0], value = [1.0] }', "is no input; its causality is parameter"),
        ("components.a.inputs.n={ time = [0.0], value = [1] }", "is no input; its causality is parameter"),
    ],
)  # fmt: skip
def test_what_is_not_allowed_is_said(setting: str, message: str, tmp_path: Path):
    with pytest.raises(InputError, match=message):
        orchestrator.load_scenario(written(tmp_path), set=[setting])


def test_a_run_whose_structure_is_refused_ends_with_a_message(tmp_path: Path):
    with pytest.raises((InputError, RunError), match="setting structural parameters came back with error"):
        orchestrator.run(written(tmp_path), set=["components.a.parameters.n=9"])


# -- tunable parameters -----------------------------------------------------------------------------------------------


def by_hand(time: np.ndarray) -> np.ndarray:
    """x at the end of steps of 0.1 s with the gain of `TABLE` at the start of each: 1 to 0.4 s, 3 to 0.8 s, then -1."""
    gain = np.where(time[:-1] < 0.399, 1.0, np.where(time[:-1] < 0.799, 3.0, -1.0))
    return np.concatenate([[0.0], np.cumsum(0.1 * gain)])


def test_a_tunable_parameter_follows_a_table(tmp_path: Path):
    """What changes within a step takes effect at its end; it is recorded like an input over time."""
    run = orchestrator.run(written(tmp_path))
    assert run.table["a.x"] == pytest.approx(by_hand(run.time), abs=1e-12)
    assert run.table["b.x"] == pytest.approx(run.time, abs=1e-12) and run.table["a.gain"][[0, 4, 8]].tolist() == [
        1.0,
        3.0,
        -1.0,
    ]


@APART
@pytest.mark.parametrize("master", MASTERS)
def test_every_master_tunes_alike(master: str, isolate: bool):
    """Steps that are repeated have the value of their own start: the same numbers as without repetition."""
    course = Course([0.0, 0.35, 0.8], [1.0, 3.0, -1.0], "step")
    parts = {name: Fmu(compiled("sized3"), name, isolate=isolate) for name in "ab"}
    with Graph(parts, ["a.x -> b.u[1]", "b.x -> a.u[1]"], inputs={"a.gain": course}) as graph:
        log = simulate(graph, master, 0.0, 1.0, 0.1)
    log.raise_error()
    assert log.signal("a.x") == pytest.approx(by_hand(log.time), abs=1e-12)


def test_fmi_2_tunes_too(tmp_path: Path):
    """x' = gain u with u = 1: lag2 with its gain declared tunable; fixed it is refused."""
    course = Course([0.0, 0.35, 0.8], [1.0, 3.0, -1.0], "step")
    gain = 'name="gain" valueReference="3" causality="parameter" variability="fixed"'
    tunable = described(compiled("lag2"), tmp_path, (gain, gain.replace("fixed", "tunable")))
    with Graph({"a": Fmu(tunable, "a")}, [], inputs={"a.gain": course, "a.u": Course([0.0], [1.0])}) as graph:
        log = simulate(graph, "jacobi", 0.0, 1.0, 0.1)
    assert log.signal("a.y") == pytest.approx(by_hand(log.time), abs=1e-12)
    with Fmu(compiled("lag2"), "a") as fixed, pytest.raises(Exception, match="is no input but a fixed parameter"):
        Graph({"a": fixed}, [], inputs={"a.gain": course})


# -- what an FMU writes -----------------------------------------------------------------------------------------------


def with_resources(path: Path) -> Path:
    """Return the FMU that writes, with a file among its resources."""
    with zipfile.ZipFile(compiled("writer2")) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
        new.writestr("resources/starts", b"")
    return path


@APART
def test_what_one_instance_writes_no_other_sees(isolate: bool, tmp_path: Path):
    """Each finds its resources as they were shipped, in this run and the next; its own copy goes with it."""
    path = with_resources(tmp_path / "writer.fmu")
    for _ in range(2):
        with Fmu(path, "a", isolate=isolate) as a, Fmu(path, "b", isolate=isolate) as b:
            assert a.read("starts") == b.read("starts") == 1
            folders = [a.folder, b.folder]
            assert (a.folder / "resources" / "starts").read_bytes() == b"x" and a.folder != b.folder
        assert not any(folder.exists() for folder in folders)
