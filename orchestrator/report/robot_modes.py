"""The pictures of the modes of the line with the robot on it."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.coupling.run.results import Table, read_fields, read_table
from orchestrator.report.style import BLUE, GREEN, GREY, VERMILION, saved

DIRECTIONS = ((2, VERMILION, "vertical"), (1, BLUE, "along"), (0, GREEN, "across"))
"""Axis, colour and label of what is drawn of a shape."""
SHOWN = 12
"""Modes that have a place in the picture."""
CLOSE = 0.05
"""Distance of bounce and pendulum, by their mean, that the picture shows."""


def draw(directory: Path, position: float) -> list[Path]:
    """Draw ``modes.png``, and ``positions.png`` where there is such a table, from what the command has written.

    Parameters
    ----------
    position : where the robot of the scenario lands, m
    """
    with open(directory / "modes.csv", encoding="utf-8", newline="") as file:
        kinds = [row["kind"] for row in csv.DictReader(file)]
    shapes(directory / "modes.png", read_fields(directory / "modes.h5"), position, kinds)
    if not (directory / "positions.csv").is_file():
        return [directory / "modes.png"]
    resonance(directory / "positions.png", read_table(directory / "positions.csv"), position)
    return [directory / "modes.png", directory / "positions.png"]


def shapes(path: Path, modes: Mapping[str, np.ndarray], position: float, kinds: Sequence[str]) -> Figure:
    """Draw the motion of the line in each mode over the span, with the place of the robot; `kinds` names the modes."""
    count, y = min(SHOWN, modes["frequency"].size), modes["equilibrium"][:, 1]
    with saved(path, (6.0, 0.75 * count + 0.7)) as figure:
        axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        for axis, shape, frequency, kind in zip(axes, modes["line.real"], modes["frequency"], kinds, strict=False):
            for direction, colour, label in DIRECTIONS:
                axis.plot(y, shape[:, direction] / np.abs(shape).max(), color=colour, label=label)
            axis.axvline(position, color=GREY, linewidth=0.8)
            axis.set_ylim(-1.15, 1.15)
            axis.set_yticks([0.0], [f"{kind}\n{frequency:.4g} Hz" if frequency > 0.0 else f"{kind}\ntopples"])
        axes[-1].set_xlabel("Position along the span [m]")
        axes[0].legend(loc="upper right", ncols=len(DIRECTIONS))
    return figure


def resonance(path: Path, table: Table, position: float) -> Figure:
    """Draw bounce and pendulum over the landing position, and where they are close."""
    with saved(path, (5.5, 3.2)) as figure:
        axis: Axes = figure.subplots()
        bounce, pendulum = (table[f"{name}.frequency"] for name in ("bounce", "pendulum"))
        y = table["landing.position"]
        axis.fill_between(
            y,
            (1.0 - CLOSE) * pendulum,
            (1.0 + CLOSE) * pendulum,
            color=BLUE,
            alpha=0.15,
            linewidth=0.0,
            label=f"within {100 * CLOSE:g} % of the pendulum",
        )
        axis.plot(y, bounce, "o-", color=VERMILION, markersize=3.5, label="bounce")
        axis.plot(y, pendulum, "s-", color=BLUE, markersize=3.5, label="pendulum")
        axis.axvline(position, color=GREY, linewidth=0.8, label="landing of the scenario")
        axis.set_ylim(bottom=0.0)
        axis.set_xlabel("Landing position along the span [m]")
        axis.set_ylabel("Natural frequency [Hz]")
        axis.legend(loc="best")
    return figure
