"""A scenario carried out: the coupled run, the reference, their comparison, and the files of each."""

from __future__ import annotations

from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import StepReport
from orchestrator.coupling.run.interrupt import interruptible
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from orchestrator.runs.components import master_of, opened, recorded, split_fields
from orchestrator.runs.record import Coupled, Progress
from orchestrator.scenario.types import Scenario


def run_coupled(scenario: Scenario, progress: Progress = lambda _: None) -> Coupled:
    """Run the scenario coupled. A failure in mid-run does not raise: `log.error` says it."""
    with opened(scenario) as graph:
        log = _simulated(scenario, graph, progress)
        fmus = {n: {"file": str(f.path), "sha256": f.sha256} for n, f in graph.components.items()}
        exchange = next((fmu.exchange for fmu in graph.components.values() if fmu.exchange), "")
    if log.error is not None and len(log.time) < 2:
        raise RunError(str(log.error), 0.0)
    fields, table = split_fields(scenario, {"time": log.time, **dict(zip(log.signals, log.values.T, strict=True))})
    return Coupled(scenario, exchange, log, table, fields, fmus)


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


def completed(scenario: Scenario, progress: Progress) -> Coupled:
    try:
        coupled = run_coupled(scenario, progress)
    except InputError as error:  # an FMU that cannot be stepped so finely
        raise RunError(f"no run with a macro step of {scenario.simulation.macro_step:g} s: {error}") from None
    if coupled.log.error is not None:
        raise RunError(str(coupled.log.error), coupled.log.error.time)
    return coupled
