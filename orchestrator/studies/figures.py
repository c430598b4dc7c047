"""The paper's figures in our way: ours as lines, what the paper prints as marks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from orchestrator.coupling.run.results import Table
from orchestrator.report.style import BLACK, COLOURS, LINES, MARKERS, legend_above
from orchestrator.studies.book import Book, measured
from orchestrator.studies.signals import TO_UNIT, signal, tensions

Z, ROLL, PITCH, YAW = "robot.body.position.z", "robot.roll", "robot.pitch", "robot.yaw"
FORCE = "contact1.radial_force"
POINTS = [f"point{k}" for k in range(1, 11)]
MASSES = (10, 55, 100)
FOUR = ((Z, "m", "Z [m]"), (PITCH, "deg", "Pitch [°]"), (ROLL, "deg", "Roll [°]"), (YAW, "deg", "Yaw [°]"))
PAPER = {
    "color": BLACK,
    "marker": "x",
    "linestyle": "none",
    "markersize": 6.0,
    "markeredgewidth": 1.4,
    "label": "paper",
    "zorder": 5,
}
DASHED = {"color": BLACK, "linestyle": LINES[1], "linewidth": 0.9, "label": "paper"}


@dataclass(frozen=True)
class Drawing:
    """How a picture is drawn: `draw` fills the figure of `size` (inches)."""

    name: str
    title: str
    caption: str
    size: tuple[float, float]
    draw: Callable[[Figure, Book], None]
    of_paper: bool = True


# -- pieces ---------------------------------------------------------------------------------------------------


def shades(n: int) -> list[tuple[float, ...]]:
    """Return `n` colours from dark to light, for what has an order."""
    return [tuple(c) for c in colormaps["viridis"](np.linspace(0.0, 0.88, n))]


def curve(axis: Axes, table: Table | None, name: str, unit: str, **style: object) -> None:
    """Draw a signal over time, if the run is there."""
    if table is not None:
        axis.plot(table["time"], signal(table, name) * TO_UNIT.get(unit, 1.0), **style)  # type: ignore[arg-type]


def styled(i: int) -> dict[str, object]:
    """Return how line `i` of a few is drawn."""
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": LINES[i % len(LINES)], "linewidth": 1.2}


def finish(figure: Figure, axes: Iterable[Axes], xlabel: str) -> None:
    """Name the horizontal axes, and put one legend of all that the figure shows above."""
    for axis in axes:
        axis.set_xlabel(xlabel)
    found = {label: handle for a in figure.axes for handle, label in zip(*a.get_legend_handles_labels(), strict=True)}
    if found:
        legend_above(figure, list(found.values()), list(found))


def damped(book: Book) -> list[str]:
    """Return the sets with the paper's damping."""
    return [name for name in book.sets if not name.endswith("_undamped")]


def four(figure: Figure, curves: Sequence[tuple[str, Table | None, dict[str, object]]]) -> list[Axes]:
    """Draw Z, pitch, roll and yaw of several runs over time."""
    axes = list(figure.subplots(2, 2, sharex=True).flat)
    for axis, (name, unit, label) in zip(axes, FOUR, strict=True):
        for title, table, style in curves:
            curve(axis, table, name, unit, label=title, **style)
        axis.set_ylabel(label)
    for axis in (axes[1], axes[3]):
        axis.plot([0.0, 0.0], [-0.15, 0.15], linestyle="none")  # exactly 0: what is drawn is not round-off
    return axes


# -- the figures ----------------------------------------------------------------------------------------------


