"""Measurements: a table of times and signals, read and checked against the landing that it measures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.module.units import UnitError, convert
from orchestrator.catalogue import modules as vocabulary
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.run.results import Table, read_table
from orchestrator.scenario.types import GraphScenario, Scenario
from orchestrator.studies.identification.study import Column, Measurement


@dataclass(frozen=True)
class Series:
    """A column of a measurement, in the units of the signal that it measures.

    Attributes
    ----------
    time : (n,) of the landing, s
    value : (n,) measured
    uncertainty : one standard deviation of a value
    """

    name: str
    signal: str
    unit: str
    time: np.ndarray
    value: np.ndarray
    uncertainty: float
    relative: bool
    used: bool

    def of(self, table: Table) -> np.ndarray:
        """Return what a landing gives at the times of the measurement (n,)."""
        found = np.interp(self.time, table["time"], table[self.signal])
        return found - found[0] if self.relative else found


def read_series(measurement: Measurement, folder: Path, scenario: Scenario) -> list[Series]:
    """Return the columns of a measurement; `InputError` names file, cause and cure."""
    path = folder / measurement.file
    table = read_table(path)
    problems = [f"{path}: {problem}" for problem in _problems(measurement, table, scenario)]
    if problems:
        raise InputError(problems)
    seconds = np.array([convert(float(t), measurement.time_unit, "s") for t in table[measurement.time]])
    return [
        _series(f"{path.stem}:{name}", column, seconds + measurement.start, table[name], scenario)
        for name, column in measurement.signals.items()
    ]


def _series(name: str, column: Column, time: np.ndarray, values: np.ndarray, scenario: Scenario) -> Series:
    wanted = unit_of(scenario, column.signal)
    value = np.array([convert(float(x), column.unit or wanted, wanted) for x in values])
    value = value - value[0] if column.relative else value
    uncertainty = convert(column.uncertainty, column.unit or wanted, wanted)
    return Series(name, column.signal, wanted, time, value, uncertainty, column.relative, column.used)


def _problems(measurement: Measurement, table: Table, scenario: Scenario) -> Iterator[str]:
    """Yield what is wrong with a measurement."""
    wanted = [measurement.time, *measurement.signals]
    missing = [name for name in wanted if name not in table]
    yield from (f"no column {name!r}{nearest(name, table)}; there are {', '.join(table)}" for name in missing)
    for name in wanted:
        if name in table and not np.all(np.isfinite(table[name])):
            row = int(np.argmin(np.isfinite(table[name])))
            yield f"column {name!r}, row {row + 2}: {table[name][row]} is no number; leave the row out"
    if missing:
        return
    times = table[measurement.time]
    if times.size < 2:
        yield "holds fewer than two rows"
    elif np.any(np.diff(times) <= 0.0):
        row = int(np.argmin(np.diff(times)))
        yield f"column {measurement.time!r}, row {row + 3}: times must rise; sort the rows"
    yield from _misfits(measurement, scenario)


def _misfits(measurement: Measurement, scenario: Scenario) -> Iterator[str]:
    """Yield signals that the landing has not, and units that do not fit."""
    given = {measurement.time: (measurement.time_unit, "s")}
    for name, column in measurement.signals.items():
        try:
            wanted = unit_of(scenario, column.signal)
        except InputError as error:
            yield f"column {name!r}: {error}"
        else:
            given[name] = (column.unit or wanted, wanted)
    for name, (unit, wanted) in given.items():
        try:
            convert(1.0, unit, wanted)
        except UnitError as error:
            yield f"column {name!r}: {error}"


def unit_of(scenario: Scenario, signal: str) -> str:
    """Return the unit of an output of a landing, `component.variable`; `InputError` where there is none."""
    if isinstance(scenario, GraphScenario):
        raise InputError(f"{scenario.path}: is no landing; name one")
    component, _, variable = signal.partition(".")
    known = _outputs(scenario, component)
    if variable not in known:
        raise InputError(f"no signal {signal!r}{nearest(variable, known)}")
    return known[variable]


def _outputs(scenario: Scenario, component: str) -> Mapping[str, str]:
    kind = component.rstrip("0123456789")
    if isinstance(scenario, GraphScenario) or kind not in ("cable", "robot", "contact"):
        return {}
    variables = vocabulary.of_module(kind, scenario.robot.model if kind == "robot" else None)
    return {v.name: v.unit or "1" for v in variables.values() if v.causality == "output"}


def end_of(series: list[Series], macro_step: float) -> float:
    """Return the end of the last whole macro step that a landing needs to cover all of `series`, s."""
    last = max(float(one.time[-1]) for one in series)
    return macro_step * math.ceil(last / macro_step - 1e-9)
