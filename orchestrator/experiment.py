"""A scenario carried out: the coupled run, the reference, their comparison, and the files of each."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np

from fmus.variables import ModuleError
from orchestrator import audit, landing, library, monolithic, vocabulary
from orchestrator.compare import (
    Comparison,
    Reference,
    Run,
    communication_times,
    largest_difference,
    signal_errors,
)
from orchestrator.contract import BREAKS, check_variables
from orchestrator.errors import InputError, OrchestratorError, RunError, nearest
from orchestrator.estimate import factor, second
from orchestrator.fmu import Fmu, FmuError
from orchestrator.graph import Connection, Graph
from orchestrator.masters import MASTERS, Master, StepReport
from orchestrator.report import Record, draw_comparison, draw_run, run_label
from orchestrator.results import RunDirectory, Table
from orchestrator.scenario import DEFAULT_MASTER, Scenario
from orchestrator.simulation import Log, simulate
from orchestrator.sub_steps import check_steps, instance

LEFT_THE_GROOVE = 3
"""Value of a contact's `status` when the cable has left the groove."""
TIGHTER = 1e-2
"""The reference's tolerance by that of the runs, so that it does not show what their iterations leave."""
HOLDING = ("held", "point")
"""Exchanges in which our modules neither give nor take slopes and means."""
FIELD_UNITS = {"time": "s", "arc_length": "m", "position": "m", "tension": "N"}

Progress = Callable[[float], None]
"""Told the time (s) that a run has come to."""


@dataclass
class Coupled:
    """A finished coupled run: the log, and what it was made from.

    Attributes
    ----------
    table : signals at the communication points, ``time`` first
    fields : arrays over time as in ``fields.h5``; empty for a general graph
    fmus : file and SHA-256 of every component
    estimated_error : of the signals with a tolerance, in their units; empty where none was asked for, NaN where it failed
    estimate_failure : why it failed
    """

    scenario: Scenario
    exchange: str
    log: Log
    table: Table
    fields: dict[str, np.ndarray]
    fmus: dict[str, dict[str, str]]
    estimated_error: dict[str, float] = field(default_factory=dict)
    estimate_failure: str = ""

    @property
    def steps_table(self) -> Table:
        """One row a macro step: what the master needed and reached."""
        steps = self.log.steps
        names = (
            "time",
            "iterations",
            "residual",
            "subdivisions",
            "rejected",
            "columns",
            "converged",
            "estimate",
            "power_residual",
        )
        table = {name: np.array([getattr(step, name) for step in steps]) for name in names}
        return table | {f"power_residual.{name}": values for name, values in self.log.power_residual.items()}

    @property
    def master(self) -> str:
        """The master by its name."""
        return self.scenario.simulation.master

    @property
    def exchange_asked(self) -> str:
        """The exchange that was asked for; cable and robot of a landing may not have what it needs."""
        return exchange_of(self.scenario) if self.scenario.is_landing else self.exchange

    @property
    def label(self) -> str:
        """Master and macro step, as folders are called."""
        return run_label(self.master, self.log.macro_step)

    @property
    def record(self) -> Record:
        """What the pictures are drawn from."""
        return Record(self.master, self.log.macro_step, self.table, self.steps_table, self.fields)

    @property
    def energy(self) -> audit.Audit | None:
        """The energy audit; None where a component does not show its energy."""
        return audit.of_coupled(self.table, self.scenario.simulation.tolerances.values())

    @property
    def fallen(self) -> list[str]:
        """The contacts that the cable has left."""
        return [
            name.removesuffix(".status")
            for name, values in self.table.items()
            if name.startswith("contact") and name.endswith(".status") and np.any(values == LEFT_THE_GROOVE)
        ]


def exchange_of(scenario: Scenario) -> str:
    """Return the exchange within a macro step: the scenario's, else what suits the master."""
    implicit = MASTERS[scenario.simulation.master].IMPLICIT
    return scenario.simulation.exchange or ("waveform" if implicit else "point")