def line_shape(figure: Figure, book: Book) -> None:
    """Fig. 4: the 200 m line at rest, and its slope."""
    shape, slope = figure.subplots(1, 2)
    for i, name in enumerate(damped(book)):
        table = book.table("point1", name)
        if table is None:
            continue
        end = float(np.degrees(signal(table, "cable.end_slope")[0]))
        y = np.linspace(0.0, 200.0, 101)
        angle = np.degrees(np.arctan(np.tan(np.radians(end)) * (y / 100.0 - 1.0)))
        sag = -np.tan(np.radians(end)) * y * (1.0 - y / 200.0)
        shape.plot(y, sag, label=name, **styled(i))  # type: ignore[arg-type]
        slope.plot(y, angle, label=name, **styled(i))  # type: ignore[arg-type]
    y = np.linspace(0.0, 200.0, 101)
    steep = np.tan(np.radians(5.1))
    shape.plot(y, -steep * y * (1.0 - y / 200.0), **DASHED)
    slope.plot([0.0, 200.0], [-5.1, 5.1], **PAPER)
    shape.set_ylabel("Z [m]")
    slope.set_ylabel("Slope [°]")
    finish(figure, (shape, slope), "Along the span [m]")


def between_sets(figure: Figure, book: Book) -> None:
    """Fig. 11: how much our sets differ from the judged one, beside the errors that the paper gives."""
    axes = figure.subplots(1, 2)
    cases = (("rig_level", Z, "m", (0.005, 0.014)), ("rig_inclined", ROLL, "deg", (0.004, 0.008)))
    for axis, (landing, name, unit, errors) in zip(axes, cases, strict=True):
        base = book.table(landing, book.judged_by)
        for i, other in enumerate(one for one in damped(book) if one != book.judged_by):
            table = book.table(landing, other)
            if base is not None and table is not None:
                apart = np.abs(signal(table, name) - signal(base, name)) * TO_UNIT.get(unit, 1.0)
                axis.semilogy(
                    table["time"], np.maximum(apart, 1e-7), label=f"{other} against {book.judged_by}", **styled(i)
                )
        for error in errors:
            axis.axhline(error, **DASHED)
        axis.yaxis.set_minor_formatter(NullFormatter())
        axis.set_ylim(1e-4, 1.0)
    axes[0].set_ylabel("Difference of Z [m]")
    axes[1].set_ylabel("Difference of roll [°]")
    finish(figure, axes, "Time [s]")


def point_nine(figure: Figure, book: Book) -> None:
    """Fig. 12: point 9 over time."""
    axes = four(figure, [(name, book.table("point9", name), styled(i)) for i, name in enumerate(damped(book))])
    axes[0].plot([0.0, 0.9, 25.0], [-1.45, -3.3, -1.8], **PAPER)
    axes[2].plot([4.47, 4.47], [-4.98, 4.98], **PAPER)
    axes[3].plot([25.0], [-1.2], **PAPER)
    for level in (-0.1, 0.1):
        axes[1].axhline(level, **DASHED)
    finish(figure, axes[2:], "Time [s]")


def all_points(figure: Figure, book: Book) -> None:
    """Fig. 13: all points over time, the judged set."""
    tables = [(name, book.table(name, book.judged_by)) for name in POINTS]
    curves = [
        (name.replace("point", "point "), _relative(table), {"color": colour, "linewidth": 1.0})
        for (name, table), colour in zip(tables, shades(len(POINTS)), strict=True)
    ]
    axes = four(figure, curves)
    axes[0].set_ylabel("Z since release [m]")
    for level in (-0.04, 0.06):
        axes[1].axhline(level, **DASHED)
    for axis in axes:
        axis.set_xlim(0.0, 20.0)
    finish(figure, axes[2:], "Time [s]")


def _relative(table: Table | None) -> Table | None:
    return None if table is None else {**table, Z: table[Z] - table[Z][0]}


def tension(figure: Figure, book: Book) -> None:
    """Fig. 14: tension over time, and along the line, landing at midspan."""
    over_time, along = figure.subplots(1, 2)
    table = book.table("point1", book.judged_by)
    if table is not None:
        names = tensions(table)
        for i, (name, label) in enumerate(((names[0], "midspan"), (names[-1], "tower"))):
            curve(over_time, table, name, "kN", label=label, **styled(i))
        for i, (row, label) in enumerate(((0, "before contact"), (-1, "at the end"))):
            values = np.array([table[name][row] for name in names])
            along.plot(
                np.linspace(0.0, 100.0, len(names)), values - values[0], marker="o", label=label, **styled(i + 2)
            )
    over_time.axvline(7.1, **DASHED)
    over_time.set_ylabel("Tension [kN]")
    along.set_ylabel("Tension above midspan's [N]")
    finish(figure, [over_time], "Time [s]")
    along.set_xlabel("From midspan [m]")


