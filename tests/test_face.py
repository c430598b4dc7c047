"""The FMU face and the build, with an oscillator: every kind of variable, a closed-form solution."""

from __future__ import annotations

import dataclasses
import gc
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from fmus.face.build import Target, build_fmu, ensure_all, ensure_fmu, plain, record, rename_imports
from fmus.module.recipe import FmuRecipe
from fmus.module.units import unit
from fmus.module.variables import ModuleError
from tests.fmi import Instance

TESTS = Path(__file__).resolve().parent

RECIPE = FmuRecipe("oscillator", "oscillator.module:Oscillator", "Damped oscillator", {"n_forces": 2}, {"damping": 0.3})
FATAL, DISCARD = 4, 2


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """Keep the FMUs' copies of their sources out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return build_fmu(RECIPE, tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module")
def folder(path):
    return fmpy.extract(str(path), str(path.parent / "unzipped"))


def closed_form(t, mass=1.0, damping=0.3, stiffness=4.0, x0=1.0):
    """Return the position of the free underdamped oscillator released at rest from `x0`."""
    decay = damping / (2 * mass)
    omega = math.sqrt(stiffness / mass - decay**2)
    return x0 * math.exp(-decay * t) * (math.cos(omega * t) + decay / omega * math.sin(omega * t))


# --- description -----------------------------------------------------------------------------------------


def test_fmpy_finds_no_problem(path):
    assert validate_fmu(str(path)) == []


def test_description_follows_the_table(folder):
    description = fmpy.read_model_description(folder)
    variables = {v.name: v for v in description.modelVariables}
    facts = {n: (v.type, v.variability, v.initial, v.unit, v.start) for n, v in variables.items()}
    assert facts["damping"] == ("Real", "fixed", "exact", "N.s/m", "0.3")
    assert facts["method"] == ("String", "fixed", "exact", None, "exact")
    assert facts["locked"] == ("Boolean", "fixed", "exact", None, "false")
    assert facts["offset"] == ("Real", "discrete", "exact", "m", "0.0")
    assert facts["acceleration"] == ("Real", "continuous", "calculated", "m/s2", None)
    assert facts["n_steps"] == ("Integer", "discrete", "calculated", None, None)
    depends = {u.variable.name: {v.name for v in u.dependencies} for u in description.outputs}
    assert depends["acceleration"] == {"force[1]", "force[2]", "offset"}
    assert depends["position"] == set()
    slave = description.coSimulation
    assert slave.canGetAndSetFMUstate and slave.canSerializeFMUstate
    assert slave.canHandleVariableCommunicationStepSize


@pytest.mark.parametrize(
    ("text", "expected"),
    [  # exponents by definition of the SI units
        ("1", {}),
        ("m/s", {"m": 1, "s": -1}),
        ("s/m", {"s": 1, "m": -1}),
        ("rad/s", {"rad": 1, "s": -1}),
        ("N/s", {"kg": 1, "m": 1, "s": -3}),
        ("N.m/s", {"kg": 1, "m": 2, "s": -3}),
        ("N.m2", {"kg": 1, "m": 3, "s": -2}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("Pa", {"kg": 1, "m": -1, "s": -2}),
        ("1/s", {"s": -1}),
        ("N/m^n", None),
    ],
)
def test_units_in_base_units(text, expected):
    found = unit(text)
    assert (None if found is None else found.exponents) == expected
    assert found is None or found.factor == 1


def test_declared_dependencies_cover_the_observed_ones(folder):
    with Instance(folder) as one:
        one.initialize()
        declared = {u.variable.name: {v.name for v in u.dependencies} for u in one.description.outputs}
        for name in one.names("input"):
            before = one.outputs()
            one.set(**{name: 0.25})
            after = one.outputs()
            assert all(name in declared[output] for output in after if after[output] != before[output])
            one.set(**{name: 0.0})


# --- running ---------------------------------------------------------------------------------------------


def test_runs_alone_in_fmpy(path):
    result = fmpy.simulate_fmu(str(path), stop_time=2.0, output_interval=0.05)
    expected = [closed_form(t) for t in result["time"]]
    # 40 exact steps: nothing but round-off
    assert np.abs(result["position"] - expected).max() < 1e-13


def test_every_kind_of_variable(folder):
    with Instance(folder, substeps=1, method="euler", mass=2.0) as one:
        assert (one.get("substeps"), one.get("method"), one.get("n_forces")) == (1, b"euler", 2)
        one.initialize()
        (row,) = one.run(0.0, 0.1, 1)
        velocity = 0.1 * (-4.0 * 1.0) / 2.0  # one semi-implicit Euler step by hand
        assert row["velocity"] == pytest.approx(velocity, rel=1e-15)
        assert row["position"] == pytest.approx(1.0 + 0.1 * velocity, rel=1e-15)
        assert (row["n_steps"], bool(row["moves_up"])) == (1, False)
    with Instance(folder, locked=True) as one:
        assert one.initialize().run(0.0, 0.1, 1)[0]["position"] == 1.0


def test_outputs_follow_inputs_without_a_step(folder):
    with Instance(folder, mass=2.0) as one:
        one.fmu.enterInitializationMode()
        one.set(**{"force[1]": 5.0})
        assert one.get("acceleration") == (5.0 - 4.0) / 2.0
        one.set(**{"force[2]": 1.0, "initial_position": 0.5})
        assert one.get("acceleration") == (6.0 - 2.0) / 2.0
        one.fmu.exitInitializationMode()
        one.set(**{"force[1]": 0.0})
        assert one.get("acceleration") == (1.0 - 2.0) / 2.0


# --- state -----------------------------------------------------------------------------------------------


def test_replay_is_bit_identical(folder):
    with Instance(folder) as one, Instance(folder, mass=7.0, method="euler") as other:
        one.initialize().run(0.0, 0.1, 3)
        one.set(**{"force[1]": 0.7})  # saved before the outputs have followed
        state = one.fmu.getFMUstate()
        data = one.fmu.serializeFMUstate(state)
        first = one.run(0.3, 0.05, 5)
        one.fmu.setFMUstate(state)
        assert one.run(0.3, 0.05, 5) == first
        one.fmu.setFMUstate(one.fmu.deSerializeFMUstate(data))
        assert one.run(0.3, 0.05, 5) == first
        other.initialize()  # other parameters: they come with the state
        other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(data))
        assert other.run(0.3, 0.05, 5) == first
        assert other.fmu.serializeFMUstate(other.fmu.getFMUstate()) == one.fmu.serializeFMUstate(one.fmu.getFMUstate())
        one.fmu.freeFMUstate(state)


def test_state_from_before_the_initialisation(folder):
    with Instance(folder) as one:
        state = one.fmu.getFMUstate()
        first = one.initialize().run(0.0, 0.1, 2)
        one.fmu.setFMUstate(state)
        one.set(initial_position=1.0)  # parameters may be set again
        assert one.initialize().run(0.0, 0.1, 2) == first


def test_discarded_step_changes_nothing(folder):
    with Instance(folder) as one, Instance(folder) as other:
        one.initialize().run(0.0, 0.1, 1)
        other.initialize().run(0.0, 0.1, 1)
        with pytest.raises(FMICallException) as caught:
            one.fmu.doStep(0.1, 2e3)
        assert caught.value.status == DISCARD
        status, message = one.messages[-1]
        assert status == DISCARD and "t = 0.1 s" in message and "100 %% too much" in message
        assert one.run(0.1, 0.1, 2) == other.run(0.1, 0.1, 2)


# --- errors: in a process of their own, since a mistake here is a crash of the interpreter ---------------

ERRORS = {
    "NaN parameter": ('one.set(mass=float("nan")); one.initialize()', FATAL, "mass: not a finite number"),
    "refused by the module": ("one.set(mass=-1.0); one.initialize()", FATAL, "100 %% of it must be positive"),
    "unforeseen": ("one.set(damping=-1.0); one.initialize()", FATAL, "ValueError: an unforeseen error"),
    "unknown choice": ('one.set(method="magic")', FATAL, "'magic' is not one of exact, euler"),
    "late parameter": ("one.initialize(); one.set(mass=3.0)", FATAL, "mass: parameters are fixed"),
    "output set": ("one.set(position=3.0)", FATAL, "position: an output cannot be set"),
    "no such variable": ("one.fmu.getReal([999])", FATAL, "not all of them are real"),
    "wrong type": ("one.fmu.getInteger([0])", FATAL, "not all of them are integer"),
    "step too early": ("one.fmu.doStep(0.0, 0.1)", DISCARD, "initialisation is not finished"),
    "no step": ("one.initialize(); one.fmu.doStep(0.0, 0.0)", DISCARD, "step must be positive"),
    "NaN input": (
        'one.initialize(); one.set(**{"force[1]": float("nan")}); one.fmu.doStep(0.0, 0.1)',
        DISCARD,
        "force[1], position, velocity and 1 more: not a finite number",
    ),
    "damaged state": (
        "one.fmu.setFMUstate(one.fmu.deSerializeFMUstate(one.fmu.serializeFMUstate(one.fmu.getFMUstate())[:-8]))",
        FATAL,
        "bytes are missing",
    ),
    "not a state": ('one.fmu.setFMUstate(one.fmu.deSerializeFMUstate(b"x" * 99))', FATAL, "not a state"),
}

PROBE = """
import sys
from tests.fmi import Instance
from fmpy.fmi1 import FMICallException
for line in sys.stdin.read().splitlines():
    with Instance(sys.argv[1]) as one:
        try:
            exec(line)
        except FMICallException as error:
            print(error.status, "|", *[text.replace(chr(10), " ") for _, text in one.messages])
        else:
            print("no error")
