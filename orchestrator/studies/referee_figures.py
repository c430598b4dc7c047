"""The pictures of what a referee asks for."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from orchestrator.report.style import BLUE, GREEN, SKY, VERMILION
from orchestrator.studies.book import Book
from orchestrator.studies.figures import DASHED, WIDE, Drawing, curve, finish, styled
from orchestrator.studies.referee import (
    FORCE,
    PITCH,
    ROLL_PEAK,
    SENSITIVE,
    YAW,
    Z_PEAK,
    Z,
    effects,
    still_air,
    tables_of,
    windy,
)


def damping(figure: Figure, book: Book) -> None:
    """Peak of roll at point 9 over alpha, with what air can give."""
    axis = figure.subplots()
    _over(axis, book, "damping", ROLL_PEAK)
    low, high = windy()
    axis.axvspan(
        0.5 * still_air(), 2.0 * still_air(), color=SKY, alpha=0.3, linewidth=0.0, label="still air, 0.5 to 2 m/s"
    )
    axis.axvspan(low, high, color=GREEN, alpha=0.2, linewidth=0.0, label="10 m/s of wind")
    axis.axhline(4.98, **DASHED)
    axis.set_xscale("log")
    axis.set_ylabel("Peak of roll [°]")
    finish(figure, [axis], "Damping proportional to mass, alpha [1/s]")


def area(figure: Figure, book: Book) -> None:
    """Peaks over the axial stiffness."""
    axes = figure.subplots(1, 2)
    for axis, asked in zip(axes, (Z_PEAK, ROLL_PEAK), strict=True):
        _over(axis, book, "area", asked)
        axis.set_ylabel(asked.title[:1].upper() + asked.title[1:])
    finish(figure, axes, "Axial stiffness [N]")


def _over(axis, book: Book, series: str, asked) -> None:
    found = [(value, asked.of(table)) for _, value, table in tables_of(book, series) if table is not None and value]
    if found:
        axis.plot(*zip(*found, strict=True), color=VERMILION, marker="o", markersize=4.0, label="ours")


def yaw(figure: Figure, book: Book) -> None:
    """Yaw and pitch of robots that are not symmetric."""
    axes = figure.subplots(1, 2)
    for axis, name, label in zip(axes, (YAW, PITCH), ("Yaw [°]", "Pitch [°]"), strict=True):
        for i, (title, _, table) in enumerate(tables_of(book, "yaw")):
            curve(axis, table, name, "deg", label=title, **styled(i))
        axis.set_ylabel(label)
    finish(figure, axes, "Time [s]")


def set_down(figure: Figure, book: Book) -> None:
    """Force and Z on the rig, let go and set down."""
    axes = figure.subplots(1, 2)
    for axis, name, label in zip(axes, (FORCE, Z), ("Resultant of both walls [N]", "Z [m]"), strict=True):
        for i, (title, _, table) in enumerate(tables_of(book, "set_down")):
            curve(axis, table, name, "1", label=title, **styled(i))
        axis.set_ylabel(label)
        axis.set_xlim(0.0, 10.0)
    for level in (380.0, 400.0):
        axes[0].axhline(level, **DASHED)
    finish(figure, axes, "Time [s]")


def sensitivity(figure: Figure, book: Book) -> None:
    """Bars: what each assumed number changes, the largest of roll on top."""
    found = sorted(effects(book), key=lambda one: max(map(abs, one[1][1])))
    axes = figure.subplots(1, len(SENSITIVE), sharey=True)
    at = np.arange(len(found))
    for k, (axis, asked) in enumerate(zip(axes, SENSITIVE, strict=True)):
        for end, colour, label in ((0, BLUE, "lower bound"), (1, VERMILION, "upper bound")):
            values = [100.0 * pairs[k][end] for _, pairs in found]
            axis.barh(at, values, height=0.7, color=colour, alpha=0.8, label=label)
        axis.set_xlabel(f"{asked.title.split(' [')[0]} [%]")
        axis.axvline(0.0, color="0.3", linewidth=0.7)
    axes[0].set_yticks(at, [name for name, _ in found])
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)


DRAWINGS = (
    Drawing("damping", "Where the damping comes from", "", WIDE, damping, of_paper=False),
    Drawing("area", "Axial stiffness", "", WIDE, area, of_paper=False),
    Drawing("yaw", "What yaw and pitch come from", "", (7.0, 3.1), yaw, of_paper=False),
    Drawing("set_down", "Set down or let go", "", WIDE, set_down, of_paper=False),
    Drawing("sensitivity", "Sensitivity", "", (7.0, 3.6), sensitivity, of_paper=False),
)
"""The pictures, as the page has them."""
