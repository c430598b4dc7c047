"""Pictures for publication: axes with units, colours a colour-blind reader can tell, no titles.

Reference and coupled run stand in one figure with their difference beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from orchestrator.coupling.run.compare import matching_rows
from orchestrator.coupling.run.results import Table, replacing
from orchestrator.landing.audit import Audit
from orchestrator.runs.compare import Comparison

matplotlib.use("Agg")

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""The palette of Okabe and Ito (2008)."""
COLOURS = (VERMILION, BLUE, GREEN, ORANGE, PURPLE, SKY)
MARKERS = ("o", "s", "^", "D", "v", "P")
GREY = "0.45"
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "figure.constrained_layout.use": True,
    "savefig.dpi": 200,
}


@dataclass(frozen=True)
class Panel:
    """One signal of a figure: its name in the tables, the axis' words and unit, the factor to that unit."""

    signal: str
    label: str
    unit: str
    factor: float = 1.0


DEGREES = 180.0 / np.pi
LANDING = (
    Panel("robot.body.position.z", "Z displacement", "m"),
    Panel("robot.roll", "Roll", "°", DEGREES),
    Panel("contact1.normal_force", "Contact force", "N"),
    Panel("cable.tension_mid", "Cable tension", "kN", 1e-3),
)
RELATIVE_TO_START = {"robot.body.position.z"}


def panels_for(
    table: Table,
    reference: Table | None = None,
    chosen: Sequence[str] = (),
    units: Mapping[str, str] = MappingProxyType({}),
) -> list[Panel]:
    """Return the panels of a landing, or those of the `chosen` signals in their `units`, else of the first four."""
    common = [name for name in table if name != "time" and (reference is None or name in reference)]
    landing = [panel for panel in LANDING if panel.signal in common]
    names = [name for name in chosen if name in common] or common[:4]
    return landing or [Panel(name, name, units.get(name) or "FMU's unit") for name in names]


def overview(path: Path, run: Table, reference: Table | None, panels: Sequence[Panel]) -> None:
    """Draw the run's main signals over time; with a reference also the reference and the difference.

    Parameters
    ----------
    run, reference : columns by name; every time of `run` is among the reference's
    """
    columns = 1 if reference is None else 2
    with _figure(path, (7.2 if reference else 4.8, 1.55 * len(panels) + 0.5)) as figure:
        axes = figure.subplots(len(panels), columns, sharex=True, squeeze=False)
        for row, panel in zip(axes, panels, strict=True):
            _signal_panel(row[0], panel, run, reference)
            if reference is not None:
                _difference_panel(row[1], panel, run, reference)
        for axis in axes[-1]:
            axis.set_xlabel("Time [s]")
        if reference is not None:
            figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels(axes)


def _signal_panel(axis: Axes, panel: Panel, run: Table, reference: Table | None) -> None:
    if reference is not None:
        axis.plot(reference["time"], _shown(panel, reference), color="0.6", linewidth=2.6, label="Reference")
    line = (0, (4, 2)) if reference is not None else "-"
    axis.plot(run["time"], _shown(panel, run), color=VERMILION, linewidth=1.1, label="Coupled", linestyle=line)
    axis.set_ylabel(f"{panel.label} [{panel.unit}]")
    axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlim(run["time"][0], run["time"][-1])


def _difference_panel(axis: Axes, panel: Panel, run: Table, reference: Table) -> None:
    difference = _difference(panel.signal, run, reference) * panel.factor
    _logarithmic(axis, run["time"], difference, BLUE)
    _decades(axis)
    axis.set_ylabel(f"|Difference| [{panel.unit}]")


def _shown(panel: Panel, table: Table) -> np.ndarray:
    values = table[panel.signal]
    offset = values[0] if panel.signal in RELATIVE_TO_START else 0.0
    return (values - offset) * panel.factor


def _difference(signal: str, run: Table, reference: Table) -> np.ndarray:
    return np.abs(run[signal] - reference[signal][matching_rows(reference["time"], run["time"])])


