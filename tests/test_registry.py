"""The registry of modules: what its rows promise is so, and a module of another package is found and built."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from fmus.module import registry
from fmus.module.registry import MODULES, OURS, ModuleEntry, find, register
from fmus.module.variables import ModuleError
from orchestrator.landing.contract import check_variables, is_met

HERE = Path(__file__).parent
SWING = 'ModuleEntry("swing", "oscillator.module:Oscillator", "Damped oscillator", energy=("energy",))'
SCENARIO = """title = "One swing"
connections = []
[simulation]
stop_time = 0.1
macro_step = 0.05
master = "jacobi"
[components.one]
model = "swing"
parameters.mass = { value = 2.0, unit = "kg", source = "here" }
"""


@pytest.fixture
def installed(tmp_path):
    """The environment of a process in which two other packages are installed; the second one cannot be imported."""
    (tmp_path / "swings").mkdir()
    text = f"from fmus.module.registry import ModuleEntry\nSWING = {SWING}\nWRONG = 1\n"
    (tmp_path / "swings" / "__init__.py").write_text(text)
    (tmp_path / "broken.py").write_text("import no_such_package\n")
    facts = tmp_path / "swings-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: swings\nVersion: 1.0\n")
    points = "swing = swings:SWING\nwrong = swings:WRONG\nother = swings:SWING\nbroken = broken:ENTRY\n"
    (facts / "entry_points.txt").write_text(f"[line_landing.modules]\n{points}")
    path = os.pathsep.join([str(tmp_path), str(HERE / "modules")])
    return {**os.environ, "PYTHONPATH": path, "LINE_LANDING_FMUS": str(tmp_path / "fmus")}


def run(environment, *arguments, folder):
    return subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("key", OURS)
def test_a_row_says_what_is_there(key):
    """Its module bears its name, has a README, shows the energies it names, and meets its contract."""
    entry = find(key)
    module = entry.recipe().make_module()
    table = entry.table()
    assert module.NAME == key == entry.key == entry.recipe().name
    assert (Path(str(import_module(entry.factory.split(":")[0]).__file__)).parent / "README.md").is_file()
    assert all((table[name].causality, table[name].unit) == ("output", "J") for name in entry.energy)
    assert entry.contract is None or is_met(check_variables(entry.contract, {v.name: v for v in table.variables}))


def test_each_contract_is_met_by_one_of_ours():
    assert [registry.of_contract(contract).key for contract in ("cable", "robot", "contact")] == [
        "cable",
        "robot",
        "contact",
    ]


def test_arguments_decide_over_the_table():
    assert "wheel[2].force.x" in find("robot").table(n_wheels=2).index
    assert find("robot").recipe("mine", "My robot", {"n_wheels": 2}, {"mass": 3.0}).make_module().values[0] == 2


def test_a_registered_module_is_found_and_its_key_is_its_own(monkeypatch):
    monkeypatch.setattr(registry, "MODULES", dict(MODULES))
    entry = ModuleEntry("swing", "oscillator.module:Oscillator", "Damped oscillator")
    assert register(entry) == register(entry) == find("swing") and "swing" in registry.names()
    assert "stiffness" in find("swing").table(n_forces=2).index
    with pytest.raises(ModuleError, match=r"'cable' is fmus\.cable\.module:Cable already; choose another key"):
        register(ModuleEntry("cable", "oscillator.module:Oscillator", "Not a cable"))
    with pytest.raises(ModuleError, match="no module 'swig'; there are cable, contact"):
        find("swig")


def test_a_module_of_another_package_is_found_by_its_entry_point(installed, tmp_path):
    code = "from fmus.module.registry import find, names\n"
    code += "print(find('swing').description, sorted(set(names())))\n"
    done = run(installed, "-c", code, folder=tmp_path)
    names = ["broken", "cable", "contact", "oscillator", "other", "robot", "setdown", "swing", "wrong"]
    assert done.stdout.strip() == f"Damped oscillator {names}", done.stderr


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("broken", "cannot be imported: No module named 'no_such_package'; mend that package or remove it"),
        ("wrong", "is no ModuleEntry with the key 'wrong'"),
        ("other", "is no ModuleEntry with the key 'other'"),
    ],
)
def test_a_faulty_entry_point_is_named(installed, tmp_path, key, message):
    """By the one who asks for it; all others do not notice."""
    code = f"from fmus.module.registry import find\nfind('cable')\nfind({key!r})"
    done = run(installed, "-c", code, folder=tmp_path)
    assert done.returncode == 1 and f"module {key!r} (entry point " in done.stderr and message in done.stderr
    (tmp_path / "one.toml").write_text(SCENARIO.replace('"swing"', f'"{key}"'), encoding="utf-8")
    done = run(installed, "-m", "orchestrator", "validate", "one.toml", folder=tmp_path)
    assert done.returncode == 2 and "components.one.model" in done.stderr and "Traceback" not in done.stderr


def test_a_scenario_names_a_module_of_another_package(installed, tmp_path):
    """Its FMU is built from both packages, and runs."""
    (tmp_path / "one.toml").write_text(SCENARIO, encoding="utf-8")
    done = run(installed, "-m", "orchestrator", "validate", "one.toml", folder=tmp_path)
    assert done.returncode == 0 and "1 FMUs, 0 connections" in done.stdout, done.stderr
    (fmu,) = (tmp_path / "fmus").glob("swing*.fmu")
    (tmp_path / "one.toml").write_text(SCENARIO.replace("mass", "mas"), encoding="utf-8")
    done = run(installed, "-m", "orchestrator", "validate", "one.toml", folder=tmp_path)
    assert done.returncode == 2 and "unknown key; did you mean mass?" in done.stderr and fmu.is_file()