def masses(figure: Figure, book: Book) -> None:
    """Fig. 15: masses at point 9."""
    curves = [
        (f"{mass} kg", book.table(f"point9_{mass}kg", book.judged_by), styled(i)) for i, mass in enumerate(MASSES)
    ]
    axes = four(figure, curves)
    for level in (-0.56, -0.87, -1.15):
        axes[0].axhline(level, **DASHED)
    for level in (-0.05, 0.05):
        axes[1].axhline(level, **DASHED)
    for level in (-1.0, -7.84):
        axes[2].axhline(level, **DASHED)
    axes[3].plot([20.0, 20.0], [-0.09, -0.65], **PAPER)
    finish(figure, axes[2:], "Time [s]")


def rig(figure: Figure, book: Book) -> None:
    """Fig. 17: the rig, level and inclined."""
    curves = [
        (f"{place}, {name}", _relative(book.table(f"rig_{place}", name)), styled(i))
        for i, (place, name) in enumerate((p, n) for p in ("level", "inclined") for n in (book.judged_by, "metallic"))
    ]
    axes = four(figure, curves)
    axes[0].set_ylabel("Z since release [m]")
    rest = curves[0][1][Z][-1] if curves[0][1] is not None else 0.0
    for axis, middle, level in zip(axes[:3], (rest, 0.0, 0.0), (0.1, 0.3, 2.5), strict=True):
        for sign in (-1.0, 1.0):
            axis.axhline(middle + sign * level, **DASHED)
    for axis in axes:
        axis.set_xlim(0.0, 20.0)
    finish(figure, axes[2:], "Time [s]")


def rig_force(figure: Figure, book: Book) -> None:
    """Fig. 18: contact force on the rig."""
    axis = figure.subplots()
    for i, name in enumerate(damped(book)):
        curve(axis, book.table("rig_level", name), FORCE, "1", label=name, **styled(i))
    for level in (380.0, 400.0):
        axis.axhline(level, **DASHED)
    axis.set_xlim(0.0, 5.0)
    axis.set_ylabel("Resultant of both walls [N]")
    finish(figure, [axis], "Time [s]")


def over_points(figure: Figure, book: Book) -> None:
    """Fig. 19: peaks and their times over the points."""
    axes = list(figure.subplots(2, 2, sharex=True).flat)
    cases = ((Z, "peak", "m", "Peak of Z [m]"), (ROLL, "largest", "deg", "Peak of roll [°]"),
             (Z, "peak_time", "s", "Time of Z's peak [s]"), (ROLL, "peak_time", "s", "Time of roll's peak [s]"))  # fmt: skip
    for axis, (name, measure, unit, label) in zip(axes, cases, strict=True):
        first = (
            1 if (name, measure) == (ROLL, "peak_time") else 0
        )  # at midspan there is no roll, and no time of its peak
        shown = damped(book) if measure == "peak_time" else book.sets  # undamped, any of many peaks may be the largest
        for i, parameter_set in enumerate(shown):
            _dots(axis, book, POINTS[first:], range(first + 1, 11), parameter_set, (name, measure, unit), i)
        axis.set_ylabel(label)
    axes[0].plot([1.0, 11.0], [-0.82, -0.28], **PAPER)
    axes[1].plot([1.0, 9.0], [0.1, 4.98], **PAPER)
    axes[1].set_yscale("symlog", linthresh=1.0)
    for axis, levels in ((axes[2], (0.61, 2.02)), (axes[3], (2.43, 4.49))):
        for level in levels:
            axis.axhline(level, **DASHED)
    finish(figure, axes[2:], "Point")


