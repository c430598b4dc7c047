"""How pictures look: for publication, axes with units, no titles, colours a colour-blind reader can tell apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator

from orchestrator.coupling.run.results import replacing

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
LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.2, 1.2, 1.2)))
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
LEAST_RANGE = 1e-4
"""Part of the largest value that an axis shows at least: what moves less stands still."""
_note: ContextVar[str] = ContextVar("note", default="")


@contextmanager
def noted(text: str) -> Iterator[None]:
    """Let each figure saved within say `text` in its lower corner."""
    before = _note.set(text)
    try:
        yield
    finally:
        _note.reset(before)


@contextmanager
def saved(path: Path, size: tuple[float, float], dpi: float | None = None) -> Iterator[Figure]:
    """Give a figure of `size` (inches) and save it, whole or not at all: not if a run has diverged beyond any axis."""
    with matplotlib.rc_context(STYLE), np.errstate(over="ignore"):
        figure = Figure(figsize=size)
        FigureCanvasAgg(figure)  # draws without a display, and measures what is drawn
        yield figure
        if text := _note.get():
            figure.text(0.995, 0.005, text, ha="right", va="bottom", fontsize=5, color=GREY)
        with suppress(OverflowError), replacing(path, lasting=False) as temporary:
            figure.savefig(temporary, dpi=dpi or STYLE["savefig.dpi"])


def line_style(i: int, n: int = 1) -> dict[str, Any]:
    """Return colour, dashes, marker and width of line `i` of `n`: no two of 24 are alike in the first three.

    The colours come round after six lines; then the dashes change, and the markers are dealt out anew. Later lines are
    thinner, so that one shows on top of another where they coincide.
    """
    cycle, thin = i // len(COLOURS), i / max(n - 1, 1)
    style = {"color": COLOURS[i % len(COLOURS)], "linestyle": LINES[cycle % len(LINES)], "linewidth": 1.0}
    if n == 1:
        return style
    marker = MARKERS[(i + cycle) % len(MARKERS)]
    return style | {"marker": marker, "linewidth": 1.8 - 1.0 * thin, "markersize": 5.5 - 2.0 * thin}


def sparse(i: int, n: int) -> dict[str, Any]:
    """Return how line `i` of `n` over time is drawn: as `line_style`, with a few markers, each line's at other places."""
    return {**line_style(i, n), "markevery": (0.02 + 0.16 * i / n, 0.16)} if n > 1 else line_style(i)


def legend_above(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """Put a legend above all axes, in as many columns as the figure is wide."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    for columns in range(min(4, len(labels)), 0, -1):
        legend = figure.legend(handles, labels, loc="outside upper center", ncols=columns)
        if columns == 1 or legend.get_window_extent(renderer).width <= 0.98 * figure.bbox.width:
            return
        legend.remove()


def steady(axis: Axes) -> None:
    """Let a linear axis show a range that means something, few ticks, and numbers without an offset."""
    curves = [np.asarray(line.get_ydata(), float) for line in axis.lines]
    values = np.concatenate([*curves, np.zeros(0)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    least = LEAST_RANGE * max(abs(low), abs(high))
    if high - low <= least:
        middle, half = 0.5 * (low + high), 0.5 * least or 1.0
        axis.set_ylim(middle - half, middle + half)
    axis.ticklabel_format(axis="y", useOffset=False)
    axis.yaxis.set_major_locator(MaxNLocator(4))


def decades(axis: Axes) -> None:
    """Let a logarithmic axis show two decades at least, and cut off the steep start; say so where there is nothing."""
    curves = [np.asarray(line.get_ydata(), float) for line in axis.lines]
    curves = [curve[np.isfinite(curve)] for curve in curves if np.any(np.isfinite(curve))]
    axis.minorticks_off()
    if not curves:
        axis.yaxis.set_major_locator(FixedLocator([]))
        axis.text(0.5, 0.5, "none", transform=axis.transAxes, ha="center", va="center", color=GREY)
        return
    top = 2.0 * max(curve.max() for curve in curves)
    axis.set_ylim(min(0.01 * top, *(0.5 * np.percentile(curve, 3) for curve in curves)), top)
    axis.yaxis.set_major_locator(LogLocator(numticks=6))


def above_zero(values: np.ndarray) -> np.ndarray:
    """Return `values` with zeros left out, which a logarithmic axis cannot show."""
    return np.where(values > 0.0, values, np.nan)


def save_figure(figure: Figure, place: Path) -> list[Path]:
    """Write a figure as PNG, and as PDF for a paper; return the paths: `place` with their endings."""
    paths = [place.with_suffix(f".{kind}") for kind in ("png", "pdf")]
    for path in paths:
        with replacing(path, lasting=False) as temporary, matplotlib.rc_context(STYLE):
            figure.savefig(temporary, dpi=STYLE["savefig.dpi"])
    return paths
