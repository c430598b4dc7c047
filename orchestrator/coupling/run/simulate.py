"""Run a master over a graph at fixed macro steps and record."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from orchestrator.coupling.fmu.instance import TIMEOUT, FmuError
from orchestrator.coupling.fmu.sub_steps import check_steps
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.run.log import Log, Recorder
from orchestrator.coupling.run.work import Work
from orchestrator.coupling.stepping.master import Master
from orchestrator.coupling.stepping.report import StepReport

DIVIDES = 1e-9  # how far (stop - start)/H may be from a whole number


def simulate(
    graph: Graph,
    master: Master,
    start: float,
    stop: float,
    H: float,
    record: Sequence[str] | None = None,
    on_step: Callable[[StepReport], None] | None = None,
    timeout: float | None = None,
) -> Log:
    """Initialise the graph and advance it from `start` to `stop` in macro steps `H` (s).

    Parameters
    ----------
    record : signals to record (numbers of any type); None: every output
    on_step : called after every macro step
    timeout : s of wall time that one call of an FMU may take. The run is then made in a thread of its own;
        an FMU that hangs is left behind in it, and the caller should end the process (`os._exit`) once the
        results are written.

    Returns
    -------
    Log
        with `error` set, and all steps up to it, if an FMU failed

    Raises
    ------
    ValueError
        if `H` does not divide the time, does not suit an FMU's internal step, or a signal does not exist
    """
    n = _steps(start, stop, H)
    check_steps(graph.components, H)  # type: ignore[arg-type]
    recorder = Recorder(graph, record)
    time, values = start + H * np.arange(n + 1), np.full((n + 1, len(recorder.signals)), np.nan)
    log = Log(master.NAME, H, recorder.signals, time, values)
    run = _Loop(graph, master, recorder, log, on_step)
    if timeout is None:
        run(start, stop)
    else:
        _watched(run, start, stop, timeout)
    run.finish()
    return log


def _steps(start: float, stop: float, H: float) -> int:
    if not H > 0.0:
        raise ValueError(f"macro step {H:g} s: must be positive")
    n = round((stop - start) / H)
    if n < 1 or abs(n * H - (stop - start)) > DIVIDES * (stop - start):
        raise ValueError(f"macro step {H:g} s does not divide {stop - start:g} s; choose one that does")
    return n


class _Loop:
    """The loop of `simulate`, callable from a thread."""

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

    def __call__(self, start: float, stop: float) -> None:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # what diverges is found by its values
                self._initialize(start, stop)
                self._loop()
        except FmuError as error:
            if not self.abandoned:
                self.log.error = error
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
        self.recorder.read(self.log.values[0])
        self.rows = 1

    def _loop(self) -> None:
        log, times, step = self.log, self.log.time.tolist(), self.master.step
        H, book = log.macro_step, bool(self.work.names)
        clock = perf_counter()
        for i, t in enumerate(times[:-1]):
            if self.abandoned:
                return
            report = step(t, H)
            if self.abandoned:  # it came back after all
                return
            self.recorder.read(log.values[i + 1])
            log.steps.append(report)
            if book:
                self.energy[i + 1], self.residual[i + 1] = self.work.total, self.work.residual
                report.power_residual = _largest(self.residual[i + 1] - self.residual[i]) / H
            self.rows = i + 2
            if self.on_step is not None:
                self.on_step(report)
            if not i:
                log.wall_first, clock = perf_counter() - clock, perf_counter()
                self._first = {name: (fmu.wall, fmu.solves) for name, fmu in self.graph.components.items()}
            log.wall = perf_counter() - clock

    def abandon(self) -> None:
        """Leave the run's thread to itself, and all FMUs to it: the call it waits for may return."""
        self.abandoned = True
        for fmu in self.graph.components.values():  # type: ignore[union-attr]
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
        first = getattr(self, "_first", {})
        for name, fmu in self.graph.components.items():
            wall, solves = first.get(name, (0.0, 0))
            log.wall_components[name], log.solves[name] = fmu.wall - wall, fmu.solves - solves


def _largest(energies: np.ndarray) -> float:
    """Return the largest magnitude of those that are booked, nan if none is."""
    booked = energies[~np.isnan(energies)]
    return float(np.max(np.abs(booked))) if booked.size else np.nan


def _watched(run: _Loop, start: float, stop: float, timeout: float) -> None:
    """Run in a thread; give up when one call of an FMU lasts longer than `timeout` (s)."""
    thread = threading.Thread(target=run, args=(start, stop), daemon=True)
    thread.start()
    fmus = run.graph.components.values()  # type: ignore[union-attr]
    try:
        while thread.is_alive():
            thread.join(min(timeout / 4, 0.25))
            given = perf_counter() - timeout
            hung = [fmu for fmu in fmus if 0.0 < fmu.busy_since < given]
            if hung and thread.is_alive():
                message = f"no answer within {timeout:g} s; raise the time-out?"
                run.log.error = FmuError(hung[0].name, hung[0].time, TIMEOUT, message)
                run.abandon()
                return
    except BaseException:
        run.abandoned = True
        thread.join(timeout)
        if thread.is_alive():
            run.abandon()
        raise
