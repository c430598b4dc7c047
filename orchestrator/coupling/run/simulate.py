"""Run a master over a graph at fixed macro steps and record."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from orchestrator.coupling.errors import digits
from orchestrator.coupling.fmu.binding import ROUNDING
from orchestrator.coupling.fmu.failure import TIMEOUT, FmuEnd, FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import check_steps
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import made_for
from orchestrator.coupling.run.log import Log, Recorder
from orchestrator.coupling.run.work import Work
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.steps import number_of

DIVIDES = 1e-9  # how far (stop - start)/macro_step may be from a whole number


def simulate(
    graph: Graph,
    master: Master | type[Master] | str,
    start: float,
    stop: float,
    macro_step: float,
    record: Sequence[str] | None = None,
    on_step: Callable[[StepReport], None] | None = None,
    timeout: float | None = None,
) -> Log:
    """Initialise the graph and advance it from `start` to `stop` in macro steps (s).

    Parameters
    ----------
    master : a master made for `graph`, ``IqnIls(graph, tolerance=1e-9)``; or its class or its name in `MASTERS`, with
        default options
    start, stop, macro_step : s; the macro step divides the time between them
    record : signals to record (numbers of any type), ``component.variable``; None: every output, and every input that follows
        a course over time, by its value at the communication points
    on_step : called after every macro step
    timeout : s of wall time that one call of an FMU may take. One in a process of its own that takes longer is ended.
        With others the run is made in a thread of its own; one that hangs is left behind in it, and the caller should end
        the process (`os._exit`) once the results are written.

    Returns
    -------
    Log
        signals with their units at the communication points. If an FMU failed its `error` is set, and it has all
        steps up to there; `Log.raise_error` raises it

    Raises
    ------
    ValueError
        if the macro step does not divide the time, does not suit an FMU's internal step, or a signal or a master of
        that name does not exist
    """
    n, macro_step = steps_between(start, stop, macro_step)
    check_steps(graph.components, macro_step)
    master, recorder = made_for(graph, master), Recorder(graph, record)
    time, values = start + macro_step * np.arange(n + 1), np.full((n + 1, len(recorder.signals)), np.nan)
    time[-1] = stop
    log = Log(master.NAME, macro_step, recorder.signals, time, values, units=recorder.units)
    simulation = _Simulation(graph, master, recorder, log, on_step)
    if timeout is None or _limited(graph, timeout):
        simulation(start, stop)
    else:
        _watched(simulation, start, stop, timeout)
    simulation.finish()
    return log


def steps_between(start: float, stop: float, H: float) -> tuple[int, float]:
    """Return the number of steps `H` from `start` to `stop` (s), and their length: `H`, or what its decimals are short for."""
    if not H > 0.0:
        raise ValueError(f"macro step {H:g} s: must be positive")
    if not stop > start:
        raise ValueError(f"stop time {digits(stop)} s: must be after the start at {digits(start)} s")
    n = number_of(stop - start, H)
    even, error = (stop - start) / n, abs(n * H - (stop - start)) / (stop - start)
    if error > DIVIDES:
        raise ValueError(f"macro step {digits(H)} s does not divide {digits(stop - start)} s; {digits(even)} s does")
    return n, H if error <= ROUNDING / 4 else even


class _Simulation:
    """One run, callable from a thread."""

    def __init__(
        self,
        graph: Graph,
        master: Master,
        recorder: Recorder,
        log: Log,
        on_step: Callable[[StepReport], None] | None,
    ):
        self.graph, self.master, self.recorder, self.log, self.on_step = graph, master, recorder, log, on_step
        self.rows, self.abandoned = 0, False
        self.failure: BaseException | None = None
        self.work = Work(graph)
        self.energy = np.zeros((log.time.size, len(self.work.names)))
        self.residual = np.zeros_like(self.energy)
        self.before = {name: (0.0, 0) for name in graph.components}  # wall and solves of the first macro step

    def __call__(self, start: float, stop: float) -> None:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # what diverges is found by its values
                self._initialize(start, stop)
                self._advance()
        except FmuError as error:
            if not self.abandoned:
                self.log.error = error
        except FmuEnd as end:
            self.log.ended = str(end)
        except BaseException as error:  # goes on in the caller's thread
            self.failure = error
        finally:
            self.master.finish()
            if self.work.names and self.work in self.graph.observers:
                self.graph.observers.remove(self.work)

    def _initialize(self, start: float, stop: float) -> None:
        self.graph.initialize(start, stop)
        self.master.start(start)
        if self.work.names:
            self.work.start()
            self.graph.observers.append(self.work)
            self.residual[0] = self.work.residual
        self.recorder.read(self.log.values[0], start)
        self.rows = 1

    def _advance(self) -> None:
        log, step, H = self.log, self.master.step, self.log.macro_step
        clock = perf_counter()
        for t in log.time[:-1].tolist():
            if self.abandoned:
                return
            report = step(t, H)
            if self.abandoned:  # it came back after all
                return
            self._note(report)
            if self.rows == 2:
                log.wall_first, clock = perf_counter() - clock, perf_counter()
                self.before = {name: (fmu.wall, fmu.solves) for name, fmu in self.graph.components.items()}
            log.wall = perf_counter() - clock
            for name, fmu in self.graph.components.items():
                if fmu.fmi.ends:
                    raise FmuEnd(name, report.time)

    def _note(self, report: StepReport) -> None:
        """Write the macro step that has just been made into the log."""
        log, row = self.log, self.rows
        self.recorder.read(log.values[row], float(log.time[row]))
        log.steps.append(report)
        if self.work.names:
            self.energy[row], self.residual[row] = self.work.total, self.work.residual
            report.power_residual = _largest(self.residual[row] - self.residual[row - 1]) / log.macro_step
        self.rows += 1
        if self.on_step is not None:
            self.on_step(report)

    def abandon(self) -> None:
        """Leave the run's thread to itself, and all FMUs to it: the call it waits for may return."""
        self.abandoned = True
        for fmu in self.graph.components.values():
            fmu.abandoned = True

    def finish(self) -> None:
        """Cut the log to what was reached; raise what was no failure of an FMU."""
        if self.failure is not None:
            raise self.failure
        log, n = self.log, self.rows
        log.time, log.values, log.steps = log.time[:n], log.values[:n], log.steps[: max(n - 1, 0)]
        log.energy = dict(zip(self.work.names, self.energy[:n].T, strict=True))
        booked = [i for i, name in enumerate(self.work.names) if not np.isnan(self.residual[:1, i]).any()]
        log.energy_residual = {self.work.names[i]: self.residual[:n, i] for i in booked}
        for name, fmu in self.graph.components.items():
            wall, solves = self.before[name]
            log.wall_components[name], log.solves[name] = fmu.wall - wall, fmu.solves - solves


