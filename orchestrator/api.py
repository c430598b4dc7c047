"""The Python interface to the whole: run a scenario, compare masters, read results.

The command line is a thin layer over it. Everything here can be had from `orchestrator` itself:

    import orchestrator

    run = orchestrator.run("landing_200m_point9", set={"robot.parameters.mass": 40.0}, stop=2.0)
    print(run.verdict, run["robot.roll"].unit, run["robot.roll"].values.max())
"""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.face.first_use import compile_modules
from fmus.kernels.jit import COMPILATION
from orchestrator.catalogue.documents import read_once
from orchestrator.coupling.errors import InputError, RunError, nearest
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.scratch import remove_left_overs
from orchestrator.coupling.signals import deferred, passed_on
from orchestrator.runs.compare import Comparison, compared
from orchestrator.runs.coupled import Interrupted, run_coupled
from orchestrator.runs.directory import RunDirectory, claimed
from orchestrator.runs.estimate import estimate_error
from orchestrator.runs.files import (
    NO_VIEWS,
    Views,
    load_comparison,
    load_run,
    write_comparison,
    write_run,
    write_unfinished,
)
from orchestrator.runs.recovered import write_recovered
from orchestrator.runs.result import Run, Signal, run_label
from orchestrator.runs.summary import result
from orchestrator.runs.systems import System, resolve
from orchestrator.runs.unfinished import is_unfinished, load_unfinished
from orchestrator.runs.whatif import leave
from orchestrator.scenario.layers import shared_options
from orchestrator.scenario.read import load
from orchestrator.scenario.settings import Set, texts
from orchestrator.scenario.types import LandingScenario, Scenario, ScenarioNote

if TYPE_CHECKING:
    from orchestrator.studies.sweep.result import Sweep

__all__ = [
    "Comparison",
    "InputError",
    "Run",
    "RunError",
    "Signal",
    "compare",
    "load_comparison",
    "load_run",
    "load_scenario",
    "load_unfinished",
    "run",
    "sweep",
]

Progress = Callable[[str, float, float], None]
"""Told at every communication point what is being done, the time it has come to, and the time it ends at, s."""
Out = Path | str | bool | None


class Unfinished(RunError):
    """A comparison that could not be finished; `runs` were made and are in `directory`."""

    def __init__(self, error: RunError, runs: Sequence[Run], directory: Path):
        super().__init__(str(error), error.time)
        self.runs, self.directory, self.exit_status = list(runs), directory, error.exit_status


def run(
    scenario: Scenario | Path | str,
    *,
    set: Set | None = None,
    robot: str | None = None,
    master: str | None = None,
    macro_step: float | None = None,
    stop: float | None = None,
    timeout: float | None = None,
    out: Out = None,
    estimate: str | None = None,
    progress: Progress | None = None,
    pictures: bool = True,
) -> Run:
    """Run a scenario coupled.

    Parameters
    ----------
    scenario : name of a shipped scenario, path of a scenario file, or one that `load_scenario` has returned
    set : other values by their keys, ``{"robot.parameters.mass": 12.0}``
    robot : another robot: a name of the catalogue, or the path of an FMU
    master : another master, by its name
    macro_step : another macro step, s
    stop : another stop time, s
    timeout : wall time that one step of an FMU may take, s
    out : directory to write the results to, which must not exist; True: ``runs/SCENARIO-NNN``; None: nothing is written
    estimate : by which second run the error is estimated: ``finer``, ``coarser`` or ``none``
    progress : told how far the run is
    pictures : whether pictures are drawn into the directory, and its page is made

    Returns
    -------
    Run
        signals, summary, verdict. A run that fails on its way does not raise: its `verdict` is then ``failed`` (after
        Ctrl-C ``interrupted``), its `error` says why, and its signals end where it did. SIGTERM and SIGHUP end it so, too;
        once its results are written they go on to who handles them, or end the process.

    Raises
    ------
    InputError : scenario or options are wrong, or `out` exists; nothing was run
    RunError : the run failed at its very start
    """
    with read_once():
        loaded = Changes(set, robot, master, macro_step, stop, timeout, estimate).of(scenario)
        with _directory(out, loaded.name) as directory:
            system = _ready(loaded)
            found = _run(system, progress or _silent, directory and directory.path)
            if directory is not None:
                with deferred(f"results so far in {directory.path}"):
                    leave(directory, system, others=pictures)
                    found = write_run(directory, found, _views(pictures))
            _end(found.summary["signal"], found.directory)
            return found


