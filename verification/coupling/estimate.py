"""The error that a run estimates for itself, by a finer or a coarser second run, against its true error.

A grid written down before it was run (`verification/coupling/estimate_grid.py`), 120 macro steps each, 0.4 to 2 s.
*Landings*: touch-downs at point 9, at midspan and on the rig; drops from 2 to 30 cm with k = 1e7 to 1e10; wheels that
drive or roll; lines of 120 to 600 m of other conductors; robots of 10 to 100 kg and of one to four wheels. *Masters*: the
default one twice on each landing, at 1.25 to 20 ms, once with a tolerance of 1e-8 to 1e-4; on every second landing another
implicit one, exchange, prediction or energy budget; on every fifth adaptive steps, and an explicit master. *Oscillator*:
six masters at four steps. Z, y, roll and the peak force of every wheel; of the oscillator both positions.

True errors are the largest differences from the monolithic solution on the same mesh with a local tolerance of 1e-11 m, of
the oscillator from the matrix exponential. A signal is *undecided* where that solution's own error, bounded by a coarser
one, is more than a tenth of the difference, and left out where it does not move, by symmetry. Right is an estimate within
a factor 3. The rows are in `docs/estimate.json`; `python docs/estimate.py WORD` measures some anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from orchestrator.report.style import BLUE, COLOURS, GREY, MARKERS, STYLE, VERMILION
from orchestrator.runs.errors import CONSTANT, PEAK
from orchestrator.runs.estimate import GROSS, RATIOS
from verification.coupling.estimate_grid import GROUPS, specs
from verification.coupling.estimate_rows import Row as Measured
from verification.coupling.estimate_rows import measure
from verification.study import Result, Row

TITLE = "Error estimate"
FACTOR, MARGIN = 3.0, 10.0
KINDS = tuple(RATIOS)


@dataclass(frozen=True)
class Case:
    """One signal of one run.

    Attributes
    ----------
    group, words, signal : one of `GROUPS`; the run in words; the signal
    error : true error, by the signal's range
    ratio : estimate → estimated over true error; infinite where it is not known
    cost : estimate → steps of the cable (or a mass) in the second run over those in the first
    """

    group: str
    words: str
    signal: str
    error: float
    ratio: Mapping[str, float]
    cost: Mapping[str, float]

    @property
    def quantity(self) -> str:
        """Which quantity it is, in words."""
        if PEAK.fullmatch(self.signal):
            return "peak force"
        return {"z": "z", "y": "y", "roll": "roll"}.get(self.signal.rpartition(".")[2], "position")

    def right(self, kind: str) -> bool:
        """Whether an estimate is within the factor."""
        return 1.0 / FACTOR <= self.ratio[kind] <= FACTOR


@dataclass
class Found:
    """All cases, and the numbers of signals left out.

    Attributes
    ----------
    constant, undecided : that do not move; whose truth is not accurate enough
    doubtful : those of runs whose estimate says itself that no calibration speaks for it
    """

    cases: list[Case] = field(default_factory=list)
    constant: int = 0
    undecided: int = 0
    doubtful: list[Case] = field(default_factory=list)


def judged(rows: Sequence[Measured]) -> Found:
    """Return what can be judged of the rows of the file."""
    found, doubted = Found(), {row["case"] for row in rows if is_doubtful(row)}
    for row in rows:
        if row["moved"] < CONSTANT:
            found.constant += 1
        elif not row["true"] > MARGIN * row["own"]:
            found.undecided += 1
        else:
            (found.doubtful if row["case"] in doubted else found.cases).append(case(row))
    return found


def is_doubtful(row: Measured) -> bool:
    """Whether the estimate of the run says itself, by this signal, that no calibration speaks for it (`doubts`)."""
    parts = row["finer"]
    return parts.get("unconverged", 0) > 0 or of_time(parts) >= GROSS * row["range"]


def case(row: Measured) -> Case:
    """Return one row as it is counted."""
    ratios = {kind: of_time(row[kind]) / row["true"] for kind in KINDS}
    costs = {kind: row[kind]["cost"] for kind in KINDS}
    return Case(row["group"], row["case"], row["signal"], row["true"] / row["range"], ratios, costs)


def of_time(parts: Mapping[str, float | None]) -> float:
    """Return the error of macro step, coupling and inner steps, infinite where it is not known; the true solution is on the
    run's own mesh."""
    return float("inf") if parts["total"] is None else (parts["coupling"] or 0.0) + (parts["inner_steps"] or 0.0)


