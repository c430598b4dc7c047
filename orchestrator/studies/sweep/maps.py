"""Maps of a sweep: least margin over two values that vary, or over one; for publication, colour-blind-safe."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from orchestrator.report.style import BLACK, BLUE, GREY, MARKERS, STYLE, VERMILION, save_figure
from orchestrator.studies.sweep.atlas import Axis, Spot, axis_of, shown, spots
from orchestrator.studies.sweep.design import bare
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.ranges import Cell, cell, is_number, line, safe_ranges, values_of
from orchestrator.studies.sweep.study import Study

COLOURS = "PuOr"
"""From orange (exceeded) over white (at the limit) to violet (kept): told apart by every kind of eye, and in grey by depth."""
NORM = TwoSlopeNorm(0.0, -100.0, 100.0)
MOST_CELLS = 150
"""In which the limit that binds is written."""
UNKNOWN = "failed"


def draw(study: Study, outcomes: Sequence[Outcome], x: str, y: str | None = None) -> Figure:
    """Return a picture: least margin over `x`, or over `x` and `y`; of other values, the worst."""
    study, outcomes = shown(study, outcomes, [x] if y is None else [x, y])
    with matplotlib.rc_context(STYLE):
        if y is None:
            return _line(study, outcomes, x)
        axes = axis_of(study, outcomes, x), axis_of(study, outcomes, y)
        return _divided(study, outcomes, axes) if any(one.is_refined for one in axes) else _map(study, outcomes, axes)


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


def _line(study: Study, outcomes: Sequence[Outcome], x: str) -> Figure:
    cells, values = line(study, outcomes, x), [bare(v) for v in values_of(study, x, outcomes)]
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
    for before, i in pairwise([-1, *order]):
        if cells[i].binding and (before < 0 or cells[before].binding != cells[i].binding):
            place = (at[i], margins[i])
            axis.annotate(cells[i].binding, place, (0, 6), textcoords="offset points", ha="center", fontsize=8)
    if not all(map(is_number, values)):
        axis.set_xticks(at, [str(value) for value in values])
    axis.set_xlabel(f"{axis_of(study, outcomes, x).title}\n{safe_ranges(study, outcomes, x)}")
    axis.set_ylabel("Least margin [% of the limit]")
    axis.margins(y=0.15)
    axis.legend()
    return figure


def _map(study: Study, outcomes: Sequence[Outcome], axes: tuple[Axis, Axis]) -> Figure:
    """Return the map of a grid: each value has a step, whatever lies between."""
    (columns, lines), (x, y) = ([*map(bare, values_of(study, axis.key))] for axis in axes), (axis.key for axis in axes)
    grid = [
        [cell([o for o in outcomes if o.row.inputs[x] == a and o.row.inputs[y] == b]) for a in columns] for b in lines
    ]
    margins = 100.0 * np.array([[one.margin for one in row] for row in grid])
    figure, axis = _figure(max(4.5, 1.8 + 0.62 * len(columns)), max(2.8, 1.2 + 0.42 * len(lines)))
    axis.grid(visible=False)
    axis.set_facecolor("0.85")
    image = axis.imshow(np.clip(margins, -100.0, 100.0), norm=NORM, cmap=COLOURS, origin="lower", aspect="auto")
    figure.colorbar(image, ax=axis, label="Least margin [% of the limit]")
    safe = np.array([[one.safe is True for one in row] for row in grid])
    outline(axis, safe, np.arange(len(columns) + 1) - 0.5, np.arange(len(lines) + 1) - 0.5)
    if margins.size <= MOST_CELLS:
        _write_limits(axis, grid, image)
    axis.set_xticks(range(len(columns)), [tick(value) for value in columns])
    axis.set_yticks(range(len(lines)), [tick(value) for value in lines])
    axis.set_xlabel(axes[0].title)
    axis.set_ylabel(axes[1].title)
    return figure


def _divided(study: Study, outcomes: Sequence[Outcome], axes: tuple[Axis, Axis]) -> Figure:
    """Return the map whose outline was refined: every run has the part of it that is nearest; its marker is its limit."""
    found = spots(study, outcomes, axes)
    edges = [np.unique([end for spot in found for part in spot.areas for end in part[i]]) for i in (0, 1)]
    margins = np.full((len(edges[1]) - 1, len(edges[0]) - 1), np.nan)
    safe = np.zeros(margins.shape, bool)
    for spot in found:
        for part in spot.areas:
            columns, lines = (
                slice(*np.searchsorted(all_ends, ends)) for all_ends, ends in zip(edges, part, strict=True)
            )
            margins[lines, columns], safe[lines, columns] = 100.0 * spot.cell.margin, spot.cell.safe is True
    figure, axis = _figure(6.4, 3.8)
    axis.grid(visible=False)
    axis.set_facecolor("0.85")
    image = axis.pcolormesh(*edges, np.clip(margins, -100.0, 100.0), norm=NORM, cmap=COLOURS)
    figure.colorbar(image, ax=axis, label="Least margin [% of the limit]")
    outline(axis, safe, *edges)
    _mark_limits(axis, found, axes)
    for one, ticks in zip(axes, (axis.set_xticks, axis.set_yticks), strict=True):
        if not one.has_numbers:
            ticks(range(len(one.values)), [tick(value) for value in one.values])
    axis.set_xlabel(axes[0].title)
    axis.set_ylabel(axes[1].title)
    return figure


def _mark_limits(axis: Axes, found: Sequence[Spot], axes: tuple[Axis, Axis]) -> None:
    """Put a marker at every run: which limit binds."""
    names = list(dict.fromkeys(spot.cell.binding for spot in found if spot.cell.binding))
    for name, marker in zip(names, cycle(MARKERS)):
        at = [[one.at(v) for one, v in zip(axes, spot.at, strict=True)] for spot in found if spot.cell.binding == name]
        style = {"markersize": 4.0, "markerfacecolor": "white", "markeredgecolor": BLACK, "markeredgewidth": 0.7}
        axis.plot(*np.transpose(at), marker, label=name, clip_on=False, **style)
    axis.figure.legend(loc="outside upper center", ncols=max(len(names), 1))


def tick(value: Any) -> str:
    number = bare(value)
    return f"{number:g}" if is_number(number) else str(number)


def outline(axis: Axes, safe: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> None:
    """Draw the outline of what is `safe` (m, n), along the edges of its cells: `xs` (n + 1,) and `ys` (m + 1,)."""
    inside = np.pad(safe, 1)
    for j, i in zip(*np.nonzero(inside[1:-1, 1:] != inside[1:-1, :-1]), strict=True):
        axis.plot([xs[i]] * 2, [ys[j], ys[j + 1]], color=BLACK, linewidth=2.2, clip_on=False)
    for j, i in zip(*np.nonzero(inside[1:, 1:-1] != inside[:-1, 1:-1]), strict=True):
        axis.plot([xs[i], xs[i + 1]], [ys[j]] * 2, color=BLACK, linewidth=2.2, clip_on=False)


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
