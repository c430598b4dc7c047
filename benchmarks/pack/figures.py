"""The pictures of docs/benchmarks.md: error over solves and over CPU time, one for each case."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from benchmarks.pack.contest import TITLES
from benchmarks.pack.engines import ours
from benchmarks.pack.results import DOCS
from orchestrator.report.style import GREY, legend_above, line_style, saved

FOLDER = DOCS / "images" / "benchmarks"
DPI = 140
CONTESTANTS = [(ours.NAME, master) for master in (*ours.IMPLICIT, *ours.EXPLICIT)]
CONTESTANTS += [(name, "explicit") for name in TITLES if name != ours.NAME]
"""Each has the same line in all pictures."""
COSTS = {
    "solves_a_second": "Solves of {expensive!r} a simulated second [1/s]",
    "cpu": "CPU time a simulated second [s/s]",
}
LEAST = 1e-12
"""An error that is drawn."""


def draw(found: Mapping[str, Any], folder: Path = FOLDER) -> list[Path]:
    """Draw the pictures of all cases; return their files."""
    folder.mkdir(parents=True, exist_ok=True)
    return [_drawn(folder / f"{name}.png", part) for name, part in found.items()]


def _drawn(path: Path, part: Mapping[str, Any]) -> Path:
    with saved(path, (7.4, 3.3), DPI) as figure:
        axes = figure.subplots(1, 2, sharey=True)
        for axis, (cost, label) in zip(axes, COSTS.items(), strict=True):
            for i, contestant in enumerate(CONTESTANTS):
                _line(axis, part, contestant, cost, i)
            _reference(axis, part)
            axis.set_xlabel(label.format(expensive=part["expensive"]))
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_locator(NullLocator())
        axes[0].set_ylabel("Largest error over the range [–]")
        axes[0].yaxis.set_minor_locator(NullLocator())
        legend_above(figure, *axes[0].get_legend_handles_labels())
    return path


def _line(axis: Axes, part: Mapping[str, Any], contestant: tuple[str, str], cost: str, i: int) -> None:
    rows = [one for one in part["rows"] if (one["engine"], one["master"]) == contestant and "error" in one]
    if rows:
        name = contestant[1] if contestant[0] == ours.NAME else TITLES[contestant[0]]
        errors = [max(LEAST, *one["error"].values()) for one in rows]
        axis.loglog([one[cost] for one in rows], errors, label=name, **line_style(i, len(CONTESTANTS)))


def _reference(axis: Axes, part: Mapping[str, Any]) -> None:
    """Draw what the reference itself may be wrong by, where errors come near it."""
    worst = max(part["reference"]["error"].values())
    if worst > 1e-3 * axis.get_ylim()[0]:
        axis.axhline(worst, color=GREY, linewidth=0.9, linestyle=":")
        where = axis.get_yaxis_transform()
        axis.text(0.01, worst, "reference", transform=where, ha="left", va="bottom", color=GREY, fontsize=8)
