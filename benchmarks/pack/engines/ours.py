"""Our engine: masters that iterate, with energy-conjugate exchange, and masters that do not."""

from __future__ import annotations

from collections.abc import Iterator
from time import process_time

from benchmarks.pack.case import Case
from benchmarks.pack.engines.child import timed
from benchmarks.pack.engines.run import Run
from orchestrator.coupling import Interval, Log, simulate
from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.stepping.master import Master
from orchestrator.runs.components import master_of, opened
from orchestrator.scenario.types import Scenario

NAME, TITLE = "ours", "this project"
IMPLICIT = ("interface_jacobian", "iqn_ils")
EXPLICIT = ("gauss_seidel", "jacobi")
COUNTS = "do_step calls of the component, iterations, sub-divisions and pulse responses included"


def plan(case: Case) -> Iterator[tuple[str, float]]:
    """Yield masters and macro steps."""
    yield from ((master, step) for master in IMPLICIT for step in case.implicit)
    yield from ((master, step) for master in EXPLICIT for step in case.explicit)


def run(case: Case, master: str, macro_step: float, stop: float) -> Run:
    """Run a case to `stop` (s); a run of two steps goes before, which compiles and loads."""
    try:
        _simulated(case.scenario(master=master, macro_step=macro_step, stop=2.0 * macro_step), case, 1)
        scenario = case.scenario(master=master, macro_step=macro_step, stop=stop)
        (log, solves), cpu = timed(lambda: _simulated(scenario, case, case.every(macro_step)))
    except (InputError, RunError) as error:
        return Run(NAME, master, macro_step, {}, why=str(error))
    if log.error is not None:
        return Run(NAME, master, macro_step, {}, why=str(log.error))
    return Run(NAME, master, macro_step, dict(log.table), solves, cpu, log.unconverged)


def _simulated(scenario: Scenario, case: Case, every: int) -> tuple[tuple[Log, int], float]:
    """Return the log and the steps of the expensive component, and the CPU time of the loop, s."""
    simulation = scenario.simulation
    with opened(scenario) as graph:
        master = master_of(scenario, graph)
        begin = _begin(master)
        times = simulation.start_time, simulation.stop_time, simulation.macro_step
        log = simulate(graph, master, *times, list(case.signals), interval=Interval(every))
        cpu = process_time() - begin[0] if begin else 0.0
        return (log, graph.components[case.expensive].solves), cpu


def _begin(master: Master) -> list[float]:
    """Return a list that gets the CPU time at which `master` has started: all FMUs are initialised then."""
    begin: list[float] = []
    start = master.start

    def started(t: float) -> None:
        start(t)
        begin.append(process_time())

    master.start = started  # type: ignore[method-assign]
    return begin