@contextmanager
def opened(scenario: Scenario) -> Iterator[Graph]:
    """Give the scenario's graph of loaded FMUs; `InputError` if it cannot be made."""
    try:
        _require_contract(scenario)
        graph = landing.graph(scenario, exchange_of(scenario)) if scenario.is_landing else _general_graph(scenario)
        check_steps(graph.components, scenario.simulation.macro_step)  # type: ignore[arg-type]
    except (ModuleError, ValueError) as error:
        raise InputError(f"{scenario.path}: {line}" for line in str(error).splitlines()) from None
    except FmuError as error:
        raise RunError(str(error), error.time) from None
    try:
        yield graph
    finally:
        graph.close()


def _require_contract(scenario: Scenario) -> None:
    """Hold the foreign FMUs of a landing against their contracts."""
    sections = {"cable": scenario.cable, "robot": scenario.robot, "contact": scenario.contact}
    for kind, section in sections.items() if scenario.is_landing else ():
        if section is None or section.fmu is None:
            continue
        findings = check_variables(kind, vocabulary.of_fmu(Path(section.fmu)))
        lines = [f"{kind}.fmu: {f.what} is {f.verdict}: {f.note}" for f in findings if f.verdict in BREAKS]
        if lines:
            raise ValueError("\n".join([*lines, f"`orchestrator check {section.fmu}` shows the whole contract"]))


def _general_graph(scenario: Scenario) -> Graph:
    components: dict[str, Fmu] = {}
    try:
        for name, section in scenario.components.items():
            file = section.fmu or library.module_fmu(str(section.model))
            components[name] = instance(file, name, section.steps)
            own = _own_exchange(section.model, exchange_of(scenario))
            components[name].set_parameters({**own, **section.parameters, **section.inputs})
        connections = [_connection(text) for text in scenario.connections]
        holding = {name for name, fmu in components.items() if fmu.exchange in HOLDING}
        return Graph(components, [c for c in connections if not _serves_an_interval(c, holding)])
    except BaseException:
        for fmu in components.values():
            fmu.close()
        raise


def _own_exchange(model: str | None, exchange: str) -> dict[str, str]:
    """Return the exchange as a parameter of our own `model`: nothing where it has none, its default where it has not
    this one."""
    known = vocabulary.of_module(model).get("exchange") if model is not None else None
    return {"exchange": exchange} if known is not None and exchange in known.choices else {}


def _serves_an_interval(connection: Connection, holding: Container[str]) -> bool:
    """Return whether slopes or means go to or from one of the components that are `holding` values at an instant."""
    ends = {signal.partition(".")[0] for signal in (connection.source, connection.target)}
    between = re.search(r"_(rate|mean)(\.[xyz])?$", connection.source)
    return between is not None and any(name in holding for name in ends)


def _connection(text: str) -> Connection:
    source, arrow, target = (part.strip() for part in text.partition("->"))
    if not (source and arrow and target):
        raise ValueError(f'connections: {text!r} is not of the form "a.x -> b.u"')
    return Connection(source, target)


class Interruption(FmuError):
    """Ctrl-C: ends a run at a communication point, so that its results so far are kept."""

    def __init__(self, time: float):
        super().__init__("run", time, 0, "interrupted")

    def __str__(self) -> str:
        return f"interrupted at t = {self.time:g} s"


@contextmanager
def interruptible() -> Iterator[Callable[[float], None]]:
    """Give what a run calls at each communication point; it raises `Interruption` after Ctrl-C.

    A second Ctrl-C ends the program at once.
    """
    asked: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def ask(number: int, _: Any) -> None:
        asked.append(number)
        signal.signal(signal.SIGINT, before)

    def check(time: float) -> None:
        if asked:
            raise Interruption(time)

    signal.signal(signal.SIGINT, ask)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)


