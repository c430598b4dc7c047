"""One run of a batch: what it is of, by what it is known, and how a worker makes it.

A finished run is a folder named by a hash of all that its results hang on: the scenario as it is read, the files that it
names, the solver and its options, and the code. What was made once is found again, and a changed input is another run.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kernels.jit import VERSIONS, sources
from fmus.module.variables import ModuleError
from orchestrator.catalogue import documents
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.catalogue.shelf import is_file
from orchestrator.coupling.errors import InputError, RunError, nearest
from orchestrator.coupling.run.interrupt import Interruption
from orchestrator.coupling.run.results import Table, plain, read_json, read_table
from orchestrator.coupling.scratch import is_running
from orchestrator.landing import audit, monolithic
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.files import FIELD_UNITS
from orchestrator.runs.summary import NO_LANDING, extremes, result
from orchestrator.runs.systems import Fields, System, resolve
from orchestrator.runs.whatif import leave
from orchestrator.scenario.read import load
from orchestrator.scenario.settings import texts
from orchestrator.scenario.types import GraphScenario, LandingScenario, Scenario

CATALOGUE = Path(documents.__file__).parent
KEY_DIGITS = 16
Outcome = tuple[Table, Fields, dict[str, Any]]
"""Signals and fields that are kept, and the summary."""


@dataclass(frozen=True)
class Job:
    """A scenario with other values, and how it is solved.

    Attributes
    ----------
    scenario : path of a scenario file, or the name of a shipped one
    set : other values by their keys, as for `orchestrator.run`
    robot : another robot: a name of the catalogue, or a path; None: the scenario's
    solver : a key of `SOLVERS`
    interval : s between the times at which the monolithic solver shows its signals; half of it is its longest step
    tolerance : m, local error of the robot's position that a step of the monolithic solver may make
    estimate : whether the monolithic solver estimates its error, by a second run
    signals : names of those that are kept; empty: all but the cable's shape
    keep : whether signals are kept at all; without them a run is its summary
    extremes : signals of which the summary has to have start, end, least and largest value
    """

    scenario: str
    set: Mapping[str, Any] = field(default_factory=dict)
    robot: str | None = None
    solver: str = "monolithic"
    interval: float = 0.02
    tolerance: float = 1e-5
    estimate: bool = True
    signals: tuple[str, ...] = ()
    keep: bool = True
    extremes: tuple[str, ...] = ()

    def loaded(self) -> Scenario:
        """Return the scenario, read and checked; `InputError` says what is wrong with it."""
        if self.solver not in SOLVERS:
            known = ", ".join(SOLVERS)
            raise InputError(
                f"{self.scenario}: no solver {self.solver!r}{nearest(self.solver, SOLVERS)}; there are {known}"
            )
        return load(self.scenario, texts(self.set), self.robot)

    @cached_property
    def key(self) -> str:
        """The name of its folder: a hash of all that its results hang on."""
        scenario = self.loaded()
        options = asdict(self) | {"scenario": None, "set": None, "robot": None}
        content = {
            "resolved": scenario.model_dump(),
            "named": _named(scenario),
            "options": options,
            "code": code_version(),
        }
        text = json.dumps(plain(content), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


def _named(scenario: Scenario) -> dict[str, Any]:
    """Return what stands in the files that a scenario names: FMUs by their hashes, a robot by its numbers."""
    if isinstance(scenario, GraphScenario):
        return {name: _hash(section.fmu) for name, section in scenario.components.items() if section.fmu}
    sections = {"cable": scenario.cable, "robot": scenario.robot, "contact": scenario.contact}
    if scenario.controller is not None:
        sections["controller"] = scenario.controller
    found: dict[str, Any] = {name: _hash(section.fmu) for name, section in sections.items() if section.fmu}
    model = scenario.robot.model
    return found | ({"model": asdict(load_robot(model))} if model is not None and is_file(model) else {})


def _hash(file: str) -> str:
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); check the path") from None


@cache
def code_version() -> str:
    """Return a hash of the sources that a run goes through, of the catalogue, and of the libraries' versions."""
    digest = hashlib.sha256(VERSIONS.encode())
    for name, content in sorted(sources(__name__).items()):
        digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
    for path in sorted(CATALOGUE.rglob("*.toml")):
        digest.update(f"\0{path.relative_to(CATALOGUE)}\0".encode() + path.read_bytes())
    return digest.hexdigest()


# -- a finished run -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Done:
    """A run that a batch has made, or found.

    Attributes
    ----------
    directory : its folder; None where the run left nothing: it crashed, or hung
    failure : why there are no results, or why they end early; None where all went well
    """

    job: Job
    directory: Path | None
    failure: str | None = None

    @cached_property
    def table(self) -> Table:
        """The signals that were kept, ``time`` first; `RunError` where there are none."""
        if self.failure is not None or self.directory is None:
            raise RunError(f"{self.job.scenario}: {self.failure}")
        return read_table(self.directory / "results.csv")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """What ``summary.json`` holds; empty where the run left nothing."""
        return read_json(self.directory / "summary.json") if self.directory is not None else {}


def found(job: Job, store: Path) -> Done | None:
    """Return the finished run of `job` in `store`; None if it has not been made."""
    directory = store / job.key
    if not (directory / "manifest.json").is_file():
        return None
    return Done(job, directory, read_json(directory / "manifest.json")["error"])