def shares(cases: Sequence[Case], kind: str) -> tuple[float, float, float]:
    """Return the shares of estimates that are right, too small, too large (or not known)."""
    ratios = np.array([one.ratio[kind] for one in cases])
    right = float(np.mean([one.right(kind) for one in cases]))
    return right, float(np.mean(ratios < 1.0 / FACTOR)), float(np.mean(~(ratios <= FACTOR)))


def brief(cases: Sequence[Case]) -> str:
    """Return the table of both estimates: how often each is right over all cases, and what it costs."""
    lines = [
        "| `[simulation] estimate` | second run | right | too small | too large | cost, in runs |",
        "|---|---|---|---|---|---|",
    ]
    for kind, where in zip(KINDS, ("at H/2", "at 2H"), strict=True):
        counted = " | ".join(f"{share:.1%}" for share in shares(cases, kind))
        lines.append(f'| `"{kind}"` | {where} | {counted} | {np.nanmedian([one.cost[kind] for one in cases]):.1f} |')
    return "\n".join([*lines, '| `"none"` | | | | | 0 |'])


def by_group(cases: Sequence[Case]) -> str:
    """Return the table by kinds of landing."""
    return table(cases, lambda one: one.group, GROUPS)


def by_quantity(cases: Sequence[Case]) -> str:
    """Return the table by quantities."""
    return table(cases, lambda one: one.quantity, ("z", "y", "roll", "peak force", "position"))


