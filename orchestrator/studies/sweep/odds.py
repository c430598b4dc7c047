"""How probably it is safe, along one key that varies or over two: pictures with intervals, and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.coupling.errors import InputError
from orchestrator.report.style import BLACK, BLUE, COLOURS, GREY, LINES, STYLE, save_figure
from orchestrator.studies.sweep.atlas import Axis, axis_of, varying
from orchestrator.studies.sweep.design import bare
from orchestrator.studies.sweep.maps import MOST_CELLS, outline, tick
from orchestrator.studies.sweep.outcome import ALL, Chances
from orchestrator.studies.sweep.probability import Probability
from orchestrator.studies.sweep.ranges import stretches_in_words, unit_of
from orchestrator.studies.sweep.study import Study

ENOUGH = 0.95
"""A place is called probably safe where the lower end of the interval lies above that."""
SHADES = "Purples"
"""From white (never) to violet (always)."""
DARK = 0.6
"""Probability from which on text is white."""


def is_enough(found: Probability) -> bool:
    """Whether every limit holds often enough, surely."""
    return found.interval[0] >= ENOUGH


def words(study: Study, chances: Sequence[Chances]) -> list[str]:
    """Return where it is probably safe along the first key that varies, a line for each combination of the others."""
    keys = varying(study)
    if not keys or not chances:
        return []
    found, values = list[str](), [bare(value) for value in study.values[keys[0]]]
    for chosen in product(*([bare(value) for value in study.values[key]] for key in keys[1:])):
        others = dict(zip(keys[1:], chosen, strict=True))
        mine = {one.where[keys[0]]: one.of[ALL] for one in chances if others.items() <= one.where.items()}
        good = [value in mine and is_enough(mine[value]) for value in values]
        where = "".join(f"; {key} {value}" for key, value in others.items())
        told = stretches_in_words(values, good, unit_of(study, keys[0]))
        found.append(f"{keys[0]}: limits hold with a probability of {100.0 * ENOUGH:g} % at least {told}{where}")
    return found


def write(folder: Path, study: Study, chances: Sequence[Chances]) -> list[Path]:
    """Write ``probability.png`` and ``.pdf`` where something varies and is drawn; return the paths."""
    keys = varying(study)[:2]
    return save_figure(draw(study, chances, *keys), folder / "probability") if keys and chances else []


def draw(study: Study, chances: Sequence[Chances], x: str, y: str | None = None) -> Figure:
    """Return a picture: the probability that limits hold over `x`, or over `x` and `y`; of other values, the least."""
    if not chances:
        raise InputError(f"{study.path}: draws nothing at random, and has no probability; add [sample]")
    axes = [axis_of(study, (), key) for key in (x, y) if key is not None]
    with matplotlib.rc_context(STYLE):
        return _line(axes[0], chances) if y is None else _map(axes[0], axes[1], chances)


def _least(chances: Sequence[Chances], where: Mapping[str, Any], limit: str = ALL) -> Probability | None:
    """Return the probability at a place; of several combinations the least."""
    mine = [one.of[limit] for one in chances if where.items() <= one.where.items() and limit in one.of]
    return min(mine, key=lambda one: one.estimate, default=None)


def _figure(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure, figure.subplots()


def _line(x: Axis, chances: Sequence[Chances]) -> Figure:
    """Draw the probability of all limits with its interval, and that of each limit that is not always kept."""
    figure, axis = _figure(5.5, 3.2)
    at = np.array([x.at(value) for value in x.values])
    for style, name in enumerate([ALL, *(name for name in chances[0].of if name != ALL)]):
        found = [_least(chances, {x.key: value}, name) for value in x.values]
        if any(one is None for one in found) or (name != ALL and all(one and one.estimate[0] == 1.0 for one in found)):
            continue
        middle = np.array([np.mean(one.estimate) for one in found if one])
        if name == ALL:
            low, high = np.array([one.interval for one in found if one]).T
            axis.errorbar(
                at, middle, [middle - low, high - middle], fmt="o-", color=BLUE, capsize=3, label="all limits"
            )
            continue
        colour, dashes = COLOURS[style % len(COLOURS)], LINES[style % len(LINES)]
        axis.plot(at, middle, color=colour, linestyle=dashes, label=name, zorder=1)
    axis.axhline(ENOUGH, color=GREY, linewidth=0.8, linestyle=(0, (1, 1)))
    if not x.has_numbers:
        axis.set_xticks(at, [tick(value) for value in x.values])
    axis.set_xlabel(x.title)
    axis.set_ylabel("Probability that limits hold")
    axis.set_ylim(-0.03, 1.03)
    axis.legend()
    return figure


def _map(x: Axis, y: Axis, chances: Sequence[Chances]) -> Figure:
    """Draw the probability over two keys, its interval in the cells, and the outline of where it is enough."""
    grid = [[_least(chances, {x.key: a, y.key: b}) for a in x.values] for b in y.values]
    figure, axis = _figure(max(4.5, 1.8 + 0.78 * len(x.values)), max(2.8, 1.2 + 0.46 * len(y.values)))
    axis.grid(visible=False)
    axis.set_facecolor("0.85")
    shares = np.array([[np.nan if one is None else np.mean(one.estimate) for one in row] for row in grid])
    image = axis.imshow(shares, vmin=0.0, vmax=1.0, cmap=SHADES, origin="lower", aspect="auto")
    figure.colorbar(image, ax=axis, label="Probability that all limits hold")
    good = np.array([[one is not None and is_enough(one) for one in row] for row in grid])
    outline(axis, good, np.arange(len(x.values) + 1) - 0.5, np.arange(len(y.values) + 1) - 0.5)
    for j, row in enumerate(grid) if shares.size <= MOST_CELLS else ():
        for i, one in enumerate(row):
            if one is not None:
                colour = "white" if shares[j, i] > DARK else BLACK
                text = f"{shares[j, i]:.3g}\n{one.interval[0]:.2f} to {one.interval[1]:.2f}"
                axis.text(i, j, text, ha="center", va="center", fontsize=6.5, color=colour)
    axis.set_xticks(range(len(x.values)), [tick(value) for value in x.values])
    axis.set_yticks(range(len(y.values)), [tick(value) for value in y.values])
    axis.set_xlabel(x.title)
    axis.set_ylabel(y.title)
    return figure
