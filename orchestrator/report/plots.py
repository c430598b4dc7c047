"""The pictures of one run, and of several together, over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from orchestrator.coupling.run.compare import matching_rows
from orchestrator.coupling.run.results import Table
from orchestrator.landing.audit import Audit
from orchestrator.landing.flight import Flight
from orchestrator.report.signals import Panel, shown
from orchestrator.report.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    LINES,
    above_zero,
    decades,
    legend_above,
    line_style,
    saved,
    sparse,
    steady,
)

AIR = "0.93"
"""Colour of the spans in which no wheel touches."""
LEGEND_SPACE = 0.2
LEGEND_COLUMNS = 5
"""Part of an axis' range that is added above the curves for a legend."""
BINS = 250
"""Spans of time of which largest values, ranges and means are drawn."""


# -- signals --------------------------------------------------------------------------------------------------


def overview(
    path: Path, run: Table, reference: Table | None, panels: Sequence[Panel], flight: Flight | None = None
) -> Figure:
    """Draw the run's main signals over time; with a reference also the reference and the difference.

    Parameters
    ----------
    run, reference : columns by name; every time of `run` is among the reference's
    flight : when the robot was in the air; those spans are shaded in the panel of the contact forces
    """
    columns = 1 if reference is None else 2
    with saved(path, (7.2 if reference else 4.8, 1.55 * len(panels) + 0.5)) as figure:
        axes = figure.subplots(len(panels), columns, sharex=True, squeeze=False)
        for row, panel in zip(axes, panels, strict=True):
            _signals(row[0], panel, run, reference)
            if flight is not None and any(".normal_force" in signal for signal in panel.lines):
                _shade(row[0], flight)
            _legend_inside(row[0])
            if reference is not None:
                _differences(row[1], panel.among(reference), run, reference)
        for axis in axes[-1]:
            axis.set_xlabel("Time [s]")
        if reference is not None:
            _name_both(figure)
        figure.align_ylabels(axes)
    return figure