def compare(
    scenario: Scenario | Path | str,
    *,
    masters: Sequence[str] | None = None,
    macro_steps: Sequence[float] | None = None,
    set: Set | None = None,
    robot: str | None = None,
    master: str | None = None,
    macro_step: float | None = None,
    stop: float | None = None,
    timeout: float | None = None,
    out: Out = None,
    progress: Progress | None = None,
    pictures: bool = True,
) -> Comparison:
    """Run a scenario coupled and by a reference, the monolithic solver where there is one, and hold them together.

    Parameters
    ----------
    masters : names of the masters to compare; None: the scenario's
    macro_steps : macro steps to compare, s; None: the scenario's
    set, robot, master, macro_step, stop, timeout, out, progress, pictures : as for `run`

    Returns
    -------
    Comparison
        errors of all signals, verdict, observed orders, and the runs themselves

    Raises
    ------
    InputError : scenario or options are wrong, or `out` exists
    RunError : a run failed at its very start, or the reference did; the runs made so far are written if `out` is given
    """
    changes = Changes(set, robot, master, macro_step, stop, timeout)
    with read_once():
        first = changes.of(scenario)
        variants = _variants(scenario, first, changes, masters, macro_steps)
        with _directory(out, f"{first.name}-compare") as directory:
            views = _views(pictures)
            system = _ready(first)
            found = _compared(system, variants, progress or _silent, directory, views)
            if directory is None:
                return found
            with deferred(f"results in {directory.path}"):
                leave(directory, system, others=pictures)
                return write_comparison(directory, found, views)


def sweep(
    study: Path | str | Mapping[str, Any],
    *,
    out: Path | str | None = None,
    workers: int | None = None,
    timeout: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    dask: str | None = None,
) -> Sweep:
    """Run many landings in worker processes; what a sweep in `out` has made already is not made again.

    A script calls it under ``if __name__ == "__main__":``, because workers read the script, too.

    Parameters
    ----------
    study : path of a study file, name of a shipped one, or what would stand in the file
    out : its folder; None: ``runs/sweep-STUDY``
    workers : processes; None: one a processor
    timeout : s that a run may take; None: the study's
    progress : told how many runs are done, of how many, and how many failed
    dask : address of a Dask scheduler, whose workers make the runs; None: this machine does

    Raises
    ------
    InputError : the study is wrong, or `out` belongs to something else; nothing was run
    """
    from orchestrator.studies.sweep.result import run as run_all  # with what only studies need

    return run_all(study, out, workers, timeout, progress or (lambda done, of, failed: None), dask)


def report_of(directory: Path) -> Path:
    """Draw the pictures of a run or comparison anew, and return its page; of a sweep, the page alone.

    Of a run that has left no manifest all there is becomes files like those of one that has failed, with page and pictures;
    if it still goes on, in a folder of their own.

    Raises
    ------
    InputError : there are no results, or they are damaged
    """
    from orchestrator.report import page

    if is_unfinished(directory):
        return write_recovered(RunDirectory.of(directory), _views(True)) / page.NAME
    return page.report(directory)


def load_scenario(
    scenario: Path | str,
    *,
    set: Set | None = None,
    robot: str | None = None,
    master: str | None = None,
    macro_step: float | None = None,
    stop: float | None = None,
    timeout: float | None = None,
    estimate: str | None = None,
) -> Scenario:
    """Read and check a scenario, with other values as for `run`; `InputError` names all that is wrong with it."""
    with read_once():
        return Changes(set, robot, master, macro_step, stop, timeout, estimate).of(scenario)


@dataclass(frozen=True)
class Changes:
    """What is asked for in the place of a scenario's own values; parameters as for `run`."""

    set: Set | None = None
    robot: str | None = None
    master: str | None = None
    macro_step: float | None = None
    stop: float | None = None
    timeout: float | None = None
    estimate: str | None = None

    def of(self, scenario: Scenario | Path | str) -> Scenario:
        """Return the scenario with these changes."""
        if isinstance(scenario, Scenario):
            return self._on_loaded(scenario)
        loaded = load(scenario, [*texts(self._simulation), *texts(self.set or {})], self.robot, self.master)
        for note in loaded.notes:
            warnings.warn(note, ScenarioNote, stacklevel=2)
        return loaded

    @property
    def _simulation(self) -> dict[str, Any]:
        numbers = {"macro_step": self.macro_step, "stop_time": self.stop, "timeout": self.timeout}
        found: dict[str, Any] = {f"simulation.{key}": float(x) for key, x in numbers.items() if x is not None}
        return found | ({"simulation.estimate": self.estimate} if self.estimate is not None else {})

    def _on_loaded(self, scenario: Scenario) -> Scenario:
        if self.set or self.robot:
            raise InputError(f"{scenario.name}: is loaded already; give `set` and `robot` to load_scenario")
        simulation = {key.removeprefix("simulation."): value for key, value in self._simulation.items()}
        if self.master is None or self.master == scenario.simulation.master:
            return scenario.changed(**simulation)
        if self.master not in MASTERS:
            raise InputError(f"{scenario.name}: no master {self.master!r}{nearest(self.master, MASTERS)}")
        options = shared_options(scenario.master, self.master)
        return scenario.changed(options, exchange=None, master=self.master, **simulation)


