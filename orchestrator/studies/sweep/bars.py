"""A picture of what margins hang on: first and total indices of each parameter, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.report.style import BLACK, BLUE, SKY, STYLE, save_figure
from orchestrator.studies.sweep.sensitivity import Indices, Sensitivity

MOST = 6
"""Panels in a row, and rows: more cannot be read; `study.json` has all."""


def draw(found: Sequence[Sensitivity]) -> Figure | None:
    """Return a picture: a row for each combination of what varies, a panel for each margin; None where there is none."""
    shown = [one for one in found if _margins(one)][:MOST]
    if not shown:
        return None
    columns = max(len(_margins(one)) for one in shown)
    with matplotlib.rc_context(STYLE):
        parameters = len(next(iter(shown[0].of.values())))
        size = (2.0 + 1.9 * columns, 0.9 + len(shown) * (0.5 + 0.42 * parameters))
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(shown), columns, squeeze=False, sharex=True, sharey=True)
        for line, one in zip(panels, shown, strict=True):
            _row(line, one)
        figure.supxlabel("Share of the variance", fontsize=STYLE["axes.labelsize"])
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=2)
        return figure


def write(folder: Path, found: Sequence[Sensitivity]) -> list[Path]:
    """Write ``sensitivity.png`` and ``.pdf`` where there is something to show; return the paths."""
    figure = draw(found)
    return [] if figure is None else save_figure(figure, folder / "sensitivity")


def _margins(one: Sensitivity) -> list[str]:
    return [name for name in one.of if "margin" in name][:MOST]


def _row(panels: np.ndarray, one: Sensitivity) -> None:
    names = _margins(one)
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    for panel, name in zip(panels, names, strict=False):
        _panel(panel, one.of[name])
        panel.set_title(name.removeprefix("margin.").replace("_", " "), fontsize=9)
    where = ", ".join(f"{key} {value}" for key, value in one.where.items())
    if where:
        panels[0].set_ylabel(where, fontsize=8)


def _panel(panel: Axes, of: Mapping[str, Indices]) -> None:
    """Draw two bars for each parameter: the first index, and below it the total one."""
    at = np.arange(len(of))[::-1]
    for name, beside, colour in (("first", 0.19, BLUE), ("total", -0.19, SKY)):
        indices = [getattr(one, name) for one in of.values()]
        values = np.array([index.estimate for index in indices])
        spread = np.abs(np.array([index.interval for index in indices]).T - values)
        panel.barh(at + beside, values, 0.36, color=colour, label=name)
        panel.errorbar(values, at + beside, xerr=spread, fmt="none", ecolor=BLACK, elinewidth=0.8, capsize=2.0)
    panel.set_yticks(at, [name.replace(".parameters.", ".\u200b") for name in of], fontsize=8)
    panel.axvline(0.0, color=BLACK, linewidth=0.8)
