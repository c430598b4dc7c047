"""Pictures for publication: axes with units, colours a colour-blind reader can tell, no titles.

Reference and coupled run stand in one figure with their difference beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

from orchestrator.compare import Comparison, matching_rows
from orchestrator.results import Table, replacing

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
STYLE = {
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


def panels_for(table: Table, reference: Table | None = None, chosen: Sequence[str] = ()) -> list[Panel]:
    """Return the panels of a landing, or those of the `chosen` signals, else of the first four."""
    common = [name for name in table if name != "time" and (reference is None or name in reference)]
    landing = [panel for panel in LANDING if panel.signal in common]
    names = [name for name in chosen if name in common] or common[:4]
    return landing or [Panel(name, name, "SI") for name in names]


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
        axis.plot(reference["time"], _shown(panel, reference), color="0.6", linewidth=2.6, label="Monolithic")
    style = {"linestyle": (0, (4, 2))} if reference is not None else {}
    axis.plot(run["time"], _shown(panel, run), color=VERMILION, linewidth=1.1, label="Coupled", **style)
    axis.set_ylabel(f"{panel.label} [{panel.unit}]")
    axis.yaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlim(run["time"][0], run["time"][-1])


def _difference_panel(axis: Axes, panel: Panel, run: Table, reference: Table) -> None:
    difference = _difference(panel.signal, run, reference) * panel.factor
    axis.semilogy(run["time"], _above_zero(difference), color=BLUE, linewidth=0.9)
    axis.set_ylabel(f"|Difference| [{panel.unit}]")
    axis.yaxis.set_major_locator(LogLocator(numticks=5))
    axis.minorticks_off()


def _shown(panel: Panel, table: Table) -> np.ndarray:
    values = table[panel.signal]
    offset = values[0] if panel.signal in RELATIVE_TO_START else 0.0
    return (values - offset) * panel.factor


def _difference(signal: str, run: Table, reference: Table) -> np.ndarray:
    return np.abs(run[signal] - reference[signal][matching_rows(reference["time"], run["time"])])


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
                axis.semilogy(run["time"], _above_zero(difference), color=colour, linewidth=0.9, label=label)
            axis.set_ylabel(f"|Δ {panel.label}|\n[{panel.unit}]")
            axis.yaxis.set_major_locator(LogLocator(numticks=5))
            axis.minorticks_off()
            axis.set_xlim(reference["time"][0], reference["time"][-1])
        axes[-1].set_xlabel("Time [s]")
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(4, len(runs))
        )
        figure.align_ylabels(axes)


def convergence(path: Path, comparison: Comparison, signals: Sequence[str]) -> None:
    """Draw the relative error of every master over the macro step, with a guide of the observed slope."""
    with _figure(path, (3.3 * len(signals) + 0.4, 3.1)) as figure:
        axes = figure.subplots(1, len(signals), squeeze=False)[0]
        for axis, signal in zip(axes, signals, strict=True):
            masters = dict.fromkeys(run.master for run in comparison.runs)
            for master, colour, marker in zip(masters, _cycle(COLOURS), _cycle(MARKERS), strict=False):
                _convergence_line(axis, comparison, master, signal, colour, marker)
            if signal in comparison.tolerance:
                axis.axhline(comparison.tolerance[signal], color=GREY, linewidth=0.9, linestyle=":")
            axis.set_xlabel("Macro step [s]")
            axis.set_ylabel(f"Relative error of\n{signal} [–]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(4, len(labels)))


def _convergence_line(
    axis: Axes, comparison: Comparison, master: str, signal: str, colour: str, marker: str
) -> None:
    runs = [run for run in comparison.runs if run.master == master and signal in run.signals]
    points = sorted((run.macro_step, run.signals[signal].relative_max_error) for run in runs)
    steps, values = np.array(points).reshape(-1, 2).T
    axis.loglog(steps, _above_zero(values), color=colour, marker=marker, markersize=4.5, label=master)
    order = comparison.observed_order.get(master, {}).get(signal, np.nan)
    if np.isfinite(order):
        guide = np.round(order) if order >= 0.5 else order
        line = values[-1] * (steps / steps[-1]) ** guide
        axis.loglog(steps, line, color=colour, linewidth=0.7, linestyle="--")
        axis.annotate(
            f"slope {guide:.2g}",
            (steps[0], line[0]),
            (4, -10),
            textcoords="offset points",
            color=colour,
            fontsize=8,
        )


def iterations(path: Path, tables: Mapping[str, Table]) -> None:
    """Draw the iterations of every macro step, and mark the steps that did not converge."""
    with _figure(path, (6.4, 2.6)) as figure:
        axis = figure.subplots()
        for (label, table), colour in zip(tables.items(), _cycle(COLOURS), strict=False):
            axis.step(
                table["time"],
                table["iterations"],
                where="pre",
                color=colour,
                linewidth=0.7,
                alpha=0.9,
                label=label,
            )
            missed = table["converged"] == 0
            if missed.any():
                axis.plot(
                    table["time"][missed],
                    table["iterations"][missed],
                    "x",
                    color=BLACK,
                    markersize=5,
                    clip_on=False,
                )
        axis.set_xlabel("Time [s]")
        axis.set_ylabel("Iterations per macro step [–]")
        axis.set_ylim(bottom=0)
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.margins(x=0.0)
        figure.legend(loc="outside upper center", ncols=4)


def shapes(path: Path, fields: Mapping[str, np.ndarray], run: Table, instants: int = 6) -> None:
    """Draw the cable in its vertical plane, with the robot's reference point, at some instants.

    Parameters
    ----------
    fields : ``time`` (n,) s, ``position`` (n, m, 3) m
    """
    time, position = fields["time"], fields["position"]
    rows = _telling_instants(run, time, instants)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(rows)))
    with _figure(path, (6.8, 3.2)) as figure:
        axis = figure.subplots()
        for row, colour in zip(rows, colours, strict=True):
            axis.plot(position[row, :, 1], position[row, :, 2], color=colour, label=f"{time[row]:.2f} s")
            k = int(np.argmin(np.abs(run["time"] - time[row])))
            robot = run["robot.body.position.y"][k], run["robot.body.position.z"][k]
            axis.plot(*robot, marker="o", markersize=6, markeredgecolor="white", color=colour)
        axis.set_xlabel("Y, along the span [m]")
        axis.set_ylabel("Z [m]")
        axis.margins(x=0.01)
        figure.legend(loc="outside right center", title="Time", alignment="left")


def _telling_instants(run: Table, time: np.ndarray, count: int) -> list[int]:
    """Return rows of `time`: start, largest descent, end, and instants spread evenly over what is left."""
    lowest = run["time"][int(np.argmin(run["robot.body.position.z"]))]
    wanted = [time[0], lowest, *np.linspace(lowest, time[-1], max(2, count - 1))[1:]]
    return sorted({int(np.argmin(np.abs(time - t))) for t in wanted})


@contextmanager
def _figure(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Give a figure in the house style and save it, whole or not at all."""
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=size)
        try:
            yield figure
            with replacing(path) as temporary:
                figure.savefig(temporary)
        finally:
            plt.close(figure)


def _cycle(items: Sequence[Any]) -> Iterator[Any]:
    while True:
        yield from items
