"""A scenario run coupled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import SIGNALLED, InputError, RunError, digits
from orchestrator.coupling.exchange import coarsest
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import FIXED, SHORTER, Fmu
from orchestrator.coupling.fmu.messages import Messages
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import StepReport
from orchestrator.coupling.run.interrupt import Interruption, interruptible
from orchestrator.coupling.run.interval import Interval
from orchestrator.coupling.run.log import Log, Recorder
from orchestrator.coupling.run.results import Table
from orchestrator.coupling.run.simulate import simulate
from orchestrator.landing import audit
from orchestrator.landing.flight import left_the_groove
from orchestrator.landing.intervals import LARGEST, SUMMED
from orchestrator.runs.components import master_of, opened, recorded
from orchestrator.runs.errors import Parts, judged, missed
from orchestrator.runs.going_on import going_on
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.types import Scenario

Reached = Callable[[float], None]
"""Told the time (s) that a run has come to."""


class Interrupted(RunError):
    """Ctrl-C, or another signal (`number`), in a run that serves another one."""

    def __init__(self, message: str, time: float, number: int):
        super().__init__(message, time)
        self.number, self.exit_status = number, SIGNALLED + number


@dataclass
class Coupled:
    """A scenario that was run coupled: the log, and what it was made from.

    Attributes
    ----------
    table : signals at the communication points, ``time`` first
    fields : arrays over time as in ``fields.h5``; empty for a general graph
    fmus : file and SHA-256 of every component, and whether it had a process of its own
    error_parts : estimated error of each signal judged; empty where no estimate was asked for
    estimate_failure : which parts of it failed, and why
    estimate_doubts : why no calibration speaks for it, a line each
    notes : what of the wiring its author may not expect, and who ended it before its time, a line each
    messages : of the FMUs that have said anything, by component
    stopped : number of the signal that has asked the process to end while the error was estimated; 0 if none has
    folder : where the run is written to as it goes on; None where it is not
    """

    system: System
    exchange: str
    log: Log
    table: Table
    fields: dict[str, np.ndarray]
    fmus: dict[str, dict[str, str | bool]]
    error_parts: dict[str, Parts] = field(default_factory=dict)
    estimate_failure: str = ""
    estimate_doubts: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    messages: Mapping[str, Messages] = field(default_factory=dict)
    stopped: int = 0
    folder: Path | None = None

    @property
    def estimated_error(self) -> dict[str, float]:
        """Estimated error by signal, in its unit: the sum of its parts, NaN where one is not known."""
        return {name: parts.total for name, parts in self.error_parts.items()}

    @property
    def judged(self) -> list[str]:
        """The signals whose error is estimated."""
        return judged(self.table, self.scenario.simulation.tolerances)

    @property
    def misses(self) -> list[str]:
        """The signals whose estimated error is larger than their tolerance allows."""
        return missed(self.error_parts, self.scenario.simulation.tolerances, self.table)

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self.system.scenario

    @cached_property
    def steps_table(self) -> Table:
        """One row a macro step: what the master needed and reached."""
        return self.log.steps_table

    @property
    def master(self) -> str:
        """The master by its name."""
        return self.scenario.simulation.master

    @property
    def energy(self) -> audit.Audit | None:
        """The energy audit; None where a component does not show its energy."""
        return audit.of_coupled(self.table, self.scenario.simulation.tolerances.values())

    @property
    def fallen(self) -> list[str]:
        """The contacts that the cable has left."""
        return left_the_groove(self.table)


def run_coupled(
    system: System | Scenario, progress: Reached = lambda _: None, directory: Path | None = None
) -> Coupled:
    """Run a system coupled; a scenario is resolved first. A failure in mid-run does not raise: `log.error` says it.

    Parameters
    ----------
    directory : in its folder ``unfinished`` the run is written as it goes on; None: nothing is written
    """
    if isinstance(system, Scenario):
        system = resolve(system)
    with opened(system) as graph:
        fmus = {name: _of_fmu(fmu) for name, fmu in graph.components.items()}
        exchange = coarsest(fmu.exchange for fmu in graph.components.values())
        notes = [*system.notes(graph), *_left_out(system.scenario)]
        about = _about(system.scenario, graph) | {"fmus": fmus, "exchange": exchange, "notes": notes}
        with nullcontext() if directory is None else going_on(directory, about) as folder:
            log = _simulated(system.scenario, graph, progress, folder)
            if log.error is not None and len(log.rows) < 2:
                raise _at_the_start(log.error)
        logs = {name: fmu.log for name, fmu in graph.components.items()}
    messages = {name: said for name, said in logs.items() if said.count}  # those of their end too
    fields, table = system.split(log.table)
    notes = [*notes, *([log.ended] if log.ended else [])]
    return Coupled(system, exchange, log, table, fields, fmus, notes=notes, messages=messages, folder=folder)


def _of_fmu(fmu: Fmu) -> dict[str, str | bool]:
    return {"file": str(fmu.path), "sha256": fmu.sha256, "isolated": fmu.limits is not None}


def _left_out(scenario: Scenario) -> list[str]:
    """Return what has to be known of results that do not have every communication point."""
    interval = scenario.simulation.output_interval
    if scenario.simulation.every == 1 or interval is None:
        return []
    what = "extremes, limits, energy and errors are those of these points, peak forces those of all macro steps"
    return [f"recorded is a point every {digits(interval)} s (output_interval): {what}; iterations.csv has all of them"]


def _at_the_start(error: FmuError) -> RunError:
    if isinstance(error, Interruption):
        return Interrupted(str(error), error.time, error.number)
    return RunError(str(error), 0.0)


def noted_of(scenario: Scenario) -> dict[str, Any]:
    """Return what has to be known of a scenario to have it again."""
    return {
        "scenario": str(scenario.path),
        "resolved": scenario.model_dump(exclude_none=True),
        "provenance": scenario.provenance,
        "scenario_notes": scenario.notes,
    }


def _about(scenario: Scenario, graph: Graph) -> dict[str, Any]:
    """Return what has to be known of a run that died, beside its rows."""
    recorder = Recorder(graph, recorded(graph, scenario))
    return noted_of(scenario) | {
        "master": scenario.simulation.master,
        "macro_step": scenario.simulation.macro_step,
        "every": scenario.simulation.every,
        "signals": recorder.signals,
        "units": recorder.units,
    }


def _simulated(scenario: Scenario, graph: Graph, progress: Reached, folder: Path | None) -> Log:
    simulation = scenario.simulation
    interval = Interval(simulation.every, LARGEST.fullmatch, SUMMED.fullmatch)
    with interruptible() as check:

        def on_step(report: StepReport) -> None:
            progress(report.time)
            check(report.time)

        master = master_of(scenario, graph)
        try:
            times = simulation.start_time, simulation.stop_time, simulation.macro_step
            wanted = recorded(graph, scenario)
            return simulate(graph, master, *times, wanted, on_step, simulation.timeout, folder, interval)
        except (ValueError, TypeError) as error:
            raise InputError(f"{scenario.path}: {error}") from None
        except FmuError as error:
            raise RunError(str(error), error.time) from None


def completed(system: System, progress: Reached, directory: Path | None = None) -> Coupled:
    """Run a system coupled to its end; a long one is kept in `directory`, if there is one, in the place of memory.

    `RunError` if it does not come there, without advice: the step is not the user's; `Interrupted` after Ctrl-C.
    """
    try:
        coupled = run_coupled(system, progress, directory)
    except InputError as error:  # an FMU that cannot be stepped so finely
        step = system.scenario.simulation.macro_step
        raise RunError(f"no run with a macro step of {digits(step)} s: {error}") from None
    except Interrupted:
        raise
    except RunError as error:
        raise _plain(error) from None
    if isinstance(coupled.log.error, Interruption):
        raise Interrupted(str(coupled.log.error), coupled.log.error.time, coupled.log.error.number)
    if coupled.log.error is not None:
        raise _plain(RunError(str(coupled.log.error), coupled.log.error.time))
    return coupled


def _plain(error: RunError) -> RunError:
    """Return `error` without the advice to change a step."""
    message = str(error)
    for advice in (SHORTER, FIXED):
        message = message.removesuffix(advice)
    return RunError(message, error.time)
