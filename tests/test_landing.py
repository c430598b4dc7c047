"""A landing resolved once: what is read, what follows from it, what the second run and the variants share."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import FrozenInstanceError
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

import orchestrator
from fmus.robot.module import robot_table
from orchestrator.api import load_scenario
from orchestrator.catalogue import library
from orchestrator.catalogue.modules import of_fmu
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.coupling.errors import InputError
from orchestrator.landing.build import has_monolithic, problem
from orchestrator.landing.resolve import Landing, resolve
from orchestrator.runs import systems
from orchestrator.runs.components import opened
from orchestrator.runs.systems import GraphSystem, LandingSystem
from orchestrator.scenario.types import LandingScenario
from tests.fmus import build, described
from tests.scenarios import LANDING, OSCILLATOR, scenario

HYBRID = "hybrid_robot_2"
"""A robot of two wheels."""


@cache
def landing(robot: str | None = None, **settings: Any) -> Landing:
    made = load_scenario(LANDING, robot=robot, set={key.replace("__", "."): v for key, v in settings.items()}, stop=0.1)
    assert isinstance(made, LandingScenario)
    return resolve(made)


class Reads:
    """Counts how often TOML files are opened and model descriptions are parsed."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.counting = False
        sys.addaudithook(self._hook)  # it stays for the life of the process, so that there is one

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.counting and event == "open" and str(arguments[0]).endswith(".toml"):
            self.counts[Path(str(arguments[0])).name] += 1


READS = Reads()


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch) -> Iterator[Counter[str]]:
    """Give the counts of what is read inside, by file name."""
    read = fmpy.read_model_description

    def counting(path: str, *args: Any, **options: Any) -> Any:
        READS.counts[Path(path).name] += 1
        return read(path, *args, **options)

    monkeypatch.setattr(fmpy, "read_model_description", counting)
    READS.counts.clear()
    READS.counting = True
    try:
        yield READS.counts
    finally:
        READS.counting = False


SHORT = {"stop": 0.01, "macro_step": 0.005}


def test_a_run_reads_each_file_once(tmp_path: Path, monkeypatch):
    """Scenario, conductor, stiffness set, robot and FMUs, the second run of the error estimate included."""
    monkeypatch.setenv("LINE_LANDING_FMUS", str(tmp_path))  # FMUs at a place where no earlier test has read them
    with counted(monkeypatch) as counts:
        orchestrator.run(LANDING, robot=HYBRID, **SHORT)
    named = {LANDING.name, f"{HYBRID}.toml", "adams_si.toml", "jia2025_200m.toml"}
    assert len(counts) == 7 and named <= set(counts)
    assert max(counts.values()) == 1, counts


def test_a_foreign_robot_is_read_once(tmp_path: Path, monkeypatch):
    robot = tmp_path / "mine.fmu"
    robot.write_bytes(library.robot_fmu(load_robot(HYBRID)).read_bytes())
    with counted(monkeypatch) as counts:
        orchestrator.run(LANDING, robot=str(robot), **SHORT)
    assert counts["mine.fmu"] == 1 and max(counts.values()) == 1, counts


def test_a_comparison_reads_each_file_once(monkeypatch):
    """Two masters at two macro steps, and the reference."""
    with counted(monkeypatch) as counts:
        orchestrator.compare(OSCILLATOR, masters=["jacobi", "gauss_seidel"], macro_steps=[0.02, 0.01], stop=0.1)
    assert counts[OSCILLATOR.name] == 1 and max(counts.values()) == 1, counts


def test_a_file_that_changes_between_two_runs_is_read_again(tmp_path: Path):
    path = tmp_path / "mine.toml"
    for mass in (1.0, 2.0):
        path.write_text(f'extends = "{OSCILLATOR}"\n[components.left.parameters]\nmass = {mass}\n', encoding="utf-8")
        assert load_scenario(path).model_dump()["components"]["left"]["parameters"]["mass"] == mass


def test_an_fmu_that_changes_is_read_again(tmp_path: Path):
    """The content decides, not name, date or size."""
    path = tmp_path / "robot.fmu"
    for name in ("roll", "rock"):
        path.write_bytes(described(build("robot"), tmp_path, ('name="roll"', f'name="{name}"')).read_bytes())
        os.utime(path, (1e9, 1e9))
        assert name in of_fmu(path)


def test_a_landing_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        landing().cable = landing().robot