def run(scenario: Scenario, progress: Progress = lambda _: None) -> Coupled:
    """Run the scenario coupled. A failure in mid-run does not raise: `log.error` says it."""
    with opened(scenario) as graph:
        log = _simulated(scenario, graph, progress)
        fmus = {n: {"file": str(f.path), "sha256": f.sha256} for n, f in graph.components.items()}
        exchange = next((fmu.exchange for fmu in graph.components.values() if fmu.exchange), "")
    if log.error is not None and len(log.time) < 2:
        raise RunError(str(log.error), 0.0)
    fields, table = split_fields(scenario, {"time": log.time, **dict(zip(log.signals, log.values.T, strict=True))})
    return Coupled(scenario, exchange, log, table, fields, fmus)


def estimate(coupled: Coupled, progress: Progress = lambda _: None) -> Coupled | None:
    """Estimate the error of a finished run by a second one, and note it in `coupled`; a failure is noted, not raised.

    Returns
    -------
    Coupled or None
        the second run; None where there is none, or it failed
    """
    scenario = coupled.scenario
    again = second(scenario) if coupled.log.error is None else None
    if again is None:
        return None
    signals = [name for name in scenario.simulation.tolerances if name in coupled.table]
    coupled.estimated_error = dict.fromkeys(signals, float("nan"))
    try:
        other = _completed(again, progress)
    except OrchestratorError as error:
        coupled.estimate_failure = str(error)
        return None
    coarse, fine = sorted((coupled.table, other.table), key=lambda table: len(table["time"]))
    difference, by = largest_difference(coarse, fine), factor(scenario, coupled.exchange)
    coupled.estimated_error = {name: by * difference[name] for name in signals}
    return other


def _simulated(scenario: Scenario, graph: Graph, progress: Progress) -> Log:
    simulation = scenario.simulation
    with interruptible() as check:

        def on_step(report: StepReport) -> None:
            progress(report.time)
            check(report.time)

        master = master_of(scenario, graph)
        try:
            times = 0.0, simulation.stop_time, simulation.macro_step
            return simulate(graph, master, *times, recorded(graph), on_step, simulation.timeout)
        except (ValueError, TypeError) as error:
            raise InputError(f"{scenario.path}: {error}") from None
        except FmuError as error:
            raise RunError(str(error), error.time) from None


def master_of(scenario: Scenario, graph: Graph) -> Master:
    """Return the scenario's master for `graph`; `InputError` if it cannot couple these FMUs."""
    known = recorded(graph)
    missing = [name for name in scenario.simulation.tolerances if name not in known]
    if missing:
        raise InputError(
            f"{scenario.path}: simulation.tolerances.{n}: no such signal{nearest(n, known)}" for n in missing
        )
    try:
        return MASTERS[scenario.simulation.master](graph, **scenario.master)
    except (ValueError, TypeError) as error:
        raise InputError(f"{scenario.path}: {error}") from None


def recorded(graph: Graph) -> list[str]:
    """Return the signals worth keeping: outputs, without unused ports and what only serves the coupling."""
    contacts = sum(name.startswith("contact") for name in graph.components)
    return [
        f"{component}.{name}"
        for component, fmu in graph.components.items()
        for name, port in fmu.ports.items()
        if port.causality == "output" and port.is_number and not _only_couples(name, contacts)
    ]


def _only_couples(name: str, contacts: int) -> bool:
    """Whether an output is that of an unused port, or a mean or rate that only serves the coupling."""
    unused = re.match(r"(?:port|wheel)\[(\d+)\]", name)
    return bool(
        re.search(r"_(mean|rate)\.[xyz]$|\.rotation(_mean)?\.[xyz]$", name)
        or (unused and 0 < contacts < int(unused[1]))
    )


def split_fields(scenario: Scenario, table: Table) -> tuple[dict[str, np.ndarray], Table]:
    """Return the cable's shape and tension over time as arrays, and the table without them."""
    rest = {name: values for name, values in table.items() if not name.startswith("cable.shape[")}
    return landing.cable_fields(scenario, table) if scenario.is_landing else {}, rest


def reference(scenario: Scenario, macro_steps: Iterable[float], progress: Progress = lambda _: None) -> Reference:
    """Return the reference at the communication points of all `macro_steps`."""
    steps = list(macro_steps)
    if scenario.is_landing and landing.has_monolithic(scenario):
        return _monolithic_reference(scenario, communication_times(scenario.simulation.stop_time, steps), progress)
    return _fine_reference(scenario, steps, progress)


