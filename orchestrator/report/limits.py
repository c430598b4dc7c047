"""The picture of what a landing is judged by: each signal over time, within what is allowed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from orchestrator.coupling.run.results import Table
from orchestrator.landing.safety import Judged, Series, readable, series
from orchestrator.report.signals import LABELS
from orchestrator.report.style import BLACK, COLOURS, GREEN, LINES, VERMILION, legend_above, saved

SIGNS = {"deg": "°", "1": "–"}
BOTH_WAYS = ("roll", "yaw", "pitch")
"""Limits that hold to both sides of zero; what the others limit is never safer for being large."""
SPACE = 0.12
"""Part of an axis beyond what it has to show."""


def limits(path: Path, judged: Mapping[str, Judged], run: Table, tension: np.ndarray | None = None) -> Figure:
    """Draw what each limit is held against over time; what is allowed is shaded, the worst value is marked.

    Parameters
    ----------
    judged : limits by name
    run : signals at the communication points
    tension : (n, m) N along the cable, or (n,) the largest
    """
    with saved(path, (6.4, 1.35 * len(judged) + 0.6)) as figure:
        axes = figure.subplots(len(judged), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (name, one) in zip(axes, judged.items(), strict=True):
            _panel(axis, name, one, run["time"], series(name, run, one.reference, tension))
        axes[-1].set_xlabel("Time [s]")
        figure.align_ylabels(axes)
        handles = {label: h for a in axes for h, label in zip(*a.get_legend_handles_labels(), strict=True)}
        legend_above(figure, list(handles.values()), list(handles))
    return figure


def _panel(axis: Axes, name: str, judged: Judged, time: np.ndarray, found: Series) -> None:
    def shown(value: float) -> float:
        return readable(value, judged.unit)[0]

    unit = readable(0.0, judged.unit)[1]
    high = shown(judged.limit)
    low = -high if name in BOTH_WAYS else 0.0
    axis.axhspan(low, high, color=GREEN, alpha=0.1, linewidth=0.0, label="allowed")
    for level in {high, low} - {0.0}:
        axis.axhline(level, color=VERMILION, linewidth=1.0, linestyle=LINES[1], label="limit")
    for wheel, values in found.items():
        k = (wheel or 1) - 1
        style = {"color": BLACK if wheel is None else COLOURS[1:][k], "linestyle": LINES[k % len(LINES)]}
        label = None if wheel is None or len(found) == 1 else f"wheel {wheel}"
        axis.plot(time, np.array([shown(v) for v in values]), linewidth=1.1, label=label, **style)
    if np.isfinite(judged.worst):
        axis.plot(judged.time, shown(judged.worst), "o", color=VERMILION, markersize=4.5, label="worst")
    _scale(axis, low, high)
    axis.set_ylabel(f"{LABELS[name]} [{SIGNS.get(unit, unit)}]")
    words = {"1": "", "deg": "°"}.get(unit, f" {unit}")
    said = f"worst {shown(judged.worst) + 0.0:.3g}{words}, margin {shown(judged.margin) + 0.0:.3g}{words}"
    axis.set_title(said, loc="right", fontsize=7.5, pad=2.0, color=BLACK if judged.verdict == "kept" else VERMILION)


def _scale(axis: Axes, low: float, high: float) -> None:
    """Let the axis show the limits, and all of the curves that is finite."""
    curves = np.concatenate([np.asarray(line.get_ydata(), float) for line in axis.lines])
    curves = curves[np.isfinite(curves)]
    bottom, top = min(low, float(curves.min())), max(high, float(curves.max()))
    space = SPACE * (top - bottom) or 1.0
    axis.set_ylim(bottom - space, top + space)
    axis.yaxis.set_major_locator(MaxNLocator(4))
    axis.margins(x=0.0)