def make(job: Job, store: Path) -> None:
    """Run `job` and put its folder into `store`, whole or not at all; a run that fails leaves a folder that says why."""
    start, scenario = time.process_time(), job.loaded()
    failure, table, fields, summary = None, {}, {}, {}
    try:
        table, fields, summary = SOLVERS[job.solver](job, scenario)
    except (InputError, ModuleError, RunError) as error:
        failure = str(error)
    with put(store, job.key) as directory:
        if table:
            directory.write_table("results.csv", table)
        if fields:
            directory.write_fields("fields.h5", fields, FIELD_UNITS)
        if failure is None and job.solver == "monolithic" and not job.signals:  # those with some are not looked at
            leave(directory, resolve(scenario), others=False)
        directory.write_json("summary.json", summary)
        directory.write_manifest(_manifest(job, scenario) | {"cpu_s": time.process_time() - start}, failure)


@contextmanager
def put(store: Path, key: str) -> Iterator[RunDirectory]:
    """Give a folder that is moved into place when it is whole, and removed when it does not come to that."""
    temporary = store / f".{key}.{os.getpid()}"
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        yield RunDirectory(temporary)
        _move(temporary, store / key)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def remove_half_done(store: Path) -> None:
    """Remove what runs have left in `store` whose process is no more: it was killed, or the disk was full."""
    for folder in store.glob(".*.*"):
        process = folder.suffix.removeprefix(".")
        if process.isdecimal() and not is_running(int(process)):
            shutil.rmtree(folder, ignore_errors=True)


def _manifest(job: Job, scenario: Scenario) -> dict[str, Any]:
    resolved = scenario.model_dump(exclude_none=True)
    return {"job": asdict(job), "scenario": str(scenario.path), "resolved": resolved, "code": code_version()}


def _move(temporary: Path, place: Path) -> None:
    """Move a folder into place; where another process was quicker, theirs stays."""
    try:
        os.replace(temporary, place)
    except OSError:
        if not (place / "manifest.json").is_file():
            raise
        shutil.rmtree(temporary, ignore_errors=True)


# -- solvers --------------------------------------------------------------------------------------------------


def _monolithic(job: Job, scenario: Scenario) -> Outcome:
    system = resolve(scenario)
    problem = system.problem()
    if problem is None:
        raise InputError(f'{scenario.path}: no monolithic solver for it; take solver = "coupled"')
    count = round(scenario.simulation.stop_time / job.interval)
    times = np.linspace(0.0, scenario.simulation.stop_time, max(count, 1) + 1)
    if job.signals or job.extremes:  # a name that is wrong is said before minutes are spent
        first = monolithic.solve(problem, times[:1], estimate=False).signals
        _known(job, (*job.signals, *job.extremes), {"time": times, **first})
    solution = monolithic.solve(problem, times, job.tolerance, job.estimate)
    table = {"time": times, **solution.signals}
    kept, fields, about = _kept(job, system, table), system.split(table)[0], system.about(table)
    judged = system.safety(table, fields, solution.estimated_error)
    energy = audit.of_coupled(table, scenario.simulation.tolerances.values())
    told = {*kept, *job.extremes}
    summary = {
        "solver": job.solver,
        "steps": solution.steps,
        "wall_s": solution.wall_s,
        "tolerance": solution.tolerance,
        "estimated_error": {name: value for name, value in solution.estimated_error.items() if name in told},
        "energy": energy.content() if energy is not None else None,
        **(judged.content() if judged is not None else NO_LANDING),
        "extremes": {name: extremes(times, table, name) for name in _known(job, job.extremes, table)},
        **({key: about[key] for key in ("mesh", "geometry")} if isinstance(scenario, LandingScenario) else {}),
    }
    return kept, _shapes(job, fields), summary


def _coupled(job: Job, scenario: Scenario) -> Outcome:
    coupled = run_coupled(resolve(scenario))
    if isinstance(coupled.log.error, Interruption):
        signal.raise_signal(coupled.log.error.number)
    if coupled.log.error is not None:
        raise RunError(str(coupled.log.error), coupled.log.error.time)
    _known(job, job.extremes, coupled.table)
    kept, fields = _kept(job, coupled.system, coupled.table), _shapes(job, coupled.fields)
    return kept, fields, {"solver": job.solver, **result(coupled).summary}


def _kept(job: Job, system: System, table: Table) -> Table:
    if not job.keep:
        return {}
    if not job.signals:
        return system.split(table)[1]
    return {name: table[name] for name in ("time", *_known(job, job.signals, table))}


def _shapes(job: Job, fields: Fields) -> Fields:
    """Return the shapes of the line where all signals are kept; they are what is largest."""
    return fields if job.keep and not job.signals else {}


def _known(job: Job, names: tuple[str, ...], table: Table) -> tuple[str, ...]:
    """Return `names`; `InputError` where one is no signal."""
    missing = [name for name in names if name not in table]
    if missing:
        raise InputError(f"{job.scenario}: no signal {missing[0]!r}{nearest(missing[0], table)}")
    return names


SOLVERS: dict[str, Callable[[Job, Scenario], Outcome]] = {"monolithic": _monolithic, "coupled": _coupled}
"""The monolithic solver, several times as quick; or the FMUs under the scenario's master."""
