"""Maps of a sweep: least margin over two values that vary, or over one; for publication, colour-blind-safe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from orchestrator.report.style import BLACK, BLUE, GREY, STYLE, VERMILION, save_figure
from orchestrator.studies.sweep.design import bare
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.ranges import Cell, cell, is_number, line, safe_ranges, unit_of, values_of
from orchestrator.studies.sweep.study import Study

COLOURS = "PuOr"
"""From orange (exceeded) over white (at the limit) to violet (kept): told apart by every kind of eye, and in grey by depth."""
MOST_CELLS = 150
"""In which the limit that binds is written."""
UNKNOWN = "failed"


def draw(study: Study, outcomes: Sequence[Outcome], x: str, y: str | None = None) -> Figure:
    """Return a picture: least margin over `x`, or over `x` and `y`; of other values, the worst."""
    with matplotlib.rc_context(STYLE):
        if y is None:
            return _line(study, outcomes, x)
        return _map(study, outcomes, x, y)


def write(folder: Path, study: Study, outcomes: Sequence[Outcome]) -> list[Path]:
    """Write the map of the first two keys that vary, or the line of the only one, as PNG and PDF; return the paths."""
    keys = [key for key, values in study.values.items() if len(values) > 1][:2]
    if not keys or not any(outcome.margins for outcome in outcomes):
        return []
    return save_figure(draw(study, outcomes, *keys), folder / "map")


def _figure(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure, figure.subplots()


def _label(study: Study, key: str) -> str:
    unit = unit_of(study, key)
    return f"{key} [{unit}]" if unit else key


def _line(study: Study, outcomes: Sequence[Outcome], x: str) -> Figure:
    cells, values = line(study, outcomes, x), [bare(value) for value in values_of(study, x)]
    figure, axis = _figure(5.5, 3.2)
    at = np.array(values, float) if all(map(is_number, values)) else np.arange(len(values))
    order = np.argsort(at)
    margins = 100.0 * np.array([one.margin for one in cells])
    axis.axhline(0.0, color=BLACK, linewidth=0.8)
    axis.plot(at[order], margins[order], color=GREY, zorder=1)
    for colour, marker, flag, name in ((BLUE, "o", True, "safe"), (VERMILION, "X", False, "not safe")):
        chosen = np.array([one.safe is flag for one in cells])
        if chosen.any():
            axis.plot(at[chosen], margins[chosen], marker, color=colour, label=name)
    for i, one in enumerate(cells):
        if one.binding and (i == 0 or cells[i - 1].binding != one.binding):
            axis.annotate(one.binding, (at[i], margins[i]), (0, 6), textcoords="offset points", ha="center", fontsize=8)
    if not all(map(is_number, values)):
        axis.set_xticks(at, [str(value) for value in values])
    axis.set_xlabel(f"{_label(study, x)}\n{safe_ranges(study, outcomes, x)}")
    axis.set_ylabel("Least margin [% of the limit]")
    axis.margins(y=0.15)
    axis.legend()
    return figure


def _map(study: Study, outcomes: Sequence[Outcome], x: str, y: str) -> Figure:
    columns, lines = values_of(study, x), values_of(study, y)
    grid = [
        [cell([o for o in outcomes if o.row.varied[x] == a and o.row.varied[y] == b]) for a in columns] for b in lines
    ]
    margins = 100.0 * np.array([[one.margin for one in row] for row in grid])
    figure, axis = _figure(max(4.5, 1.8 + 0.62 * len(columns)), max(2.8, 1.2 + 0.42 * len(lines)))
    axis.grid(visible=False)
    norm = TwoSlopeNorm(0.0, -100.0, 100.0)
    axis.set_facecolor("0.85")
    image = axis.imshow(np.clip(margins, -100.0, 100.0), norm=norm, cmap=COLOURS, origin="lower", aspect="auto")
    figure.colorbar(image, ax=axis, label="Least margin [% of the limit]")
    _outline(axis, grid)
    if margins.size <= MOST_CELLS:
        _write_limits(axis, grid, image)
    axis.set_xticks(range(len(columns)), [_tick(value) for value in columns])
    axis.set_yticks(range(len(lines)), [_tick(value) for value in lines])
    axis.set_xlabel(_label(study, x))
    axis.set_ylabel(_label(study, y))
    return figure


def _tick(value: Any) -> str:
    number = bare(value)
    return f"{number:g}" if is_number(number) else str(number)


def _outline(axis: Axes, grid: Sequence[Sequence[Cell]]) -> None:
    """Draw the outline of the safe region along the edges of its cells."""
    safe = np.pad(np.array([[one.safe is True for one in row] for row in grid]), 1)
    for j, i in zip(*np.nonzero(safe[:, 1:] != safe[:, :-1]), strict=True):
        axis.plot([i - 0.5] * 2, [j - 1.5, j - 0.5], color=BLACK, linewidth=2.2, clip_on=False)
    for j, i in zip(*np.nonzero(safe[1:] != safe[:-1]), strict=True):
        axis.plot([i - 1.5, i - 0.5], [j - 0.5] * 2, color=BLACK, linewidth=2.2, clip_on=False)


def _write_limits(axis: Axes, grid: Sequence[Sequence[Cell]], image: AxesImage) -> None:
    """Write into each cell its margin and the limit that binds."""
    for j, row in enumerate(grid):
        for i, one in enumerate(row):
            text = UNKNOWN if np.isnan(one.margin) else f"{100.0 * one.margin:.0f}\n{one.binding}"
            shade = 1.0 if np.isnan(one.margin) else _brightness(image, 100.0 * one.margin)
            axis.text(i, j, text, ha="center", va="center", fontsize=7, color="white" if shade < 0.5 else BLACK)


def _brightness(image: AxesImage, margin: float) -> float:
    """Return how bright a margin's colour is, from 0 to 1 (the weights of ITU-R BT.601)."""
    red, green, blue, _ = image.to_rgba(np.array([np.clip(margin, -100.0, 100.0)]))[0]
    return float(0.299 * red + 0.587 * green + 0.114 * blue)
