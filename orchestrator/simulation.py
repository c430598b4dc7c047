"""Run a master over a graph at fixed macro steps and record."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from orchestrator.errors import nearest
from orchestrator.fmu import TIMEOUT, FmuError, Group
from orchestrator.graph import Graph
from orchestrator.masters.base import Master, StepReport
from orchestrator.sub_steps import check_steps
from orchestrator.work import Work

DIVIDES = 1e-9  # how far (stop - start)/H may be from a whole number


@dataclass
class Log:
    """What a run leaves behind.

    Attributes
    ----------
    time : (n + 1,) s, communication points, the start included
    signals, values : names, and (n + 1, len(signals))
    steps : n reports
    wall, wall_first : s, the loop without its first step; that step, with all it compiles
    wall_components, solves : seconds inside each FMU's steps and their number, both without the first macro
        step
    energy : load → work done on the component through it, accumulated, (n + 1,) J
    energy_residual : load → that work less what the component at its other end has booked, accumulated, (n + 1,) J; see
        `Work`
    error : None if the run came to its end
    """

    master: str
    macro_step: float
    signals: list[str]
    time: np.ndarray
    values: np.ndarray
    steps: list[StepReport] = field(default_factory=list)
    wall: float = 0.0
    wall_first: float = 0.0
    wall_components: dict[str, float] = field(default_factory=dict)
    solves: dict[str, int] = field(default_factory=dict)
    energy: dict[str, np.ndarray] = field(default_factory=dict)
    energy_residual: dict[str, np.ndarray] = field(default_factory=dict)
    error: FmuError | None = None

    def signal(self, name: str) -> np.ndarray:
        """Return one signal over time, (n + 1,)."""
        return self.values[:, self.signals.index(name)]

    @property
    def power_residual(self) -> dict[str, np.ndarray]:
        """Load → difference of the powers on both sides of the interface in each macro step, (n,) W."""
        with np.errstate(over="ignore", invalid="ignore"):  # of a run that has diverged
            return {name: np.diff(values) / self.macro_step for name, values in self.energy_residual.items()}

    @property
    def unconverged(self) -> int:
        """Number of macro steps that did not reach the tolerance."""
        return sum(not step.converged for step in self.steps)

    @property
    def iterations_per_step(self) -> float:
        """Average number of iterations of a macro step."""
        return sum(step.iterations for step in self.steps) / max(len(self.steps), 1)


class Recorder:
    """Reads the signals of a log from the FMUs, one call an FMU and type.

    Parameters
    ----------
    record : signals ``component.variable``; None: every output that is a number
    """

    def __init__(self, graph: Graph, record: Sequence[str] | None):
        self.signals = _all_outputs(graph) if record is None else list(record)
        owners = [signal.partition(".")[0] for signal in self.signals]
        self.row = np.zeros(len(self.signals))
        self.groups: list[tuple[Group, np.ndarray | None]] = []
        for component, fmu in graph.components.items():
            places = np.array([i for i, owner in enumerate(owners) if owner == component], dtype=np.intp)
            if not places.size:
                continue
            names = [self.signals[i].partition(".")[2] for i in places]
            if places[-1] - places[0] + 1 == places.size:  # neighbours: the FMU writes them where they belong
                self.groups.append((fmu.group(names, self.row[places[0] : places[-1] + 1]), None))
            else:
                self.groups.append((fmu.group(names), places))
        missing = [s for s, owner in zip(self.signals, owners, strict=True) if owner not in graph.components]
        if missing:
            raise ValueError(f"cannot record {missing[0]}: no such component{nearest(missing[0], graph.components)}")

    def read(self, row: np.ndarray) -> None:
        """Read all signals into `row` (len(signals),)."""
        for group, places in self.groups:
            group.get_finite()
            if places is not None:
                self.row[places] = group.values
        row[:] = self.row


def _all_outputs(graph: Graph) -> list[str]:
    return [
        f"{component}.{port.name}"
        for component, fmu in graph.components.items()
        for port in fmu.ports.values()
        if port.causality == "output" and port.is_number
    ]


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
    run = _Run(graph, master, recorder, log, on_step)
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


class _Run:
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


def _watched(run: _Run, start: float, stop: float, timeout: float) -> None:
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