print("alive")
"""


def test_errors_reach_the_master_and_crash_nothing(folder):
    lines = "\n".join(code for code, _, _ in ERRORS.values())
    done = run_python(["-c", PROBE, folder], input=lines)
    assert done.returncode == 0, done.stderr
    *answers, last = done.stdout.splitlines()
    assert last == "alive" and len(answers) == len(ERRORS)
    for (name, (_, status, message)), answer in zip(ERRORS.items(), answers, strict=True):
        assert answer.startswith(f"{status} |") and message in answer, f"{name}: {answer}"


def test_outputs_that_cannot_be_calculated_are_nan(folder):
    with Instance(folder) as one:
        one.initialize().set(offset=2e3)
        assert math.isnan(one.get("position"))
        assert "the foot is out of reach" in one.messages[-1][1]
        one.set(offset=0.0)
        assert one.get("position") == 1.0


def test_many_instances(folder):
    for _ in range(30):  # pythonfmu releases the script's namespace at each instantiation
        with Instance(folder) as one:
            one.initialize().run(0.0, 0.1, 1)
    gc.collect()


# --- the build -------------------------------------------------------------------------------------------


def run_python(arguments, cwd=None, paths=(TESTS / "modules", TESTS.parent), **options):
    """Run Python in a process of its own with `paths` to import from."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, **options)