def _monolithic_reference(scenario: Scenario, times: np.ndarray, progress: Progress) -> Reference:
    try:
        solution = monolithic.solve(lambda: landing.problem(scenario), times, progress=progress)
    except ModuleError as error:
        raise RunError(str(error)) from None
    fields, table = split_fields(scenario, {"time": times, **solution.signals})
    contacts = sum(name.endswith(".normal_force") for name in table)
    table = {name: values for name, values in table.items() if not _only_couples(name.partition(".")[2], contacts)}
    estimates = {name: solution.estimated_error[name] for name in table if name != "time"}
    return Reference("monolithic", table, solution.wall_s, estimates, fields)


def _fine_reference(scenario: Scenario, macro_steps: list[float], progress: Progress) -> Reference:
    """Return the same graph at a much smaller macro step; its error is taken from one twice as large."""
    common = common_divisor(macro_steps)
    try:
        fine, coarse = (_completed(_accurate(scenario, common / n), progress) for n in (8, 4))
    except RunError:  # an FMU cannot go back: the master that was asked for has to do
        fine, coarse = (_completed(scenario.changed(macro_step=common / n), progress) for n in (8, 4))
    kind = f"coupled, {fine.master}, macro step {fine.log.macro_step:g} s"
    return Reference(kind, fine.table, fine.log.wall, dict(largest_difference(coarse.table, fine.table)))


def _accurate(scenario: Scenario, macro_step: float) -> Scenario:
    """Return the scenario at `macro_step` (s) with an implicit master, its own if it has one, and a tight tolerance."""
    own = MASTERS[scenario.simulation.master].IMPLICIT
    name, options = (scenario.simulation.master, dict(scenario.master)) if own else (DEFAULT_MASTER, {})
    tolerance = options.get("tolerance", vocabulary.masters()[name]["tolerance"])
    return scenario.changed(options | {"tolerance": TIGHTER * tolerance}, master=name, macro_step=macro_step)


def _completed(scenario: Scenario, progress: Progress) -> Coupled:
    try:
        coupled = run(scenario, progress)
    except InputError as error:  # an FMU that cannot be stepped so finely
        raise RunError(f"no run with a macro step of {scenario.simulation.macro_step:g} s: {error}") from None
    if coupled.log.error is not None:
        raise RunError(str(coupled.log.error), coupled.log.error.time)
    return coupled


def common_divisor(steps: Iterable[float]) -> float:
    """Return the largest step of which all `steps` are multiples, to nine digits."""
    fractions = [Fraction(step).limit_denominator(10**9) for step in steps]
    denominator = reduce(lambda a, b: a * b // gcd(a, b), (f.denominator for f in fractions))
    return reduce(gcd, (int(f * denominator) for f in fractions)) / denominator


def held_against(coupled: Coupled, reference: Reference) -> Run:
    """Return the errors and the cost of one coupled run."""
    log = coupled.log
    return Run(
        master=coupled.master,
        macro_step=log.macro_step,
        steps=len(log.steps),
        iterations_per_step=log.iterations_per_step,
        unconverged_steps=log.unconverged,
        cable_steps=log.solves.get("cable", max(log.solves.values(), default=0)),
        wall_s=log.wall,
        signals=signal_errors(coupled.table, reference.table),
    )


def summary(coupled: Coupled) -> dict[str, Any]:
    """Return what ``summary.json`` holds: cost, convergence, extremes of the signals, interface work."""
    log, scenario = coupled.log, coupled.scenario
    simulated = float(log.time[-1] - log.time[0])
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "stiffness_set": scenario.cable.stiffness_set if scenario.cable else None,
        "robot": scenario.robot.model or scenario.robot.fmu if scenario.robot else None,
        "master": coupled.master,
        "exchange": coupled.exchange or None,
        "macro_step": log.macro_step,
        "simulated_s": simulated,
        "wall_s": log.wall,
        "wall_per_simulated_s": log.wall / simulated if simulated > 0.0 else None,
        "wall_components_s": log.wall_components,
        "steps": len(log.steps),
        "solves": log.solves,
        "iterations_per_step": log.iterations_per_step,
        "unconverged_steps": log.unconverged,
        "left_the_groove": coupled.fallen,
        "energy": energy_content(coupled),
        "interface_work_J": {name: float(work[-1]) for name, work in log.energy.items()},
        "energy_residual_J": {name: float(np.max(np.abs(r))) for name, r in log.energy_residual.items()},
        "estimated_error": coupled.estimated_error,
        "interface_balance": landing.interface_balance(coupled.table, log.energy),
        "extremes": {n: _extremes(log.time, values) for n, values in coupled.table.items() if n != "time"},
    }


