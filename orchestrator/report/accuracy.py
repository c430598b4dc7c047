"""The pictures of a comparison: error over the macro step, and over what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from orchestrator.report.signals import words
from orchestrator.report.style import GREY, above_zero, legend_above, line_style, saved
from orchestrator.runs.compare import Comparison, RunErrors


def convergence(path: Path, comparison: Comparison) -> Figure:
    """Draw the relative error of every master over the macro step, with its slope and what is allowed."""
    masters = masters_of(comparison)
    with saved(path, (3.7 * len(comparison.tolerance) + 0.4, 3.2 + 0.1 * len(masters))) as figure:
        axes = figure.subplots(1, len(comparison.tolerance), squeeze=False)[0]
        for axis, (signal, tolerance) in zip(axes, comparison.tolerance.items(), strict=True):
            for i, master in enumerate(masters):
                _error_line(axis, comparison, master, signal, i, len(masters))
            _slopes(axis, comparison, signal)
            axis.axhline(tolerance, color=GREY, linewidth=0.9, linestyle=":")
            where = axis.get_yaxis_transform()
            axis.text(0.99, tolerance, "allowed", transform=where, ha="right", va="bottom", color=GREY, fontsize=8)
            _macro_steps(axis, comparison)
            axis.set_ylabel(f"Relative error, {words(signal)} [–]")
        legend_above(figure, *axes[0].get_legend_handles_labels())
    return figure


def _error_line(axis: Axes, comparison: Comparison, master: str, signal: str, i: int, n: int) -> None:
    runs = _of_master(comparison, master, signal)
    steps = np.array([run.macro_step for run in runs])
    values = above_zero(np.array([run.signals[signal].relative_max_error for run in runs]))
    axis.loglog(steps, values, **line_style(i, max(n, 2)), label=master)


def _slopes(axis: Axes, comparison: Comparison, signal: str) -> None:
    """List the observed orders beside the axes, each by the line it belongs to."""
    orders = [comparison.observed_order.get(m, {}).get(signal, np.nan) for m in masters_of(comparison)]
    known = [(line, f"{order:.1f}") for line, order in zip(axis.lines, orders, strict=False) if np.isfinite(order)]
    if known:
        lines, texts = zip(*known, strict=True)
        where = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "handlelength": 1.2}
        axis.legend(lines, texts, title="Slope", title_fontsize=8, fontsize=8, **where)


def work_precision(path: Path, comparison: Comparison) -> Figure:
    """Draw the relative error of all masters over wall time and over cable solves; a line joins the macro steps."""
    masters, signals = masters_of(comparison), list(comparison.tolerance)
    with saved(path, (6.6, 2.9 * len(signals) + 0.8)) as figure:
        axes = figure.subplots(len(signals), 2, sharex="col", sharey="row", squeeze=False)
        for row, signal in zip(axes, signals, strict=True):
            for i, master in enumerate(masters):
                runs = _of_master(comparison, master, signal)
                values = above_zero(np.array([r.signals[signal].relative_max_error for r in runs]))
                style = line_style(i, max(len(masters), 2)) | {"label": master}
                row[0].loglog([r.wall_s for r in runs], values, **style)
                row[1].loglog([r.cable_steps for r in runs], values, **style)
            row[0].set_ylabel(f"Relative error, {words(signal)} [–]")
        for axis, label in zip(axes[-1], ("Wall time [s]", "Cable solves [–]"), strict=True):
            _plain_numbers(axis)
            axis.set_xlabel(label)
        legend_above(figure, *axes[0][0].get_legend_handles_labels())
    return figure


def masters_of(comparison: Comparison) -> Sequence[str]:
    """Return the masters that were compared, each once."""
    return list(dict.fromkeys(run.master for run in comparison.runs))


def _of_master(comparison: Comparison, master: str, signal: str) -> list[RunErrors]:
    """Return the runs of `master` in which the error of `signal` is known, by rising macro step."""
    runs = [r for r in comparison.runs if r.master == master and signal in r.signals]
    known = [r for r in runs if np.isfinite(r.signals[signal].relative_max_error)]
    return sorted(known, key=lambda run: run.macro_step)


def _macro_steps(axis: Axes, comparison: Comparison) -> None:
    """Let the axis show the macro steps that were run, in ms, and nothing else."""
    steps = sorted({run.macro_step for run in comparison.runs})
    axis.set_xticks(steps, [f"{1e3 * step:g}" for step in steps])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set_xlim(steps[0] / 1.25, steps[-1] * 1.25)
    axis.set_xlabel("Macro step [ms]")


def _plain_numbers(axis: Axes) -> None:
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_locator(NullLocator())