def over_masses(figure: Figure, book: Book) -> None:
    """Fig. 20: peaks and their times over the mass, at midspan and at point 9."""
    axes = list(figure.subplots(2, 2, sharex=True).flat)
    cases = ((Z, "peak", "m", "Peak of Z [m]"), (ROLL, "largest", "deg", "Peak of roll [°]"),
             (Z, "peak_time", "s", "Time of Z's peak [s]"), (ROLL, "peak_time", "s", "Time of roll's peak [s]"))  # fmt: skip
    places = (("midspan", "point1"), ("point9", "point9"))
    for axis, (name, measure, unit, label) in zip(axes, cases, strict=True):
        for i, (place, middle) in enumerate(places):
            if place == "midspan" and (name, measure) == (ROLL, "peak_time"):
                continue  # no roll, and no time of its peak
            names = [f"{place}_10kg", middle, f"{place}_55kg", f"{place}_100kg"]
            _dots(axis, book, names, (10, 38, 55, 100), book.judged_by, (name, measure, unit), i, label=place)
        axis.set_ylabel(label)
    printed = ((-0.06, -0.65), (1.0, 7.8), (0.52, 0.91), (1.05, 1.40))
    for axis, values in zip(axes, printed, strict=True):
        axis.plot([10.0, 100.0], values, **PAPER)
    finish(figure, axes[2:], "Mass [kg]")


def _dots(
    axis: Axes,
    book: Book,
    landings: Sequence[str],
    at: Iterable[float],
    parameter_set: str,
    what: tuple[str, str, str],
    i: int,
    label: str | None = None,
) -> None:
    """Draw one measure over several landings."""
    name, measure, unit = what
    pairs = [(x, book.table(landing, parameter_set)) for x, landing in zip(at, landings, strict=True)]
    found = [(x, measured(table, measure, name, unit)[0]) for x, table in pairs if table is not None]
    if found:
        style = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)], "markersize": 4.0}
        axis.plot(*zip(*found, strict=True), linewidth=0.9, label=label or parameter_set, **style)  # type: ignore[arg-type]


WIDE, TALL = (7.0, 2.7), (7.0, 4.6)
DRAWINGS = (
    Drawing("fig04", "Fig. 4: shape and slope of the line at rest",
            "Dashed and crosses: the parabola with the slope of ±5.1° that the paper prints.", WIDE, line_shape),
    Drawing("fig11", "Fig. 11: how far apart models of the rig are",
            "Dashed: the mean errors that the paper gives for ANCF and for ADAMS against its experiment, whose values are not "
            "printed. Lines: what a change of the axial stiffness alone does.", WIDE, between_sets),
    Drawing("fig12", "Fig. 12: point 9", "Crosses and dashed lines: what the paper prints.", TALL, point_nine),
    Drawing("fig13", "Fig. 13: points 1 to 10", "The judged set; dashed: the band of pitch that the paper prints.", TALL,
            all_points),
    Drawing("fig14", "Fig. 14: tension along the line, landing at midspan",
            "The judged set; dashed: when the paper's has settled at its point 0. The tower bears more than midspan by the "
            "weight of the line per metre times the sag, some 30 N of 14 kN.", WIDE, tension),
    Drawing("fig15", "Fig. 15: 10, 55 and 100 kg at point 9",
            "The judged set; dashed and crosses: what the paper prints.", TALL, masses),
    Drawing("fig17", "Fig. 17: the rig", "Dashed: the amplitudes that the paper prints, about our final value.", TALL, rig),
    Drawing("fig18", "Fig. 18: contact force on the level rig, let go",
            "Dashed: 380 N, where the paper's settles, and 400 N, the peak of its experiment.", WIDE, rig_force),
    Drawing("fig19", "Fig. 19: peaks over the points",
            "Crosses: the values that the paper prints, of points 1, 9 and 11; dashed: the ends of its ranges. Roll on a scale "
            "that is linear below 1° and logarithmic above. Times of the damped sets alone.", TALL, over_points),
    Drawing("fig20", "Fig. 20: peaks over the mass",
            "The judged set; crosses: the paper's, which it gives for midspan.", TALL, over_masses),
)  # fmt: skip
"""The paper's figures, in their order."""
