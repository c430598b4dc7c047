"""Run a master over a graph at fixed macro steps and record."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from orchestrator.coupling.errors import digits
from orchestrator.coupling.fmu.binding import ROUNDING
from orchestrator.coupling.fmu.failure import TIMEOUT, FmuEnd, FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import check_steps
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import made_for
from orchestrator.coupling.run.columns import Rows
from orchestrator.coupling.run.interval import Between, Interval
from orchestrator.coupling.run.log import RESIDUAL, WORK, Log, Recorder
from orchestrator.coupling.run.spool import Saving
from orchestrator.coupling.run.steps import NAMES, POWER, add
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.steps import number_of

SIGNALS, STEPS = "signals.part", "steps.part"
"""Files of a run that is going on."""
EVERY_POINT = Interval()
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
    folder: Path | None = None,
    interval: Interval = EVERY_POINT,
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
    folder : where results are written to as they come, at least every half a second: ``signals.part`` and ``steps.part``
        (`Spool`), from which a long log is read. None: all is kept in memory
    interval : which communication points are recorded

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
    OSError
        results could not be written to `folder`; what stands there can be read
    """
    n, macro_step = steps_between(start, stop, macro_step)
    check_steps(graph.components, macro_step)
    recorder = Recorder(graph, record)
    simulation = _Simulation(graph, made_for(graph, master), recorder, (start, stop, n, macro_step), on_step)
    log = simulation.prepare(folder, interval)
    with Saving(log.rows, log.reports) if folder is not None else nullcontext():
        if timeout is None or _limited(graph, timeout):
            simulation(start, stop)
        else:
            _watched(simulation, start, stop, timeout)
        simulation.finish()
    for rows in (log.rows, log.reports):
        rows.release()
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

    log: Log
    between: Between

    def __init__(
        self,
        graph: Graph,
        master: Master,
        recorder: Recorder,
        grid: tuple[float, float, int, float],
        on_step: Callable[[StepReport], None] | None,
    ):
        self.graph, self.master, self.recorder, self.on_step = graph, master, recorder, on_step
        self.start, self.stop, self.n, self.H = grid
        self.made, self.abandoned, self.pending = (
            0,
            False,
            False,
        )  # steps; whether the row of the last one is not yet added
        self.failure: BaseException | None = None
        self.work = master.work
        self.residual = np.zeros(len(self.work.names))
        self.before = {name: (0.0, 0) for name in graph.components}  # wall and solves of the first macro step

    def prepare(self, folder: Path | None, interval: Interval) -> Log:
        """Return the log that is to be filled."""
        recorder, loads = self.recorder, self.work.names
        columns = ["time", *recorder.signals, *(f"{WORK}{n}" for n in loads), *(f"{RESIDUAL}{n}" for n in loads)]
        rows = Rows(columns, folder and folder / SIGNALS)
        reports = Rows([*NAMES, *(f"{POWER}{n}" for n in loads)], folder and folder / STEPS)
        self.between = Between(interval, recorder.signals)
        self.log = Log(self.master.NAME, self.H, recorder.signals, rows, reports, interval.every, units=recorder.units)
        return self.log

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

    def _initialize(self, start: float, stop: float) -> None:
        self.graph.initialize(start, stop)
        self.master.keep_books()
        self.master.start(start)
        if self.work.names:
            self.residual[:] = self.work.residual
        self._read(start)
        self._add()

    def _advance(self) -> None:
        log, step, H = self.log, self.master.step, self.H
        clock = perf_counter()
        for k in range(self.n):
            if self.abandoned:
                return
            report = step(self._time(k), H)
            if self.abandoned:  # it came back after all
                return
            self._note(report)
            if self.made == 1:
                log.wall_first, clock = perf_counter() - clock, perf_counter()
                self.before = {name: (fmu.wall, fmu.solves) for name, fmu in self.graph.components.items()}
            log.wall = perf_counter() - clock
            for name, fmu in self.graph.components.items():
                if fmu.fmi.ends:
                    raise FmuEnd(name, report.time)

    def _time(self, k: int) -> float:
        """Return the communication point after `k` steps, s."""
        return self.start + self.H * k if k < self.n else self.stop

    def _note(self, report: StepReport) -> None:
        """Write the macro step that has just been made into the log."""
        log, loads = self.log, len(self.work.names)
        powers: Any = ()
        if loads:
            made = self.work.residual - self.residual
            self.residual[:] = self.work.residual
            powers, booked = made / self.H, self.work.booked
            if self.work.givers:
                report.power_residual = float(np.max(np.abs(powers), where=booked, initial=0.0))
                report.energy_made = float(np.sum(made, where=booked))
        self.made += 1
        self._read(self._time(self.made))
        add(log.reports, report, powers)
        if self.made % log.every == 0 or self.made == self.n:
            self._add()
        else:
            self.between.keep(log.rows.next[1 : 1 + len(log.signals)])
        if self.on_step is not None:
            self.on_step(report)

    def _read(self, t: float) -> None:
        """Fill the next row of the log with what there is at the communication point `t` (s)."""
        row, signals = self.log.rows.next, 1 + len(self.log.signals)
        self.recorder.read(row[1:signals], t)  # where that fails, what may be pending stays as it is
        row[0] = t
        self.between.join(row[1:signals])
        if self.work.names:
            row[signals:] = np.concatenate([self.work.total, self.work.residual])
        self.pending = True

    def _add(self) -> None:
        self.pending = False
        self.between.clear()
        self.log.rows.add()

    def abandon(self) -> None:
        """Leave the run's thread to itself, and all FMUs to it: the call it waits for may return."""
        self.abandoned = True
        for fmu in self.graph.components.values():
            fmu.abandoned = True

    def finish(self) -> None:
        """Complete the log; raise what was no failure of an FMU."""
        if self.failure is not None:
            raise self.failure
        log = self.log
        if self.pending:
            self._add()
        for name, fmu in self.graph.components.items():
            wall, solves = self.before[name]
            log.wall_components[name], log.solves[name] = fmu.wall - wall, fmu.solves - solves


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
