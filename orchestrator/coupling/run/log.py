"""What a run leaves behind, and what reads it from the FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from orchestrator.coupling.errors import nearest
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.run.columns import Columns, Rows
from orchestrator.coupling.run.results import Table
from orchestrator.coupling.run.steps import KINDS, NAMES, POWER, Steps

WORK, RESIDUAL = "work ", "residual "
"""Begin the names of a load's columns in the rows of a log."""


@dataclass
class Log:
    """What a run leaves behind.

    Attributes
    ----------
    signals : names ``component.variable``
    units : signal → unit that its FMU declares, ``1`` where it declares none
    rows : at each communication point that is recorded ``time``, the signals, and for each load the work done through it
        and what it differs from that of the other side
    reports : of every macro step, see `Steps`
    every : how many macro steps lie between the points that are recorded
    wall, wall_first : s, the loop without its first step; that step, with all it compiles
    wall_components, solves : seconds inside each FMU's steps and their number, both without the first macro
        step
    error : None if the run came to its end
    ended : which FMU asked for the end before the stop time, and when; empty if none did
    """

    master: str
    macro_step: float
    signals: list[str]
    rows: Rows
    reports: Rows
    every: int = 1
    wall: float = 0.0
    wall_first: float = 0.0
    wall_components: dict[str, float] = field(default_factory=dict)
    solves: dict[str, int] = field(default_factory=dict)
    error: FmuError | None = None
    ended: str = ""
    units: dict[str, str] = field(default_factory=dict)

    @property
    def time(self) -> np.ndarray:
        """The communication points that are recorded, (n + 1,) s, the start included."""
        return self.rows.column("time")

    @property
    def points(self) -> np.ndarray:
        """All communication points, recorded or not, (steps + 1,) s."""
        if self.every == 1:
            return self.time
        first, last = self.rows.row(0)[0], self.rows.row(-1)[0]
        return np.append(first + self.macro_step * np.arange(len(self.reports)), last)

    @property
    def values(self) -> np.ndarray:
        """All signals at these points, (n + 1, len(signals))."""
        return self.rows.array()[:, 1 : 1 + len(self.signals)]

    @property
    def steps(self) -> Steps:
        """The reports of all macro steps."""
        return Steps(self.reports)

    def signal(self, name: str) -> np.ndarray:
        """Return one signal over time, (n + 1,); `ValueError` names the nearest one that was recorded."""
        if name not in self.signals:
            raise ValueError(f"{name} was not recorded{nearest(name, self.signals)}")
        return self.rows.column(name)

    @property
    def table(self) -> Table:
        """All signals over time by name, ``time`` first, (n + 1,) each; read from disk one by one where they are many."""
        return _columns(self.rows, {name: name for name in ("time", *self.signals)})

    @property
    def steps_table(self) -> Table:
        """What every macro step needed and reached, (steps,) each; `StepReport`, and the power residual of each load."""
        powers = [f"{POWER}{name}" for name in self._booked]
        return _columns(self.reports, {name: name for name in (*NAMES, *powers)}, KINDS)

    @property
    def energy(self) -> Table:
        """Load → work done on the component through it, accumulated, (n + 1,) J."""
        return _columns(self.rows, {name: f"{WORK}{name}" for name in self._loads})

    @property
    def energy_residual(self) -> Table:
        """Load → that work less what the component at its other end has booked, accumulated, (n + 1,) J; see `Work`."""
        return _columns(self.rows, {name: f"{RESIDUAL}{name}" for name in self._booked})

    @property
    def power_residual(self) -> Table:
        """Load → difference of the powers on both sides of the interface in each macro step, (steps,) W."""
        return _columns(self.reports, {name: f"{POWER}{name}" for name in self._booked})

    @property
    def _loads(self) -> list[str]:
        return [name.removeprefix(WORK) for name in self.rows.names if name.startswith(WORK)]

    @property
    def _booked(self) -> list[str]:
        """The loads whose other side books its work, too."""
        if not len(self.rows):
            return []
        first, places = self.rows.row(0), self.rows.places
        return [name for name in self._loads if not np.isnan(first[places[f"{RESIDUAL}{name}"]])]

    def raise_error(self) -> None:
        """Raise what ended the run before its time, if anything did."""
        if self.error is not None:
            raise self.error

    @property
    def unconverged(self) -> int:
        """Number of macro steps that did not reach the tolerance."""
        return int(np.sum(~self.steps.column("converged")))

    @property
    def iterations_per_step(self) -> float:
        """Average number of iterations of a macro step."""
        return int(np.sum(self.steps.column("iterations"))) / max(len(self.reports), 1)


def _columns(rows: Rows, names: Mapping[str, str], kinds: Mapping[str, type] | None = None) -> Table:
    """Return columns by name, in memory if their rows are."""
    found = Columns(rows, names, kinds)
    return found.loaded() if rows.is_held else found


class Recorder:
    """Reads the signals of a log from the FMUs, one call an FMU and type; of an input that follows a course, from that.

    An FMU holds what it was given for the last step, a mean; its course has a value at the communication point.

    Parameters
    ----------
    record : signals ``component.variable``; None: every output that is a number, and every input that follows a course

    Attributes
    ----------
    signals, units : what is read, and the unit of each, by name
    """

    def __init__(self, graph: Graph, record: Sequence[str] | None):
        self.signals = [*_all_outputs(graph), *graph.courses] if record is None else list(record)
        owners = [signal.partition(".")[0] for signal in self.signals]
        missing = [s for s, owner in zip(self.signals, owners, strict=True) if owner not in graph.components]
        if missing:
            raise ValueError(f"cannot record {missing[0]}: no such component{nearest(missing[0], graph.components)}")
        self.row = np.zeros(len(self.signals))
        self.groups: list[tuple[Group, np.ndarray | None]] = []
        self.courses = [(i, graph.courses[s]) for i, s in enumerate(self.signals) if s in graph.courses]
        followed = {i for i, _ in self.courses}
        for component, fmu in graph.components.items():
            own = [i for i, owner in enumerate(owners) if owner == component and i not in followed]
            places = np.array(own, dtype=np.intp)
            if places.size:
                self.groups.append(self._group(fmu, places))
        split = {signal: signal.partition(".") for signal in self.signals}
        self.units = {s: graph.components[owner].ports[name].unit or "1" for s, (owner, _, name) in split.items()}

    def _group(self, fmu: Fmu, places: np.ndarray) -> tuple[Group, np.ndarray | None]:
        """Return a handle on the signals at `places`, all of `fmu`, and where its values go if not into the row itself."""
        names = [self.signals[i].partition(".")[2] for i in places]
        if places[-1] - places[0] + 1 == places.size:  # neighbours: the FMU writes them where they belong
            return fmu.group(names, self.row[places[0] : places[-1] + 1]), None
        return fmu.group(names), places

    def read(self, row: np.ndarray, t: float) -> None:
        """Read all signals at the communication point `t` (s) into `row` (len(signals),)."""
        for group, places in self.groups:
            group.get_finite()
            if places is not None:
                self.row[places] = group.values
        for i, course in self.courses:
            self.row[i] = course.reached(t)
        row[:] = self.row


def _all_outputs(graph: Graph) -> list[str]:
    return [
        f"{component}.{port.name}"
        for component, fmu in graph.components.items()
        for port in fmu.ports.values()
        if port.causality == "output" and port.is_number
    ]