def energy_content(coupled: Coupled) -> dict[str, Any]:
    """Return what ``summary.json`` says of the energy."""
    if coupled.energy is not None:
        return coupled.energy.content()
    return {"verdict": None, "missing": audit.missing(coupled.table)} if coupled.scenario.is_landing else {}


def _extremes(time: np.ndarray, values: np.ndarray) -> dict[str, float]:
    low, high = int(np.argmin(values)), int(np.argmax(values))
    pairs = {
        "start": values[0],
        "end": values[-1],
        "min": values[low],
        "min_time": time[low],
        "max": values[high],
    }
    return {name: float(value) for name, value in {**pairs, "max_time": time[high]}.items()}


def write(directory: RunDirectory, coupled: Coupled, reference: Reference | None = None) -> None:
    """Write all files of a coupled run, the manifest last; an interrupted run is marked as incomplete."""
    directory.write_table("results.csv", coupled.table)
    directory.write_table("iterations.csv", coupled.steps_table)
    if coupled.fields:
        directory.write_fields("fields.h5", coupled.fields, FIELD_UNITS)
    directory.write_json("summary.json", summary(coupled))
    tolerances = coupled.scenario.simulation.tolerances
    draw_run(directory.path, coupled.record, reference.table if reference else None, tolerances)
    error = coupled.log.error
    directory.write_manifest(manifest(coupled.scenario, coupled.fmus), error=str(error) if error else None)


def manifest(scenario: Scenario, fmus: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run depends on: the resolved scenario, the source of each value, the FMUs."""
    return {
        "scenario": str(scenario.path),
        "resolved": scenario.model_dump(exclude_none=True),
        "provenance": dict(scenario.provenance),
        "fmus": fmus,
    }


def compared(runs: list[Coupled], reference: Reference) -> Comparison:
    """Hold all runs against the reference."""
    tolerance = runs[0].scenario.simulation.tolerances
    return Comparison(reference, [held_against(coupled, reference) for coupled in runs], dict(tolerance))


def write_runs(directory: RunDirectory, runs: list[Coupled], error: str) -> None:
    """Write the runs of a comparison that could not be finished, a directory each, then the manifest with `error`."""
    for coupled in runs:
        write(RunDirectory(directory.path / coupled.label), coupled)
    directory.write_manifest(manifest(runs[0].scenario, runs[0].fmus), error=error)


def write_comparison(directory: RunDirectory, comparison: Comparison, runs: list[Coupled]) -> None:
    """Write ``comparison.json``, the reference and one run directory for each run, then the manifest."""
    reference, failures = comparison.reference, [str(c.log.error) for c in runs if c.log.error]
    directory.write_table("reference.csv", reference.table)
    if reference.fields:
        directory.write_fields("reference.h5", reference.fields, FIELD_UNITS)
    for coupled in runs:
        write(RunDirectory(directory.path / coupled.label), coupled, reference)
    if comparison.reference_energy is not None:
        directory.write_json("reference.json", {"energy": comparison.reference_energy.content()})
    directory.write_json("comparison.json", comparison.content())
    draw_comparison(directory.path, comparison, [coupled.record for coupled in runs])
    error = "; ".join(failures) or None
    directory.write_manifest(manifest(runs[0].scenario, runs[0].fmus), error=error)
