"""The error that a run estimates for itself, against its true error.

Six landings over 1.2 s; `iqn_ils` and `interface_jacobian` at 20, 10, 5 and 2.5 ms, `gauss_seidel` at 0.5 and 0.25 ms
(it is unstable beyond about 1 ms). The true error is the largest difference from the monolithic solution, whose own
error is estimated at 1e-9 m and 1e-8 rad or less; a case whose error is not ten times that is left out, and so is the
roll at midspan, which is zero by symmetry. Counted as right is an estimate within a factor 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from orchestrator import experiment
from orchestrator.compare import CONSTANT
from orchestrator.plots import COLOURS, MARKERS, STYLE
from verification.coupling.landings import LANDINGS, SIGNALS, coupled, reference
from verification.study import Result, Row

TITLE = "Error estimate"
IMPLICIT, EXPLICIT = (0.02, 0.01, 0.005, 0.0025), (0.0005, 0.00025)
GRID = {"iqn_ils": IMPLICIT, "interface_jacobian": IMPLICIT, "gauss_seidel": EXPLICIT}
FACTOR = 3.0


@dataclass(frozen=True)
class Case:
    """One signal of one run: error and estimate relative to the signal's peak-to-peak."""

    landing: str
    master: str
    macro_step: float
    signal: str
    error: float
    estimate: float

    @property
    def ratio(self) -> float:
        return self.estimate / self.error

    @property
    def right(self) -> bool:
        return 1.0 / FACTOR <= self.ratio <= FACTOR


def cases() -> Iterator[Case]:
    """Run the grid."""
    steps = tuple(sorted({*IMPLICIT, *EXPLICIT}))
    for landing in LANDINGS:
        true = reference(landing, steps)
        for master, macro_steps in GRID.items():
            for macro_step in macro_steps:
                run = coupled(landing, master, macro_step)
                experiment.estimate(run)
                errors = experiment.held_against(run, true).signals
                for signal in SIGNALS:
                    e, own = errors[signal], true.estimated_error[signal]
                    if e.scale > CONSTANT and e.max_error > 10.0 * own:
                        estimate = run.estimated_error[signal] / e.scale
                        yield Case(landing, master, macro_step, signal, e.relative_max_error, estimate)


GROUPS: dict[str, Callable[[Case], bool]] = {
    "implicit, H = 2.5, 5 and 10 ms": lambda c: c.master != "gauss_seidel" and c.macro_step < 0.015,
    "implicit, H = 20 ms": lambda c: c.master != "gauss_seidel" and c.macro_step > 0.015,
    "gauss_seidel": lambda c: c.master == "gauss_seidel",
    "all": lambda _: True,
}


def share(found: Sequence[Case], test: Callable[[Case], bool]) -> float:
    """Return the share of the cases that pass."""
    return sum(map(test, found)) / max(len(found), 1)


def table(found: Sequence[Case]) -> str:
    """Return how the estimates of each group are spread."""
    lines = [
        "| cases | number | right | too small | too large | median of estimate/error |",
        "|---|---|---|---|---|---|",
    ]
    for name, member in GROUPS.items():
        group = [c for c in found if member(c)]
        low, high = share(group, lambda c: c.ratio < 1 / FACTOR), share(group, lambda c: not c.ratio <= FACTOR)
        median = np.median([c.ratio for c in group])
        lines.append(f"| {name} | {len(group)} | {1 - low - high:.0%} | {low:.0%} | {high:.0%} | {median:.2f} |")
    return "\n".join(lines)


def wrong(found: Sequence[Case]) -> str:
    """Return the cases outside the band in words."""
    lines = [
        f"{c.landing}, `{c.master}`, {1e3 * c.macro_step:g} ms, {c.signal.rpartition('.')[2]}: {c.ratio:.2g}"
        for c in sorted(found, key=lambda c: c.ratio)
        if not c.right
    ]
    return "Outside the band, with estimate/error: " + "; ".join(lines) + "."


def run(figures: Path) -> Result:
    """Run the grid, count and draw."""
    found = list(cases())
    _draw(figures / "error_estimate.png", found)
    usual = [c for c in found if GROUPS["implicit, H = 2.5, 5 and 10 ms"](c)]
    outside = share(usual, lambda c: not c.right)
    label = "implicit masters, H up to 10 ms: share of estimates not within a factor 3"
    rows = [Row(label, outside, 0.0, "monolithic solution", 0.1, relative=False)]
    caption = "Estimated against true error, relative to peak-to-peak; grey: a factor 3; hollow: H = 20 ms"
    remark = f"{table(found)}\n\n{wrong(found)}"
    return Result(rows, [("error_estimate.png", caption)], remark)


def _draw(path: Path, found: Sequence[Case]) -> None:
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.5), sharex=True, sharey=True)
        limits = np.array([0.3 * min(c.error for c in found), 3.0 * max(c.error for c in found)])
        for axis, signal, words in zip(axes, SIGNALS, ("Z", "Roll"), strict=True):
            axis.fill_between(limits, limits / FACTOR, limits * FACTOR, color="0.9", linewidth=0.0)
            axis.plot(limits, limits, color="0.6", linewidth=0.8)
            for master, colour, marker in zip(GRID, COLOURS, MARKERS, strict=False):
                for hollow in (False, True):
                    mine = [c for c in found if (c.signal, c.master) == (signal, master)]
                    mine = [c for c in mine if (c.macro_step > 0.015) == hollow]
                    x, y = [c.error for c in mine], [c.estimate for c in mine]
                    face, label = ("none", None) if hollow else (colour, master)
                    axis.scatter(x, y, s=18, marker=marker, edgecolors=colour, facecolors=face, label=label, zorder=3)
            axis.set(xscale="log", yscale="log", xlabel=f"True error, {words} [–]")
        axes[0].set(xlim=limits, ylim=limits, ylabel="Estimated error [–]")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
        figure.savefig(path)
        plt.close(figure)