def test_same_input_same_bytes(path, tmp_path):
    assert build_fmu(RECIPE, tmp_path).read_bytes() == path.read_bytes()


def test_only_what_is_stale_is_built(path):
    before = path.stat().st_mtime_ns
    assert ensure_fmu(RECIPE, path.parent).stat().st_mtime_ns == before

    def is_stale(place, recipe):
        return not Target(recipe, place, record(recipe)).is_there

    assert not is_stale(path, RECIPE)
    assert is_stale(path, dataclasses.replace(RECIPE, start={"damping": 0.4}))
    assert is_stale(path.with_name("missing.fmu"), RECIPE)
    assert is_stale(Path(__file__), RECIPE)


def test_many_are_built_at_once(path, tmp_path):
    twice = ensure_all(plain(r, tmp_path) for r in (RECIPE, dataclasses.replace(RECIPE, name="twin"), RECIPE))
    assert [p.name for p in twice] == ["oscillator.fmu", "twin.fmu", "oscillator.fmu"]
    assert twice[0].read_bytes() == path.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["oscillator.fmu", "twin.fmu"]


def test_wrong_start_value_leaves_no_file(tmp_path):
    with pytest.raises(ModuleError, match=r"oscillator\.fmu was not built: mas: no such variable"):
        build_fmu(dataclasses.replace(RECIPE, start={"mas": 1.0}), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_runs_where_the_project_is_not_installed(path, tmp_path):
    command = "from fmpy.cli import main; raise SystemExit(main())"
    table = tmp_path / "result.csv"
    done = run_python(
        ["-c", command, "simulate", path, "--stop-time=1", f"--output-file={table}"], tmp_path, [tmp_path]
    )
    assert done.returncode == 0, done.stderr
    result = np.genfromtxt(table, delimiter=",", names=True)
    assert result["position"][-1] == pytest.approx(closed_form(1.0), abs=1e-13)


def test_two_versions_in_one_process_run_their_own_code(folder, tmp_path):
    source = tmp_path / "source"
    for original in (TESTS.parent / "fmus", TESTS / "modules" / "oscillator"):
        shutil.copytree(original, source / original.name, ignore=shutil.ignore_patterns("__pycache__"))
    module = source / "oscillator" / "module.py"
    module.write_text(module.read_text().replace('"position": x,', '"position": 10.0 * x,'))
    assemble = ["-m", "fmus.face.build", "--assemble", tmp_path / "oscillator.fmu"]
    done = run_python(assemble, tmp_path, [source], input=json.dumps(RECIPE.as_dict()))
    assert done.returncode == 0, done.stderr
    changed = fmpy.extract(str(tmp_path / "oscillator.fmu"), str(tmp_path / "unzipped"))
    with Instance(folder) as one, Instance(changed) as other, Instance(folder) as third:
        rows = [each.initialize().run(0.0, 0.1, 2)[-1]["position"] for each in (one, other, third)]
    assert rows[0] == rows[2] == pytest.approx(closed_form(0.2), rel=1e-13)
    assert rows[1] == 10.0 * rows[0]


def test_imports_are_renamed():
    source = "from fmus.jit import kernel\nimport numpy as np\n    from fmus import jit\nimport fmusic\n"
    names = {"fmus": "fmus_0"}
    renamed = rename_imports(source.replace("    ", ""), names, Path("x.py"))
    assert renamed == "from fmus_0.jit import kernel\nimport numpy as np\nfrom fmus_0 import jit\nimport fmusic\n"
    with pytest.raises(ModuleError, match=r"x\.py, line 1"):
        rename_imports("import os, fmus.jit\n", names, Path("x.py"))
    with pytest.raises(ModuleError, match=r"x\.py, line 1"):
        rename_imports("import fmus.jit\n", names, Path("x.py"))