def _ready(scenario: Scenario) -> System:
    """Return the scenario resolved; a landing's kernels are compiled before, which takes half the time side by side."""
    remove_left_overs()
    if isinstance(scenario, LandingScenario):
        compile_modules()
    return resolve(scenario)


def _variants(
    scenario: Scenario | Path | str,
    first: Scenario,
    changes: Changes,
    masters: Sequence[str] | None,
    macro_steps: Sequence[float] | None,
) -> list[Scenario]:
    """Return the scenario for every pair of master and macro step that is asked for, each pair once."""
    names = dict.fromkeys(masters or [first.simulation.master])
    steps = dict.fromkeys(macro_steps or [first.simulation.macro_step])
    return [replace(changes, master=name, macro_step=step).of(scenario) for name in names for step in steps]


def _compared(
    system: System, variants: Sequence[Scenario], progress: Progress, directory: RunDirectory | None, views: Views
) -> Comparison:
    from orchestrator.runs.reference import solve_reference  # with the kernels of the monolithic solver

    runs: list[Run] = []
    steps = sorted({variant.simulation.macro_step for variant in variants})
    try:
        for variant in variants:
            changed = system.changed(variant.master, **dict(variant.simulation))
            runs.append(_run(changed, progress, _place(directory, variant), estimate=False))
            if runs[-1].verdict == "interrupted":
                raise Interrupted(runs[-1].error or "", runs[-1].time[-1], runs[-1].summary["signal"])
        told = _told(progress, "reference", system.scenario)
        reference = solve_reference(system, steps, told)
        COMPILATION.conclude()
    except RunError as error:
        if runs and directory is not None:
            with deferred(f"results so far in {directory.path}"):
                write_unfinished(directory, runs, str(error), views)
            _end(getattr(error, "number", None), directory.path)
            raise Unfinished(error, runs, directory.path) from None
        _end(getattr(error, "number", None), None)
        raise
    return compared(runs, reference)


def _end(number: int | None, directory: Path | None) -> None:
    """Pass on a signal that asks this process to end, now that results are in `directory`; Ctrl-C has had its effect."""
    if number != signal.SIGINT:
        passed_on(number, f"results so far in {directory}" if directory is not None else "")


def _place(directory: RunDirectory | None, variant: Scenario) -> Path | None:
    """Return the folder of a run of a comparison."""
    if directory is None:
        return None
    return directory.path / run_label(variant.simulation.master, variant.simulation.macro_step)


def _run(system: System, progress: Progress, directory: Path | None, estimate: bool = True) -> Run:
    simulation = system.scenario.simulation
    label = run_label(simulation.master, simulation.macro_step)
    coupled = run_coupled(system, _told(progress, label, system.scenario), directory)
    if estimate:
        estimate_error(coupled, lambda part: _told(progress, f"error estimate: {part}", system.scenario))
    COMPILATION.conclude()
    return result(coupled)


def _told(progress: Progress, task: str, scenario: Scenario) -> Callable[[float], None]:
    return lambda time: progress(task, time, scenario.simulation.stop_time)


def _silent(task: str, time: float, stop: float) -> None:
    """Tell nobody."""


@contextmanager
def _directory(out: Out, name: str) -> Iterator[RunDirectory | None]:
    """Make the directory of the results, if there is to be one, before anything is run."""
    if out is None or out is False:
        yield None
        return
    with claimed(None if out is True else out, name) as directory:
        yield directory


def _views(pictures: bool) -> Views:
    return Views(_pictures, _page) if pictures else NO_VIEWS


def _pictures(directory: Path) -> None:
    from orchestrator.report import drawing  # a library for pictures that cannot be loaded costs the pictures alone

    drawing.draw(directory)


def _page(directory: Path, manifest: Mapping[str, Any]) -> None:
    from orchestrator.report import page

    page.write(directory, manifest)
