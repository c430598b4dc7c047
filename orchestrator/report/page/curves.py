"""What a page plots, with the limits in it, and the numbers beside its picture."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing.safety import TENSIONS
from orchestrator.report.page.head import Hud, Plot, PlotLimit, PlotSignal
from orchestrator.report.signals import DEGREES, NO_UNITS, Panel, panels_for

COLOURS = 8
DASHES: tuple[list[int], ...] = ([], [7, 4], [2, 3])
"""Of curves that lie on each other."""
INPUTS = ("Thrust", "Torque", "Drive torque")
"""Panels of a landing's inputs over time, where they vary."""
HEIGHT = "robot.body.position.z"
UNSEEN = 1e-5
"""rad; smaller angles are not plotted."""
Limits = Mapping[str, Mapping[str, Any]]


def plots_of(
    table: Table, limits: Limits, chosen: Iterable[str] = (), units: Mapping[str, str] = NO_UNITS
) -> list[Plot]:
    """Return the plots of a landing, or of a general graph those of the `chosen` signals and of others.

    Parameters
    ----------
    limits : as in ``summary.json``
    units : of the signals by name
    """
    found = [plot for plot in _of_landing(table, limits) if plot.signals]
    if not found:
        return [_of_panel(panel, 3) for panel in panels_for(table, chosen, units)]
    inputs = [panel for panel in panels_for(table, chosen, units) if panel.label in INPUTS]
    return [*found, *(_of_panel(panel, 1) for panel in inputs)]


def _of_panel(panel: Panel, digits: int) -> Plot:
    signals = [
        _signal(name, label or name.rpartition(".")[2], i) for i, (name, label) in enumerate(panel.lines.items())
    ]
    return Plot(panel.label, panel.unit, panel.factor, digits, panel.from_start, signals)


def _of_landing(table: Table, limits: Limits) -> Iterator[Plot]:
    height = _lines(table, {HEIGHT: "height"})
    yield Plot("Height of the robot", "m", 1.0, 3, True, height, _height_limits(table, limits))
    yield Plot(
        "Roll", "°", DEGREES, 2, False, _lines(table, {"robot.roll": "roll"}), list(_angle_limits(limits, "roll"))
    )
    yield from _other_angles(table, limits)
    forces = _lines(table, _forces(table), first=1)
    yield Plot("Contact force", "N", 1.0, 0, False, forces)
    tensions = _lines(table, {name: name.rpartition("_")[2] for name in TENSIONS})
    yield Plot("Tension of the line", "kN", 1e-3, 2, False, tensions, _tension_limits(limits))


def _lines(table: Table, names: Mapping[str, str], first: int = 0) -> list[PlotSignal]:
    return [_signal(name, label, first + i) for i, (name, label) in enumerate(names.items()) if name in table]


def _signal(name: str, label: str, i: int) -> PlotSignal:
    return PlotSignal(name, label, str(i % COLOURS + 1), DASHES[i % len(DASHES)] if name in TENSIONS else [])


def _forces(table: Table) -> dict[str, str]:
    """Return the normal force of every wheel, and the friction of a single one."""
    wheels = [m[1] for name in table if (m := re.fullmatch(r"contact(\d+)\.normal_force", name))]
    if len(wheels) == 1:
        return {f"contact{wheels[0]}.{kind}_force": kind for kind in ("normal", "friction")}
    return {f"contact{k}.normal_force": f"wheel {k}" for k in wheels}


def _height_limits(table: Table, limits: Limits) -> list[PlotLimit]:
    """Return how far the robot may sink, counted as the plot is: from its start."""
    if "z" not in limits or HEIGHT not in table or limits["z"]["reference"] is None:
        return []
    lowest = limits["z"]["reference"] - limits["z"]["limit"] - float(table[HEIGHT][0])
    return [PlotLimit(lowest, f"lowest allowed, {lowest:.2f} m")]


def _other_angles(table: Table, limits: Limits) -> Iterator[Plot]:
    """Yield pitch and yaw where they can be seen: they are zero by symmetry in most landings."""
    seen = [name for name in ("pitch", "yaw") if np.max(np.abs(table.get(f"robot.{name}", np.zeros(1)))) > UNSEEN]
    if seen:
        lines = [PlotLimit(one.at, f"{name}: {one.name}") for name in seen for one in _angle_limits(limits, name)]
        yield Plot("Pitch and yaw", "°", DEGREES, 2, False, _lines(table, {f"robot.{n}": n for n in seen}), lines)


def _angle_limits(limits: Limits, name: str) -> Iterator[PlotLimit]:
    if name in limits:
        most = DEGREES * limits[name]["limit"]
        yield from (PlotLimit(sign * most, f"limit, {sign * most:.1f}°") for sign in (1.0, -1.0))


def _tension_limits(limits: Limits) -> list[PlotLimit]:
    if "tension" not in limits or limits["tension"]["reference"] is None:
        return []
    most = 1e-3 * limits["tension"]["limit"] * limits["tension"]["reference"]
    return [PlotLimit(most, f"limit, {most:.1f} kN")]


def hud_of(table: Table, with_clearance: bool) -> list[Hud]:
    """Return the numbers that stand beside the picture of a landing."""
    wheels = [name for name in table if re.fullmatch(r"contact\d+\.normal_force", name)]
    forces = [Hud(f"force {name[7:-13]}" if len(wheels) > 1 else "contact force", "N", 0, name=name) for name in wheels]
    found = [
        Hud("height", "m", 3, from_start=True, name=HEIGHT),
        Hud("roll", "°", 2, DEGREES, name="robot.roll"),
        *forces,
        Hud("tension", "kN", 2, 1e-3, name="cable.tension_mid"),
    ]
    gap = [Hud("rotor–line gap", "mm", 0, 1e3, expr="clearance")] if with_clearance else []
    return [one for one in found if one.name in table] + gap