def _largest(energies: np.ndarray) -> float:
    """Return the largest magnitude of those that are booked, nan if none is."""
    booked = energies[~np.isnan(energies)]
    return float(np.max(np.abs(booked))) if booked.size else np.nan


def _limited(graph: Graph, timeout: float) -> bool:
    """Limit the calls of those FMUs that have processes of their own; return whether all have."""
    for fmu in graph.components.values():
        fmu.limit(timeout)
    return all(fmu.limits for fmu in graph.components.values())


def _watched(simulation: _Simulation, start: float, stop: float, timeout: float) -> None:
    """Run in a thread; give up when one call of an FMU lasts longer than `timeout` (s)."""
    thread = threading.Thread(target=simulation, args=(start, stop), daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(min(timeout / 4, 0.25))
            hung = _hung(simulation.graph, timeout)
            if hung and thread.is_alive():
                message = f"no answer within {timeout:g} s; raise the time-out?"
                simulation.log.error = FmuError(hung[0].name, hung[0].time, TIMEOUT, message)
                simulation.abandon()
                return
    except BaseException:
        simulation.abandoned = True
        thread.join(timeout)
        if thread.is_alive():
            simulation.abandon()
        raise


def _hung(graph: Graph, timeout: float) -> list[Fmu]:
    """Return the FMUs of this process whose call has taken longer than `timeout` (s) by now."""
    given = perf_counter() - timeout
    return [fmu for fmu in graph.components.values() if fmu.limits is None and 0.0 < fmu.busy_since < given]
