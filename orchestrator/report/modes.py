"""Table and picture of the modes of a cable."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from orchestrator.landing.modes import CableModes, sample


def write(found: CableModes, directory: Path) -> None:
    """Write `modes.csv` and `modes.png` to a new directory."""
    directory.mkdir(parents=True)
    with (directory / "modes.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["plane", "mode", "frequency [Hz]", "damping ratio [1]"])
        for plane, group in (("out", found.out_of_plane), ("in", found.in_plane)):
            for k, (f, d) in enumerate(zip(group.frequency, group.damping_ratio, strict=True)):
                rows.writerow([plane, k + 1, repr(float(f)), repr(float(d))])
    draw(found, directory / "modes.png")


def draw(found: CableModes, path: Path) -> None:
    """Draw the shapes over the span: across the plane on the left, vertical and along the span on the right."""
    import matplotlib.pyplot as plt

    from orchestrator.report.plots import BLUE, STYLE, VERMILION

    count = max(found.out_of_plane.frequency.size, found.in_plane.frequency.size)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(count, 2, figsize=(7.0, 0.9 * count + 0.6), sharex=True, squeeze=False)
        columns = ((found.out_of_plane, "out of plane"), (found.in_plane, "in plane"))
        for column, (group, title) in enumerate(columns):
            for k, shape in enumerate(group.shape):
                ax, u = axes[k, column], sample(found.model, shape)
                u = u / np.abs(u).max()
                lines = (
                    ((0, VERMILION, "lateral"),) if column == 0 else ((2, VERMILION, "vertical"), (1, BLUE, "along"))
                )
                for axis, colour, label in lines:
                    ax.plot(found.equilibrium[:, 1], u[:, axis], color=colour, label=label)
                ax.set_ylim(-1.15, 1.15)
                ax.set_yticks([0.0], [f"{group.frequency[k]:.4g} Hz"])
            axes[-1, column].set_xlabel(f"Position along the span, m ({title})")
            axes[0, column].legend(loc="upper right", ncols=2)
        figure.savefig(path)
        plt.close(figure)
