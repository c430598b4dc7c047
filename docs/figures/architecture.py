"""Draw ``docs/images/architecture.png``: python docs/figures/architecture.py [FILE]."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

INK, SOFT = "#1f2a36", "#5b6775"
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072b2", "#d55e00", "#009e73", "#7a4f9e", "#66707a"
"""Okabe and Ito's colours, told apart by colour-blind readers too; one a room."""


def room(ax: Axes, box: tuple[float, float, float, float], colour: str, title: str, folder: str) -> None:
    """Draw a room: x, y, width, height; its title and the folder it lives in."""
    x, y, width, height = box
    for face, alpha, edge in ((colour, 0.08, "none"), ("none", 1.0, colour)):
        style = dict(boxstyle="round,pad=0,rounding_size=0.12", facecolor=face, edgecolor=edge, linewidth=1.4)
        ax.add_patch(FancyBboxPatch((x, y), width, height, alpha=alpha, **style))
    ax.text(x + 0.18, y + height - 0.2, title, color=colour, fontsize=12, fontweight="bold", va="top")
    ax.text(x + 0.18, y + height - 0.52, folder, color=SOFT, fontsize=8, family="monospace", va="top")


def card(ax: Axes, box: tuple[float, float, float, float], title: str, text: str = "") -> None:
    """Draw a card within a room: x, y, width, height."""
    x, y, width, height = box
    style = dict(boxstyle="round,pad=0,rounding_size=0.07", facecolor="white", edgecolor="#c9d0d6", linewidth=0.9)
    ax.add_patch(FancyBboxPatch((x, y), width, height, **style))
    middle = y + height / 2
    ax.text(x + width / 2, middle + (0.12 if text else 0), title, color=INK, fontsize=9.5, ha="center", va="center")
    if text:
        ax.text(x + width / 2, middle - 0.15, text, color=SOFT, fontsize=7.6, ha="center", va="center")


def arrow(
    ax: Axes, start: tuple[float, float], end: tuple[float, float], label: str = "", at: tuple[float, float] = (0, 0.14)
) -> None:
    """Draw an arrow and, beside its middle, what it carries."""
    style = dict(arrowstyle="-|>", mutation_scale=13, color=INK, linewidth=1.3, shrinkA=2, shrinkB=2)
    ax.add_patch(FancyArrowPatch(start, end, **style))
    x, y = (start[0] + end[0]) / 2 + at[0], (start[1] + end[1]) / 2 + at[1]
    ax.text(x, y, label, color=INK, fontsize=8.4, ha="center", va="center", style="italic", linespacing=1.25)


def draw(path: Path) -> None:
    """Draw the figure into `path`."""
    fig, ax = plt.subplots(figsize=(12.4, 6.2))
    ax.set(xlim=(0, 12.4), ylim=(0, 6.2), aspect="equal")
    ax.axis("off")

    card(ax, (0.4, 5.3, 2.2, 0.66), "FMUs of other tools", "a robot, a controller, …")
    room(ax, (0.15, 0.15, 2.7, 4.75), BLUE, "Modules", "fmus/")
    words = {"cable": "ANCF beam", "contact": "grooved wheel", "robot": "rigid body", "oscillator": "in closed form"}
    for i, (name, text) in enumerate(words.items()):
        card(ax, (0.4, 3.3 - 0.74 * i, 2.2, 0.62), name, text)
    ax.text(1.5, 0.63, "one table of variables,\npure kernels", color=SOFT, fontsize=8.4, ha="center", va="center")

    room(ax, (4.5, 4.1, 3.75, 1.95), GREEN, "Coupling engine", "orchestrator/coupling/")
    words = {"graph": "checked", "exchange": "waveform, …", "masters": "implicit, …"}
    for i, (title, text) in enumerate(words.items()):
        card(ax, (4.7 + 1.15 * i, 4.36, 1.05, 0.72), title, text)

    room(ax, (4.5, 1.9, 3.75, 1.7), ORANGE, "Landing", "orchestrator/landing/")
    card(ax, (4.7, 2.06, 1.65, 0.66), "scenario, robot", "TOML with sources")
    card(ax, (6.65, 2.06, 1.4, 0.66), "resolved", "once")
    arrow(ax, (6.35, 2.39), (6.65, 2.39))

    room(ax, (4.5, 0.15, 3.75, 1.2), GREY, "Monolithic solver", "orchestrator/landing/monolithic/")
    ax.text(6.37, 0.4, "the whole as one system", color=SOFT, fontsize=8.4, ha="center", va="center")

    room(ax, (9.75, 0.15, 2.5, 5.9), PURPLE, "Studies, reports", "runs/ report/ cli/")
    words = {
        "run": "with its own error",
        "compare": "coupled less monolithic",
        "result files": "CSV, HDF5, JSON",
        "pictures, page": "drawn from the files",
        "command line, Python": "the same functions",
    }
    for i, (title, text) in enumerate(words.items()):
        card(ax, (9.95, 4.36 - 0.98 * i, 2.1, 0.72), title, text)

    arrow(ax, (2.6, 5.63), (4.5, 5.63), "FMI 2.0, 3.0")
    arrow(ax, (2.85, 4.5), (4.5, 4.5), "as FMUs")
    arrow(ax, (2.85, 0.75), (4.5, 0.75), "the same kernels")
    arrow(ax, (6.37, 3.6), (6.37, 4.1), "a graph of FMUs", (0.78, 0))
    arrow(ax, (6.37, 1.9), (6.37, 1.35), "one problem", (0.6, 0))
    arrow(ax, (8.25, 5.0), (9.75, 5.0), "signals")
    arrow(ax, (8.25, 0.75), (9.75, 0.75), "reference")
    fig.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.05)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "images" / "architecture.png")