def _envelope(time: np.ndarray, values: np.ndarray, bins: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the largest value in each of `bins` short spans: a difference without its zero crossings."""
    groups = np.array_split(np.arange(len(time)), min(bins, len(time)))
    return np.array([time[g].mean() for g in groups]), np.array([values[g].max() for g in groups])


def _logarithmic(axis: Axes, time: np.ndarray, values: np.ndarray, colour: str, label: str | None = None) -> None:
    """Draw the envelope of a difference on a logarithmic axis."""
    t, largest = _envelope(time, values)
    axis.semilogy(t, _above_zero(largest), color=colour, linewidth=0.9, label=label)


def _decades(axis: Axes) -> None:
    """Let a logarithmic axis show two decades at least, and cut off the steep start."""
    curves = [np.asarray(line.get_ydata(), float) for line in axis.lines]
    curves = [curve[np.isfinite(curve)] for curve in curves if np.any(np.isfinite(curve))]
    if curves:
        top = 2.0 * max(curve.max() for curve in curves)
        axis.set_ylim(min(0.01 * top, *(0.5 * np.percentile(curve, 3) for curve in curves)), top)
    axis.yaxis.set_major_locator(LogLocator(numticks=6))
    axis.minorticks_off()


def _above_zero(values: np.ndarray) -> np.ndarray:
    """Return `values` with zeros left out, which a logarithmic axis cannot show."""
    return np.where(values > 0.0, values, np.nan)


def errors(path: Path, runs: Mapping[str, Table], reference: Table, panels: Sequence[Panel]) -> None:
    """Draw the difference of every run from the reference over time, one panel a signal.

    Parameters
    ----------
    runs : tables by the label that the legend shows
    """
    with _figure(path, (6.4, 1.7 * len(panels) + 0.6)) as figure:
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, panel in zip(axes, panels, strict=True):
            for (label, run), colour in zip(runs.items(), _cycle(COLOURS), strict=False):
                difference = _difference(panel.signal, run, reference) * panel.factor
                _logarithmic(axis, run["time"], difference, colour, label)
            _decades(axis)
            axis.set_ylabel(f"|Δ {panel.label}|\n[{panel.unit}]")
            axis.set_xlim(reference["time"][0], reference["time"][-1])
        axes[-1].set_xlabel("Time [s]")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(4, len(runs)))
        figure.align_ylabels(axes)


def convergence(path: Path, comparison: Comparison) -> None:
    """Draw the relative error of every master over the macro step, with its slope and what is allowed."""
    masters = dict.fromkeys(run.master for run in comparison.runs)
    with _figure(path, (3.4 * len(comparison.tolerance) + 0.4, 3.2)) as figure:
        axes = figure.subplots(1, len(comparison.tolerance), squeeze=False)[0]
        for axis, (signal, tolerance) in zip(axes, comparison.tolerance.items(), strict=True):
            for master, colour, marker in zip(masters, _cycle(COLOURS), _cycle(MARKERS), strict=False):
                _convergence_line(axis, comparison, master, signal, colour, marker)
            axis.axhline(tolerance, color=GREY, linewidth=0.9, linestyle=":")
            where = axis.get_yaxis_transform()
            axis.text(0.99, tolerance, "allowed", transform=where, ha="right", va="bottom", color=GREY, fontsize=8)
            _macro_step_axis(axis, comparison)
            axis.set_ylabel(f"Relative error, {_words(signal)} [–]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(4, len(labels)))


def work_precision(path: Path, comparison: Comparison) -> None:
    """Draw the relative error of all masters over wall time and over cable solves; a line joins the macro steps."""
    masters, signals = list(dict.fromkeys(run.master for run in comparison.runs)), list(comparison.tolerance)
    with _figure(path, (6.6, 2.9 * len(signals) + 0.6)) as figure:
        axes = figure.subplots(len(signals), 2, sharex="col", sharey="row", squeeze=False)
        for row, signal in zip(axes, signals, strict=True):
            for i, master in enumerate(masters):
                style = {"color": COLOURS[i % 6], "marker": MARKERS[(i + i // 6) % 6], "markersize": 4.5}
                style |= {"label": master, "linestyle": "-" if i < 6 else "--"}
                runs = sorted((r for r in comparison.runs if r.master == master), key=lambda r: r.macro_step)
                runs = [r for r in runs if signal in r.signals and np.isfinite(r.signals[signal].relative_max_error)]
                values = _above_zero(np.array([r.signals[signal].relative_max_error for r in runs]))
                row[0].loglog([r.wall_s for r in runs], values, **style)
                row[1].loglog([r.cable_steps for r in runs], values, **style)
            row[0].set_ylabel(f"Relative error, {_words(signal)} [–]")
        for axis in axes[-1]:
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_locator(NullLocator())
        axes[-1][0].set_xlabel("Wall time [s]")
        axes[-1][1].set_xlabel("Cable solves [–]")
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=min(4, len(masters)))


def _words(signal: str) -> str:
    """Return what a panel calls `signal`, or its own name."""
    return next((panel.label for panel in LANDING if panel.signal == signal), signal)


def _macro_step_axis(axis: Axes, comparison: Comparison) -> None:
    """Let the axis show the macro steps that were run, in ms, and nothing else."""
    steps = sorted({run.macro_step for run in comparison.runs})
    axis.set_xticks(steps, [f"{1e3 * step:g}" for step in steps])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set_xlim(steps[0] / 1.25, steps[-1] * 1.25)
    axis.set_xlabel("Macro step [ms]")


def _convergence_line(axis: Axes, comparison: Comparison, master: str, signal: str, colour: str, marker: str) -> None:
    runs = [run for run in comparison.runs if run.master == master and signal in run.signals]
    points = sorted((run.macro_step, run.signals[signal].relative_max_error) for run in runs)
    steps, values = np.array(points).reshape(-1, 2).T
    axis.loglog(steps, _above_zero(values), color=colour, marker=marker, markersize=4.5, label=master)
    order = comparison.observed_order.get(master, {}).get(signal, np.nan)
    if np.isfinite(order):
        middle = float(np.sqrt(steps[0] * steps[-1])), float(np.sqrt(values[0] * values[-1]))
        axis.annotate(f"slope {order:.1f}", middle, (6, -12), textcoords="offset points", color=colour, fontsize=8)


def iterations(path: Path, tables: Mapping[str, Table], bins: int = 250) -> None:
    """Draw the iterations of a macro step, mean and range; crosses are unconverged steps."""
    with _figure(path, (6.4, 2.6)) as figure:
        axis = figure.subplots()
        for (label, table), colour in zip(tables.items(), _cycle(COLOURS), strict=False):
            groups = np.array_split(np.arange(len(table["time"])), min(bins, len(table["time"])))
            time = [table["time"][group[-1]] for group in groups]
            counts = [table["iterations"][group] for group in groups]
            low, mean, high = ([f(c) for c in counts] for f in (np.min, np.mean, np.max))
            axis.fill_between(time, low, high, step="pre", color=colour, alpha=0.25, linewidth=0.0)
            axis.step(time, mean, where="pre", color=colour, linewidth=1.0, label=label)
            missed = table["converged"] == 0
            axis.plot(table["time"][missed], table["iterations"][missed], "x", color=BLACK, markersize=5)
        axis.set_xlabel("Time [s]")
        axis.set_ylabel("Iterations per macro step [–]")
        axis.set_ylim(bottom=0)
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.margins(x=0.0)
        figure.legend(loc="outside upper center", ncols=min(4, len(tables)))


def shapes(path: Path, fields: Mapping[str, np.ndarray], run: Table) -> None:
    """Draw the cable in its vertical plane and its displacement since the start, at some instants.

    Dots are the robot's reference point.

    Parameters
    ----------
    fields : ``time`` (n,) s, ``position`` (n, m, 3) m
    """
    time, position = fields["time"], fields["position"]
    rows = _telling_instants(run, time)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(rows)))
    with _figure(path, (6.8, 4.4)) as figure:
        shape, change = figure.subplots(2, 1, sharex=True)
        for row, colour in zip(rows, colours, strict=True):
            y, z = position[row, :, 1], position[row, :, 2]
            shape.plot(y, z, color=colour, label=f"{time[row]:.2f} s")
            k = int(np.argmin(np.abs(run["time"] - time[row])))
            robot = run["robot.body.position.y"][k], run["robot.body.position.z"][k]
            shape.plot(*robot, marker="o", markersize=6, markeredgecolor="white", color=colour)
            change.plot(y, z - position[0, :, 2], color=colour)
        shape.set_ylabel("Z [m]")
        change.set_ylabel("Z displacement [m]")
        change.set_xlabel("Y, along the span [m]")
        change.margins(x=0.01)
        figure.align_ylabels()
        figure.legend(*shape.get_legend_handles_labels(), loc="outside right center", title="Time")


def energy(path: Path, audit: Audit) -> None:
    """Draw the energy's terms over time, and below them the drift of their sum with its sources."""
    residual = np.abs(audit.residual)
    with _figure(path, (6.4, 5.2)) as figure:
        terms, drift = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for (label, values), colour in zip(audit.groups.items(), _cycle(COLOURS), strict=False):
            terms.plot(audit.time, values, color=colour, linewidth=1.0, label=label)
        terms.plot(audit.time, audit.residual, color=BLACK, linewidth=1.0, linestyle="--", label="Sum")
        terms.set_ylabel("Change of energy [J]")
        drift.semilogy(audit.time, _above_zero(residual), color=BLACK, linewidth=1.2, label="Sum")
        sources = {name: np.abs(values) for name, values in audit.sources.items() if np.any(values)}
        for (name, values), colour in zip(sources.items(), _cycle(COLOURS), strict=False):
            drift.semilogy(audit.time, _above_zero(values), color=colour, linewidth=0.8, label=name)
        if np.isfinite(audit.allowed):
            drift.axhline(audit.allowed, color=GREY, linewidth=0.9, linestyle=":", label="allowed")
        peak = max(float(np.max(residual)), 1e-12)
        drift.set_ylim(1e-4 * peak, 3.0 * max(peak, audit.allowed if np.isfinite(audit.allowed) else 0.0))
        drift.set_ylabel("|Drift| [J]")
        drift.set_xlabel("Time [s]")
        for axis in (terms, drift):
            axis.margins(x=0.0)
            axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        figure.align_ylabels()


def _telling_instants(run: Table, time: np.ndarray) -> list[int]:
    """Return rows of `time`: the start, two on the way down, the first low point, the rebound, the end."""
    t, z = run["time"], run["robot.body.position.z"]
    deep = z[:-1] <= 0.5 * (np.min(z) + np.max(z))
    rising = np.append(np.diff(z) > 0.0, True)
    low = int(np.argmax(np.append(deep, True) & rising))
    rebound = low + int(np.argmin(np.append(rising[low:-1], False)))
    down = np.linspace(t[0], t[low], 4)
    return sorted({int(np.argmin(np.abs(time - at))) for at in (*down, t[rebound], t[-1])})


@contextmanager
def _figure(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Give a figure in the house style and save it, whole or not at all: not if a run has diverged beyond any axis."""
    with matplotlib.rc_context(STYLE), np.errstate(over="ignore"):
        figure = plt.figure(figsize=size)
        try:
            yield figure
            with suppress(OverflowError), replacing(path) as temporary:
                figure.savefig(temporary)
        finally:
            plt.close(figure)


def _cycle(items: Sequence[Any]) -> Iterator[Any]:
    while True:
        yield from items
