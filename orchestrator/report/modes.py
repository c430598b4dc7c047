"""The picture of the modes of a cable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.coupling.run.results import read_fields
from orchestrator.report.style import BLUE, VERMILION, saved

COLUMNS = {
    "out": ("out of plane", ((0, VERMILION, "lateral"),)),
    "in": ("in plane", ((2, VERMILION, "vertical"), (1, BLUE, "along"))),
}
"""Plane → words, and the axes that are drawn with colour and label."""


def draw(directory: Path) -> list[Path]:
    """Draw ``modes.png`` from what ``orchestrator modes`` has written to `directory`."""
    picture(directory / "modes.png", read_fields(directory / "modes.h5"))
    return [directory / "modes.png"]


def picture(path: Path, modes: Mapping[str, np.ndarray]) -> Figure:
    """Draw the shapes over the span: across the plane on the left, vertical and along the span on the right.

    Parameters
    ----------
    modes : ``equilibrium`` (m, 3) m; ``out`` and ``in`` (n, m, 3), ``out.frequency`` and ``in.frequency`` (n,) Hz
    """
    count = max(len(modes[f"{plane}.frequency"]) for plane in COLUMNS)
    with saved(path, (7.0, 0.9 * count + 0.6)) as figure:
        axes = figure.subplots(count, 2, sharex=True, squeeze=False)
        for column, plane in enumerate(COLUMNS):
            words, _ = COLUMNS[plane]
            for axis, shape, frequency in zip(axes[:, column], modes[plane], modes[f"{plane}.frequency"], strict=False):
                _shape(axis, modes["equilibrium"][:, 1], shape / np.abs(shape).max(), frequency, plane)
            axes[-1, column].set_xlabel(f"Position along the span [m], {words}")
            axes[0, column].legend(loc="upper right", ncols=2)
    return figure


def _shape(axis: Axes, y: np.ndarray, shape: np.ndarray, frequency: float, plane: str) -> None:
    for direction, colour, label in COLUMNS[plane][1]:
        axis.plot(y, shape[:, direction], color=colour, label=label)
    axis.set_ylim(-1.15, 1.15)
    axis.set_yticks([0.0], [f"{frequency:.4g} Hz"])