def table(cases: Sequence[Case], key: Callable[[Case], str], names: Sequence[str]) -> str:
    """Return how the estimates of each group of cases are spread, and what they cost."""
    lines = [
        "| cases | number | second run | right | too small | too large | estimate/error, 5 %, median, 95 % | cost, median |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in (*names, "all landings", "all"):
        kept = [one for one in cases if name != "all landings" or one.group != "oscillator"]
        group = [one for one in kept if name in (key(one), "all landings", "all")]
        if group:
            lines += [_line(name, group, kind) for kind in KINDS]
    return "\n".join(lines)


def _line(name: str, group: Sequence[Case], kind: str) -> str:
    counted = " | ".join(f"{share:.1%}" for share in shares(group, kind))
    spread = np.quantile([one.ratio[kind] for one in group], (0.05, 0.5, 0.95), method="nearest")
    spread_words = ", ".join(f"{ratio:.2f}" for ratio in spread)
    cost = np.nanmedian([one.cost[kind] for one in group])
    return f"| {name} | {len(group)} | {kind} | {counted} | {spread_words} | {cost:.2f} |"


def wrong(cases: Sequence[Case], kind: str) -> str:
    """Return the cases outside the band in words, the smallest ratio first."""
    outside = sorted((one for one in cases if not one.right(kind)), key=lambda one: one.ratio[kind])
    listed = (f"{one.words}, {one.signal}: {one.ratio[kind]:.2g} (true {one.error:.0e})" for one in outside)
    return f"Outside the band with the {kind} run, estimate/error: {'; '.join(listed) or 'none'}."


def run(figures: Path) -> Result:
    """Measure the grid anew, count and draw."""
    return result(measure(lambda spec: True, lambda line: None), figures)


def result(measured: Sequence[Measured], figures: Path) -> Result:
    """Return what the rows of the file show."""
    found = judged(measured)
    draw(figures / "error_estimate.png", found.cases)
    right, small, _ = shares(found.cases, "finer")
    source = "monolithic and analytic solutions"
    rows = [
        Row("finer second run: share of estimates not within a factor 3", 1.0 - right, 0.0, source, 0.05, False),
        Row("finer second run: share of estimates three times too small", small, 0.0, source, 0.025, False),
    ]
    caption = (
        "Left: error estimated by the finer run over true error, both by the signal's range; grey: a factor 3. "
        "Right: share of the cases below a ratio of estimated to true error"
    )
    return Result(rows, [("error_estimate.png", caption)], remark(found))


def remark(found: Found) -> str:
    """Return what the section says below its rows."""
    runs, of = len({one.words for one in found.cases}), len(list(specs()))
    right = sum(one.right("finer") for one in found.doubtful)
    left = (
        f"{len(found.cases)} signals of {runs} runs, of {of} in the grid. Left out: {found.constant} constant signals; "
    )
    left += (
        f"{found.undecided} undecided; {len(found.doubtful)} of runs whose estimate says itself that it is doubtful, "
    )
    left += f"{right} of them right. Cost: steps of the cable (or a mass) in the second run over those in the first."
    return "\n\n".join((left, by_group(found.cases), by_quantity(found.cases), wrong(found.cases, "finer")))


def draw(path: Path, cases: Sequence[Case]) -> None:
    """Draw the estimates over the true errors, and how their ratios are spread."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(7.4, 3.7), width_ratios=(1.1, 1.0))
        _draw_calibration(left, cases)
        _draw_shares(right, cases)
        figure.savefig(path)
        plt.close(figure)


def _draw_calibration(axes: Axes, cases: Sequence[Case]) -> None:
    """Draw the estimates of the finer run over the true errors."""
    errors = np.array([one.error for one in cases])
    limits = np.array([0.3 * errors.min(), 3.0 * errors.max()])
    axes.fill_between(limits, limits / FACTOR, limits * FACTOR, color="0.9", linewidth=0.0)
    axes.plot(limits, limits, color=GREY, linewidth=0.8)
    styles = zip(GROUPS, (*COLOURS, GREY), (*MARKERS, "X"), strict=False)
    for group, colour, marker in styles:
        mine = [one for one in cases if one.group == group]
        x, y = [one.error for one in mine], [one.error * one.ratio["finer"] for one in mine]
        axes.scatter(x, y, s=15, marker=marker, color=colour, alpha=0.75, linewidth=0.0, label=group, zorder=3)
    axes.set(xscale="log", yscale="log", xlim=limits, ylim=limits, box_aspect=1.0)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(100.0))
        axis.set_minor_locator(NullLocator())
    axes.set(xlabel="True error / range [–]", ylabel="Estimated error / range [–]")
    axes.legend(loc="upper left", handletextpad=0.2, borderaxespad=0.2, fontsize=7.5)


def _draw_shares(axes: Axes, cases: Sequence[Case]) -> None:
    """Draw the cumulative distribution of estimated over true error for both second runs."""
    axes.axvspan(1.0 / FACTOR, FACTOR, color="0.9", linewidth=0.0)
    axes.axvline(1.0, color=GREY, linewidth=0.8)
    for kind, colour in zip(RATIOS, (BLUE, VERMILION), strict=True):
        label = f"{kind} run:\n{shares(cases, kind)[0]:.0%} within\na factor 3"
        axes.ecdf([one.ratio[kind] for one in cases], color=colour, label=label)
    axes.set(xscale="log", xlim=(0.01, 20.0), ylim=(0.0, 1.0), xticks=(0.1, 1 / 3, 1, 3, 10))
    axes.set(
        xticklabels=("0.1", "1/3", "1", "3", "10"), xlabel="Estimated / true error [–]", ylabel="Share of the cases [–]"
    )
    axes.xaxis.set_minor_locator(NullLocator())
    axes.legend(loc="upper left", handlelength=1.2, borderaxespad=0.2, labelspacing=0.8, fontsize=7.5)
