"""Which signals people are shown, by which words and in which units, and what counts as nothing.

A number is shown as 0 where it is noise: smaller than `ROUND_OFF` times the largest of its signal, or than the floor of
its unit. A picometre, a billionth of a newton or of a joule mean nothing to anyone who lands a robot, and arithmetic
leaves such numbers where the truth is zero. Units without a floor here (those of foreign FMUs) have the first rule alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing.flight import flight

ROUND_OFF = 1e-12
"""Part of a signal's largest value that says nothing."""
FLOORS = {"m": 1e-12, "m/s": 1e-12, "rad": 1e-12, "rad/s": 1e-12, "N": 1e-9, "N.m": 1e-9, "J": 1e-9}
"""Values (in the unit) that say nothing, whatever the signal."""
DEGREES = 180.0 / np.pi
MOST_PANELS, MOST_LINES = 6, 6
"""Panels of a general graph, and lines in one panel."""
BETWEEN = re.compile(r"_(mean|rate)((?:\.[xyz])?)$")
"""End of the name of a mean or slope that belongs to another signal, and only serves the coupling."""
LABELS = {
    "roll": "Roll against\nthe line", "yaw": "Yaw against\nthe line", "pitch": "Pitch", "z": "Sunk since\ntouching",
    "slip": "Slid along\nthe line", "airborne": "Off the line\nagain", "tension": "Tension by\nrated strength",
    "wheel_force": "Load on\na wheel",
}  # fmt: skip
"""Limit → what is held against it, in two lines."""
PEAK = "_max"
"""End of the name of a signal's largest value within the last macro step."""
NO_UNITS: Mapping[str, str] = MappingProxyType({})


def shown(values: np.ndarray, unit: str) -> np.ndarray:
    """Return `values` with 0 for those that are noise against the largest of them, or for their unit."""
    finite = np.abs(values[np.isfinite(values)])
    floor = max(FLOORS.get(unit, 0.0), ROUND_OFF * float(np.max(finite, initial=0.0)))
    return np.where(np.abs(values) < floor, 0.0, values)


