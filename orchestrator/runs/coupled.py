"""A scenario run coupled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from orchestrator.coupling.errors import InputError, RunError, digits
from orchestrator.coupling.exchange import coarsest
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import FIXED, SHORTER, Fmu
from orchestrator.coupling.fmu.messages import Messages
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import StepReport
from orchestrator.coupling.run.interrupt import Interruption, interruptible
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.results import Table
from orchestrator.coupling.run.simulate import simulate
from orchestrator.landing import audit
from orchestrator.landing.flight import left_the_groove
from orchestrator.runs.components import master_of, opened, recorded
from orchestrator.runs.errors import Parts, judged, missed
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.types import Scenario

OF_A_STEP = (
    "time", "iterations", "residual", "subdivisions", "rejected", "columns", "converged", "estimate", "power_residual",
)  # fmt: skip
"""What is kept of the report of a macro step."""
Reached = Callable[[float], None]
"""Told the time (s) that a run has come to."""


class Interrupted(RunError):
    """Ctrl-C in a run that serves another one."""


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
    notes : what of the wiring its author may not expect, and who ended it before its time, a line each
    messages : of the FMUs that have said anything, by component
    """

    system: System
    exchange: str
    log: Log
    table: Table
    fields: dict[str, np.ndarray]
    fmus: dict[str, dict[str, str | bool]]
    error_parts: dict[str, Parts] = field(default_factory=dict)
    estimate_failure: str = ""
    notes: list[str] = field(default_factory=list)
    messages: Mapping[str, Messages] = field(default_factory=dict)

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
        table = {name: np.array([getattr(step, name) for step in self.log.steps]) for name in OF_A_STEP}
        return table | {f"power_residual.{name}": values for name, values in self.log.power_residual.items()}

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


def run_coupled(system: System | Scenario, progress: Reached = lambda _: None) -> Coupled:
    """Run a system coupled; a scenario is resolved first. A failure in mid-run does not raise: `log.error` says it."""
    if isinstance(system, Scenario):
        system = resolve(system)
    with opened(system) as graph:
        log = _simulated(system.scenario, graph, progress)
        fmus = {name: _about(fmu) for name, fmu in graph.components.items()}
        exchange = coarsest(fmu.exchange for fmu in graph.components.values())
        notes = [*system.notes(graph), *([log.ended] if log.ended else [])]
        logs = {name: fmu.log for name, fmu in graph.components.items()}
    messages = {name: said for name, said in logs.items() if said.count}  # those of their end too
    if log.error is not None and len(log.time) < 2:
        raise RunError(str(log.error), 0.0)
    fields, table = system.split(log.table)
    return Coupled(system, exchange, log, table, fields, fmus, notes=notes, messages=messages)


def _about(fmu: Fmu) -> dict[str, str | bool]:
    return {"file": str(fmu.path), "sha256": fmu.sha256, "isolated": fmu.limits is not None}


def _simulated(scenario: Scenario, graph: Graph, progress: Reached) -> Log:
    simulation = scenario.simulation
    with interruptible() as check:

        def on_step(report: StepReport) -> None:
            progress(report.time)
            check(report.time)

        master = master_of(scenario, graph)
        try:
            times = simulation.start_time, simulation.stop_time, simulation.macro_step
            return simulate(graph, master, *times, recorded(graph, scenario), on_step, simulation.timeout)
        except (ValueError, TypeError) as error:
            raise InputError(f"{scenario.path}: {error}") from None
        except FmuError as error:
            raise RunError(str(error), error.time) from None


def completed(system: System, progress: Reached) -> Coupled:
    """Run a system coupled to its end.

    `RunError` if it does not come there, without advice: the step is not the user's; `Interrupted` after Ctrl-C.
    """
    try:
        coupled = run_coupled(system, progress)
    except InputError as error:  # an FMU that cannot be stepped so finely
        step = system.scenario.simulation.macro_step
        raise RunError(f"no run with a macro step of {digits(step)} s: {error}") from None
    except RunError as error:
        raise _plain(error) from None
    if isinstance(coupled.log.error, Interruption):
        raise Interrupted(str(coupled.log.error), coupled.log.error.time)
    if coupled.log.error is not None:
        raise _plain(RunError(str(coupled.log.error), coupled.log.error.time))
    return coupled


def _plain(error: RunError) -> RunError:
    """Return `error` without the advice to change a step."""
    message = str(error)
    for advice in (SHORTER, FIXED):
        message = message.removesuffix(advice)
    return RunError(message, error.time)