def test_parameters_by_hand():
    """The catalogue's values below the scenario's; what a wheel has goes to the contact."""
    spec, made = load_robot("fptlir"), landing(robot__parameters__mass=41.0, contact__parameters__stiffness=2e8)
    assert made.robot.module["mass"] == 41.0 and made.robot.settings["mass"] == 41.0
    assert made.robot.module["center_of_mass.z"] == spec.parameters["center_of_mass.z"]
    assert "center_of_mass.z" not in made.robot.settings  # the FMU of the catalogue has it
    assert made.contact.settings["wheel_radius"] == spec.contact_parameters["wheel_radius"]
    assert made.contact.settings["stiffness"] == 2e8
    assert made.robot.settings["initial.position.z"] == made.placement.initial["initial.position.z"]


@pytest.mark.parametrize(("robot", "n_wheels"), [(None, 1), (HYBRID, 2)])
def test_one_contact_a_wheel(robot: str | None, n_wheels: int):
    made = landing(robot)
    assert made.n_wheels == len(made.placement.arc_lengths) == len(problem(made).contacts) == n_wheels
    assert set(made.sources.variables["robot"]) == {v.name for v in robot_table(n_wheels).variables}


def test_fmus_and_modules_get_the_same_parameters():
    """What the graph's FMUs were given is what the modules of the monolithic problem hold."""
    made = landing(HYBRID)
    modules = problem(made)
    with opened(LandingSystem(made)) as graph:
        pairs = {"cable": modules.cable, "robot": modules.robot, "contact1": modules.contacts[0]}
        pairs |= {"contact2": modules.contacts[1]}
        for name, module in pairs.items():
            table, given = module.table, graph.components[name].parameters
            steps = (
                "integration_step",
                "exchange",
                "moving_port",
            )  # how it is stepped, which the monolithic solver does itself
            kept = {n: value for n, value in given.items() if n in table.index and n not in steps}
            assert kept and all(module.values[table.index[n]] == table[n].encode(v) for n, v in kept.items())


def test_the_length_found_for_a_sag_is_that_of_the_fields():
    """Between supports at 200 m a sag of 4 m takes a cable longer than the span by 8/3 f²/L = 0.21 m, less its stretch."""
    made = landing(cable__parameters__sag=4.0)
    length = made.placement.cable_length
    assert length != landing().placement.cable_length
    assert 199.5 < length < 200.0 + 8 / 3 * 4.0**2 / 200.0
    fields, _ = LandingSystem(made).split(shape_signals())
    assert fields["arc_length"][-1] == length


def shape_signals() -> dict[str, np.ndarray]:
    names = [v for v in landing().sources.variables["cable"] if v.startswith("shape[")]
    return {"time": np.zeros(1)} | {f"cable.{name}": np.zeros(1) for name in names}


def test_a_changed_landing_starts_alike():
    """Other steps and master: nothing is read or placed again."""
    one = landing()
    other = one.changed(one.scenario.changed(macro_step=0.0025, master="jacobi"))
    assert other.sources is one.sources and other.placement is one.placement
    assert (other.robot, other.cable, other.contact) == (one.robot, one.cable, one.contact)
    assert other.scenario.simulation.macro_step == 0.0025


def test_a_second_run_differs_in_its_inner_steps_alone():
    system = LandingSystem(landing(cable__parameters__integration_step=0.002))
    again = system.stepped(0.5)
    assert again.landing.cable.settings == {**system.landing.cable.settings, "integration_step": 0.001}
    assert again.landing.robot.settings == {**system.landing.robot.settings, "integration_step": 0.0005}
    assert again.landing.contact == system.landing.contact and again.landing.placement is system.landing.placement
    assert "integration_step" not in system.landing.robot.settings


def test_a_general_graph_is_a_system_too():
    system = systems.resolve(scenario(OSCILLATOR.stem))
    assert isinstance(system, GraphSystem) and system.exchange is None and system.problem() is None
    assert set(system.variables) == {"left", "right"} and "mass" in system.variables["left"]
    assert system.split({"time": np.zeros(1)}) == ({}, {"time": np.zeros(1)})


def test_a_robot_of_another_maker_is_looked_at_once_initialised():
    """It says by its outputs alone where its wheel is: what was found stays for graph, problem and second run."""
    made = landing(str(build("robot")))
    assert made.sources.mounts and set(made.sources.mounts) == {f"wheel[1].mount.{axis}" for axis in "xyz"}
    assert all(made.robot.module[name] == value for name, value in made.sources.mounts.items())
    assert not any(name in made.robot.settings for name in made.sources.mounts)
    assert not has_monolithic(made)


def test_an_fmu_that_is_no_robot_is_refused_with_the_file(tmp_path: Path):
    robot = described(build("robot"), tmp_path, ('name="body.position.z"', 'name="body.height"'))
    with pytest.raises(InputError, match=r"landing_200m_point9\.toml: robot\.fmu: .*body\.position"):
        landing(str(robot))