@dataclass(frozen=True)
class Panel:
    """Signals of one kind, which share an axis.

    Attributes
    ----------
    label : what they are, in words
    unit : that people read; empty where the FMU declares none
    lines : signal → what tells it from the others; empty if it is alone
    factor : from the signals' own unit to `unit`
    own_unit : of the signals
    from_start : whether their change since the start is drawn
    peaks : whether there is a signal ``…_max`` of each, its largest value within every macro step
    """

    label: str
    unit: str
    lines: Mapping[str, str]
    factor: float = 1.0
    own_unit: str = ""
    from_start: bool = False
    peaks: bool = False

    @property
    def axis(self) -> str:
        """What the axis says: label and unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def values(self, signal: str, table: Table) -> np.ndarray:
        """Return a signal as it is drawn, in `unit`, noise as 0."""
        values = shown(table[signal], self.own_unit)
        return (values - values[0] if self.from_start else values) * self.factor

    def among(self, table: Table) -> Panel:
        """Return the panel with those lines alone that `table` has as well."""
        lines = {signal: words for signal, words in self.lines.items() if signal in table}
        return Panel(self.label, self.unit, lines, self.factor, self.own_unit, self.from_start, self.peaks)

    def peak(self, signal: str, table: Table) -> np.ndarray | None:
        """Return the largest values of a signal within the macro steps, in `unit`; None where `table` has none."""
        if not self.peaks or f"{signal}{PEAK}" not in table:
            return None
        return shown(table[f"{signal}{PEAK}"], self.own_unit) * self.factor


@dataclass(frozen=True)
class _Kind:
    """A panel of a landing; the group of `pattern` tells its lines apart."""

    label: str
    pattern: str
    unit: str
    factor: float
    own_unit: str
    words: str = "{}"
    from_start: bool = False
    peaks: bool = False
    if_it_varies: bool = False


INVISIBLE = 1e-6
"""Range of a curve, over the largest in its panel, that nobody would see: what an iteration leaves of nothing."""
LANDING = (
    _Kind("Z displacement", r"robot\.body\.position\.()z", "m", 1.0, "m", from_start=True),
    _Kind("Angle", r"robot\.(roll|pitch|yaw)", "°", DEGREES, "rad"),
    _Kind("Sum of wall forces", r"contact(\d+)\.normal_force", "N", 1.0, "N", "wheel {}", peaks=True),
    _Kind("Cable tension", r"cable\.tension_()mid", "kN", 1e-3, "N"),
    _Kind("Thrust", r"(?:robot|controller)\.()thrust", "N", 1.0, "N", if_it_varies=True),
    _Kind("Torque", r"(?:robot|controller)\.torque\.([xyz])", "N m", 1.0, "N.m", "about {}", if_it_varies=True),
    _Kind("Drive torque", r"robot\.wheel\[(\d+)\]\.drive_torque", "N m", 1.0, "N.m", "wheel {}", if_it_varies=True),
)


def panels_for(
    table: Table, chosen: Iterable[str] = (), units: Mapping[str, str] = NO_UNITS, most: int = MOST_PANELS
) -> list[Panel]:
    """Return the panels of a landing; of a general graph those of the `chosen` signals, then of the others.

    Parameters
    ----------
    units : of the signals by name, as their FMUs declare them
    most : panels of a general graph
    """
    landing = [panel for kind in LANDING if (panel := _of_kind(kind, table)).lines]
    return landing or _of_graph([*(n for n in chosen if n in table), *table], units)[:most]


def _of_kind(kind: _Kind, table: Table) -> Panel:
    found = {n: kind.words.format(m[1]) if m[1] else "" for n in table if (m := re.fullmatch(kind.pattern, n))}
    if kind.if_it_varies:
        spans = {name: float(np.ptp(shown(table[name], kind.own_unit))) for name in found}
        least = INVISIBLE * max(spans.values(), default=0.0)
        found = {name: words for name, words in found.items() if spans[name] > least}
    lines = found if len(found) > 1 else dict.fromkeys(found, "")
    return Panel(kind.label, kind.unit, lines, kind.factor, kind.own_unit, kind.from_start, kind.peaks)


def _of_graph(names: Iterable[str], units: Mapping[str, str]) -> list[Panel]:
    """Return panels of signals that are called alike in several components and have the same unit."""
    groups: dict[tuple[str, str], dict[str, str]] = {}
    signals = dict.fromkeys(names)
    for signal in signals:
        component, _, variable = signal.partition(".")
        if variable and not (BETWEEN.search(signal) and BETWEEN.sub(r"\2", signal) in signals):
            groups.setdefault((variable, units.get(signal, "")), {})[signal] = component
    return [
        Panel(variable if len(lines) > 1 else next(iter(lines)), _readable(unit), _few(lines), own_unit=unit)
        for (variable, unit), lines in groups.items()
    ]


def _few(lines: dict[str, str]) -> dict[str, str]:
    return dict(list(lines.items())[:MOST_LINES]) if len(lines) > 1 else dict.fromkeys(lines, "")


def _readable(unit: str) -> str:
    return {"1": "–"}.get(unit, unit)


def words(signal: str) -> str:
    """Return what people call `signal`, or its own name."""
    for kind in LANDING:
        if match := re.fullmatch(kind.pattern, signal):
            return kind.words.format(match[1]).capitalize() if match[1] and kind.words == "{}" else kind.label
    return signal


def extremes(
    table: Table, chosen: Iterable[str] = (), units: Mapping[str, str] = NO_UNITS
) -> Iterator[tuple[str, ...]]:
    """Yield a row for each signal of the panels: name, unit, start, least, largest and end, noise as 0.

    The largest is that within the macro steps, where the table has it.
    """
    for panel in panels_for(table, chosen, units):
        for signal in panel.lines:
            values = shown(table[signal], panel.own_unit) * panel.factor
            peak = panel.peak(signal, table)
            numbers = (values[0], values.min(), (values if peak is None else peak).max(), values[-1])
            unit = {"°": "deg", "–": "1"}.get(panel.unit, panel.unit)
            yield signal, unit, *(f"{number + 0.0:.5g}" for number in numbers)  # + 0.0: no -0


# -- in the air -----------------------------------------------------------------------------------------------


def in_the_air(table: Table) -> Iterator[str]:
    """Yield for how long a robot, and each of several wheels, had no contact since the first touch."""
    found = flight(table)
    if found is None:
        return
    wheels = found.of_wheels
    each = ", ".join(f"{name} open {time:.3g} s" for name, time in wheels.items())
    yield f"{found.total:.3g} s since the first touch" + (f" ({each})" if len(wheels) > 1 else "")