def _signals(axis: Axes, panel: Panel, run: Table, reference: Table | None) -> None:
    for i, (signal, words) in enumerate(panel.lines.items()):
        colour = COLOURS[i % len(COLOURS)]
        if reference is not None and signal in reference:
            axis.plot(reference["time"], panel.values(signal, reference), color=colour, alpha=0.3, linewidth=2.8)
        dashes = LINES[1] if reference is not None else LINES[i // 2 % len(LINES)]  # lines may lie on each other
        if (peak := panel.peak(signal, run)) is not None:  # of every macro step, over its length
            axis.plot(run["time"], peak, color=colour, linewidth=0.6, alpha=0.7, drawstyle="steps-pre")
        axis.plot(run["time"], panel.values(signal, run), color=colour, linewidth=1.0, linestyle=dashes, label=words)
    axis.set_ylabel(panel.axis)
    axis.set_xlim(run["time"][0], run["time"][-1])
    steady(axis)


def _shade(axis: Axes, flight: Flight) -> None:
    """Shade the spans in which no wheel touches, and say how long they are together."""
    label: str | None = f"in the air, {flight.total:.2g} s"
    for first, end in flight.spans:
        axis.axvspan(first, end, color=AIR, linewidth=0.0, zorder=0, label=label)
        label = None


def _legend_inside(axis: Axes) -> None:
    """Put a legend into the axes, above all curves, if there is more than one thing to tell apart."""
    labels = axis.get_legend_handles_labels()[1]
    if not labels:
        return
    columns = min(len(labels), LEGEND_COLUMNS)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high + LEGEND_SPACE * -(-len(labels) // columns) * (high - low))
    size = 7.5 if columns < LEGEND_COLUMNS else 6.5
    axis.legend(loc="upper right", ncols=columns, fontsize=size, handlelength=1.4, columnspacing=1.0, borderpad=0.1)


def _name_both(figure: Figure) -> None:
    """Say which lines are the reference's and which the coupled run's."""
    lines = [
        Line2D([], [], color=GREY, alpha=0.5, linewidth=2.8),
        Line2D([], [], color=BLACK, linewidth=1.0, linestyle=LINES[1]),
    ]
    legend_above(figure, lines, ["Reference", "Coupled"])


def _differences(axis: Axes, panel: Panel, run: Table, reference: Table) -> None:
    for i, signal in enumerate(panel.lines):
        colour = COLOURS[i % len(COLOURS)] if len(panel.lines) > 1 else BLUE
        _logarithmic(axis, run["time"], _difference(panel, signal, run, reference), color=colour)
    decades(axis)
    axis.set_ylabel(f"|Difference| [{panel.unit}]" if panel.unit else "|Difference|")


def _difference(panel: Panel, signal: str, run: Table, reference: Table) -> np.ndarray:
    """Return the magnitude of a signal's difference at the times of `run`, (n,), in the panel's unit."""
    rows = matching_rows(reference["time"], run["time"])
    return np.abs(shown(run[signal] - reference[signal][rows], panel.own_unit)) * panel.factor


def _logarithmic(axis: Axes, time: np.ndarray, values: np.ndarray, **style: object) -> None:
    """Draw the largest value in each of many short spans: a difference without its zero crossings."""
    groups = np.array_split(np.arange(len(time)), min(BINS, len(time)))
    largest = np.array([values[group].max() for group in groups])
    middle = np.array([time[group].mean() for group in groups])
    values = above_zero(largest)
    if not np.isfinite(values).any():
        style = style | {"markevery": None}  # a line without a point has no length to space marks along
    axis.semilogy(middle, values, **{"linewidth": 0.9} | style)  # type: ignore[arg-type]


def errors(path: Path, runs: Mapping[str, Table], reference: Table, panels: Sequence[Panel]) -> Figure:
    """Draw the difference of every run from the reference over time; where a panel has several signals, the largest.

    Parameters
    ----------
    runs : tables by the label that the legend shows
    """
    with saved(path, (6.4, 1.7 * len(panels) + 0.5 + 0.06 * len(runs))) as figure:
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, panel in zip(axes, panels, strict=True):
            for i, (label, run) in enumerate(runs.items()):
                common = panel.among(run).among(reference)
                largest = np.max([_difference(common, s, run, reference) for s in common.lines], axis=0)
                _logarithmic(axis, run["time"], largest, **sparse(i, len(runs)), label=label)
            decades(axis)
            axis.set_ylabel(f"|Δ {panel.label}|\n[{panel.unit}]" if panel.unit else f"|Δ {panel.label}|")
            axis.set_xlim(reference["time"][0], reference["time"][-1])
        axes[-1].set_xlabel("Time [s]")
        legend_above(figure, *axes[0].get_legend_handles_labels())
        figure.align_ylabels(axes)
    return figure


# -- the master -----------------------------------------------------------------------------------------------


def iterations(path: Path, tables: Mapping[str, Table]) -> Figure:
    """Draw the iterations of a macro step, mean and (of few runs) range; crosses are unconverged steps."""
    with saved(path, (6.4, 2.6 + 0.06 * len(tables))) as figure:
        axis = figure.subplots()
        for i, (label, table) in enumerate(tables.items()):
            _iterations_of(axis, table, i, len(tables), label)
        axis.set_xlabel("Time [s]")
        axis.set_ylabel("Iterations per macro step [–]")
        axis.set_ylim(bottom=0)
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.margins(x=0.0)
        legend_above(figure, *axis.get_legend_handles_labels())
    return figure


def _iterations_of(axis: Axes, table: Table, i: int, n: int, label: str) -> None:
    groups = np.array_split(np.arange(len(table["time"])), min(BINS, len(table["time"])))
    time = [table["time"][group[-1]] for group in groups]
    counts = [table["iterations"][group] for group in groups]
    low, mean, high = ([f(c) for c in counts] for f in (np.min, np.mean, np.max))
    if n <= 3:
        axis.fill_between(time, low, high, step="pre", color=COLOURS[i], alpha=0.25, linewidth=0.0)
    axis.step(time, mean, where="pre", label=label, **sparse(i, n))
    missed = table["converged"] == 0
    axis.plot(table["time"][missed], table["iterations"][missed], "x", color=BLACK, markersize=5)


# -- the cable ------------------------------------------------------------------------------------------------


def shapes(path: Path, fields: Mapping[str, np.ndarray], run: Table) -> Figure:
    """Draw the cable in its vertical plane and its displacement since the start, at some instants.

    Dots are the robot's reference point.

    Parameters
    ----------
    fields : ``time`` (n,) s, ``arc_length`` (m,) m, ``position`` (n, m, 3) m
    """
    time, position = fields["time"], fields["position"]
    rows = _telling_instants(run, time)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(rows)))
    with saved(path, (6.8, 4.4)) as figure:
        shape, change = figure.subplots(2, 1, sharex=True)
        for row, colour in zip(rows, colours, strict=True):
            y, z, dz = smooth(fields["arc_length"], [*position[row, :, 1:].T, (position[row] - position[0])[:, 2]])
            shape.plot(y, z, color=colour, label=f"{time[row]:.2f} s")
            change.plot(y, dz, color=colour)
            k = int(np.argmin(np.abs(run["time"] - time[row])))
            robot = run["robot.body.position.y"][k], run["robot.body.position.z"][k]
            shape.plot(*robot, marker="o", markersize=6, markeredgecolor="white", color=colour)
        shape.set_ylabel("Z [m]")
        change.set_ylabel("Z displacement [m]")
        change.set_xlabel("Y, along the span [m]")
        change.margins(x=0.01)
        figure.align_ylabels()
        figure.legend(*shape.get_legend_handles_labels(), loc="outside right center", title="Time")
    return figure


def smooth(s: np.ndarray, columns: Sequence[np.ndarray], between: int = 12) -> list[np.ndarray]:
    """Return smooth curves through the values of `columns` (m,) each at the arc lengths `s` (m,), `between` points a span.

    Akima's piecewise cubic: it goes through every point, with a continuous slope, and does not swing beside the kink
    under a wheel as a spline of least bending does (Akima, J. ACM 17 (1970), 589).
    """
    from scipy.interpolate import Akima1DInterpolator

    fine = np.interp(np.arange(between * (len(s) - 1) + 1) / between, np.arange(len(s)), s)
    return [Akima1DInterpolator(s, values)(fine) for values in columns]


def _telling_instants(run: Table, time: np.ndarray) -> list[int]:
    """Return rows of `time`: the start, two on the way down, the first low point, the rebound, the end."""
    t, z = run["time"], run["robot.body.position.z"]
    deep = z[:-1] <= 0.5 * (np.min(z) + np.max(z))
    rising = np.append(np.diff(z) > 0.0, True)
    low = int(np.argmax(np.append(deep, True) & rising))
    rebound = low + int(np.argmin(np.append(rising[low:-1], False)))
    down = np.linspace(t[0], t[low], 4)
    return sorted({int(np.argmin(np.abs(time - at))) for at in (*down, t[rebound], t[-1])})


# -- energy ---------------------------------------------------------------------------------------------------


def energy(path: Path, audit: Audit) -> Figure:
    """Draw the energy's terms over time, and below them the drift of their sum with its sources."""
    with saved(path, (6.8, 5.2)) as figure:
        terms, drift = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for i, (label, values) in enumerate(audit.groups.items()):
            terms.plot(audit.time, values, label=label, **line_style(i))
        terms.plot(audit.time, audit.residual, color=BLACK, linewidth=1.0, linestyle="--", label="Sum")
        terms.set_ylabel("Change of energy [J]")
        _drift(drift, audit)
        drift.set_ylabel("|Drift| [J]")
        drift.set_xlabel("Time [s]")
        for axis in (terms, drift):
            axis.margins(x=0.0)
            axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        figure.align_ylabels()
    return figure


def _drift(axis: Axes, audit: Audit) -> None:
    residual = np.abs(audit.residual)
    axis.semilogy(audit.time, above_zero(residual), color=BLACK, linewidth=1.2, label="Sum")
    sources = {name: np.abs(values) for name, values in audit.sources.items() if np.any(values)}
    for i, (name, values) in enumerate(sources.items()):
        axis.semilogy(audit.time, above_zero(values), label=name, **line_style(i))
    if np.isfinite(audit.allowed):
        axis.axhline(audit.allowed, color=GREY, linewidth=0.9, linestyle=":", label="allowed")
    peak = max(float(np.max(residual)), 1e-12)
    axis.set_ylim(1e-4 * peak, 3.0 * max(peak, audit.allowed if np.isfinite(audit.allowed) else 0.0))
