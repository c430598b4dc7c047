"""The error that a run estimates for itself, by a finer or a coarser second run, against its true error.

*Landings*, 1.2 s: the six of these studies and five others (10 m rig, 10 kg robot, drop with k = 1e10, 100 kg robot 40 m
from the tower, second robot of two wheels), `iqn_ils` and `interface_jacobian` at 20, 10, 5 and 2.5 ms. On the six also
*adaptive* steps (20 ms, `local_tolerance` 1e-4 and 1e-5) and *explicit* masters (`gauss_seidel`, `jacobi` at 0.5 and
0.25 ms; beyond about 1 ms they are unstable). Z and roll. *Oscillator*, 5 s: six masters at 20, 10, 5 and 2.5 ms, both
positions.

True errors are the largest differences from the monolithic solution with a local tolerance of 1e-11 m, of the
oscillator from the matrix exponential. A case is left out where the solution's own estimated error is not three times
smaller, and where the signal is zero by symmetry (roll at midspan of a line). Counted as right is an estimate within a
factor 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator
from scipy.linalg import expm

from orchestrator.coupling.run.compare import signal_errors
from orchestrator.coupling.run.results import Table
from orchestrator.report.style import BLUE, COLOURS, GREY, MARKERS, STYLE, VERMILION
from orchestrator.runs.coupled import Coupled, run_coupled
from orchestrator.runs.errors import CONSTANT, Parts
from orchestrator.runs.estimate import RATIOS, estimate_error
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario
from verification.coupling.landings import FOLDER, LANDINGS, OTHERS, scenario, truth
from verification.study import Result, Row

TITLE = "Error estimate"
STEPS, SHORT = (0.02, 0.01, 0.005, 0.0025), (0.0005, 0.00025)
ITERATED = ("iqn_ils", "interface_jacobian")
ON_OSCILLATOR = ("jacobi", "gauss_seidel", "nepce", "semi_implicit", *ITERATED)
LOCAL_TOLERANCES = (1e-4, 1e-5)
POSITIONS = ("left.position", "right.position")
FACTOR, MARGIN = 3.0, 3.0
GROUPS = ("landings, 2.5 to 10 ms", "landings, 20 ms", "landings, adaptive", "landings, explicit", "oscillator")


@dataclass(frozen=True)
class Case:
    """One signal of one run.

    Attributes
    ----------
    group, words : one of `GROUPS`; landing, master, step and signal
    error : true error, relative to the signal's peak-to-peak
    ratio : estimate → estimated over true error
    cost : estimate → steps of the cable (or a mass) in the second run over those in the first
    """

    group: str
    words: str
    error: float
    ratio: dict[str, float]
    cost: dict[str, float]


@dataclass
class Found:
    """All cases, and the numbers of those left out: constant signals, truth not accurate enough."""

    cases: list[Case] = field(default_factory=list)
    constant: int = 0
    unjudged: int = 0


def runs() -> Iterator[tuple[str, str, Scenario]]:
    """Yield the grid: the group, where it happens, and the scenario."""
    for place in LANDINGS | OTHERS:
        for master in ITERATED:
            for step in STEPS:
                yield GROUPS[1 if step > 0.015 else 0], place, scenario(place, master, step)
    for place in LANDINGS:
        for tolerance in LOCAL_TOLERANCES:
            adaptive = scenario(place, ITERATED[1], STEPS[0], f"master.local_tolerance={tolerance}")
            yield GROUPS[2], place, adaptive
        for master in ("gauss_seidel", "jacobi"):
            for step in SHORT:
                yield GROUPS[3], place, scenario(place, master, step)
    for master in ON_OSCILLATOR:
        for step in STEPS:
            one = load(FOLDER / "oscillator.toml", [f"simulation.macro_step={step}"], master=master)
            yield GROUPS[4], "oscillator", one


def exact_oscillator(one: Scenario, time: np.ndarray) -> Table:
    """Return the positions of both masses: the exponential of the 4 x 4 matrix, one macro step after the other."""
    left, right = one.components["left"].parameters, one.components["right"].parameters
    own, between = (
        np.array([right[f"{kind}{name}"] for name in ("stiffness", "damping")]) for kind in ("", "coupling_")
    )
    masses = np.array([left["mass"], right["mass"]])
    blocks = [
        -(np.diag([o, o]) + b * np.array([[1, -1], [-1, 1]])) / masses[:, None]
        for o, b in zip(own, between, strict=True)
    ]
    step = expm(np.block([[np.zeros((2, 2)), np.eye(2)], blocks]) * (time[1] - time[0]))
    states = [np.array([left["initial_position"], 0.0, 0.0, 0.0])]
    for _ in time[1:]:
        states.append(step @ states[-1])
    return {"time": time} | dict(zip(POSITIONS, np.array(states).T, strict=False))


def measured() -> Found:
    """Run the grid, with both estimates of every run."""
    found = Found()
    for group, place, one in runs():
        run = run_coupled(one)
        table, own = true_solution(place, run)
        errors = signal_errors(run.table, table)
        ratios, costs = both_estimates(run)
        for signal, e in ((name, errors[name]) for name in one.simulation.tolerances):
            if e.scale < CONSTANT:
                found.constant += 1
            elif not e.max_error > MARGIN * own.get(signal, 0.0):
                found.unjudged += 1
            else:
                ratio = {kind: estimates[signal] / e.max_error for kind, estimates in ratios.items()}
                found.cases.append(Case(group, described(place, one, signal), e.relative_max_error, ratio, costs))
    return found


def true_solution(place: str, run: Coupled) -> tuple[Table, Mapping[str, float]]:
    """Return the true signals and the error of each, in its unit."""
    if place == "oscillator":
        return exact_oscillator(run.scenario, run.table["time"]), {}
    solution = truth(place, tuple(sorted({*STEPS, *SHORT})))
    return {"time": solution.time, **solution.signals}, solution.estimated_error


def both_estimates(run: Coupled) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Return the estimated errors of both kinds, and what they cost relative to the run."""
    errors, costs = {}, {}
    for kind in RATIOS:
        copy = replace(run, scenario=run.scenario.changed(estimate=kind))
        other = estimate_error(copy)
        errors[kind] = {name: _of_time(parts) for name, parts in copy.error_parts.items()}
        costs[kind] = _solves(other) / _solves(run) if other else float("nan")
    return errors, costs


def _of_time(parts: Parts) -> float:
    """Return the error of macro step, coupling and inner steps; the true solution is on the run's own mesh."""
    return float(parts.coupling or 0.0) + float(parts.inner_steps or 0.0)


def _solves(run: Coupled) -> int:
    """Return the steps of the cable, which cost most; without one, those of any mass."""
    return run.log.solves.get("cable", max(run.log.solves.values()))


def described(place: str, one: Scenario, signal: str) -> str:
    """Return what a case is, in words."""
    control = one.master.get("local_tolerance")
    tolerance = f", local tolerance {control:g}" if control else ""
    return f"{place}, `{one.simulation.master}`, {1e3 * one.simulation.macro_step:g} ms{tolerance}, {signal}"


def shares(cases: Sequence[Case], kind: str) -> tuple[float, float, float]:
    """Return the shares of estimates that are right, too small, too large (or not known)."""
    ratios = np.array([case.ratio[kind] for case in cases])
    small, right = float(np.mean(ratios < 1.0 / FACTOR)), float(np.mean((ratios >= 1.0 / FACTOR) & (ratios <= FACTOR)))
    return right, small, abs(1.0 - right - small)


def table(cases: Sequence[Case]) -> str:
    """Return how the estimates of each group are spread, and what they cost."""
    lines = [
        "| cases | number | second run | right | too small | too large | estimate/error, median | cost, median |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in (*GROUPS, "all"):
        group = [case for case in cases if name in (case.group, "all")]
        for kind in RATIOS:
            counted = " | ".join(f"{share:.1%}" for share in shares(group, kind))
            medians = (
                np.median([values[kind] for values in column])
                for column in zip(*((c.ratio, c.cost) for c in group), strict=True)
            )
            lines.append(
                f"| {name} | {len(group)} | {kind} | {counted} | " + " | ".join(f"{m:.2f}" for m in medians) + " |"
            )
    return "\n".join(lines)


def wrong(cases: Sequence[Case], kind: str) -> str:
    """Return the cases outside the band in words, the smallest ratio first."""
    outside = [case for case in cases if not 1.0 / FACTOR <= case.ratio[kind] <= FACTOR]
    listed = (f"{case.words}: {case.ratio[kind]:.2g}" for case in sorted(outside, key=lambda c: c.ratio[kind]))
    return f"Outside the band with the {kind} run, estimate/error: {'; '.join(listed) or 'none'}."


def run(figures: Path) -> Result:
    """Run the grid, count and draw."""
    found = measured()
    _draw(figures / "error_estimate.png", found.cases)
    outside = 1.0 - shares(found.cases, "finer")[0]
    label = "all cases, finer second run: share of estimates not within a factor 3"
    rows = [Row(label, outside, 0.0, "monolithic and analytic solutions", 0.1, relative=False)]
    caption = (
        "Left: error estimated by the finer run over true error, both relative to peak-to-peak; grey: a factor 3. "
        "Right: share of the cases below a ratio of estimated to true error"
    )
    left = f"{len(found.cases)} cases; left out: {found.constant} constant signals, "
    left += f"{found.unjudged} where the true solution is not accurate enough."
    remark = f"{left} Cost: steps of the cable (or a mass) in the second run over those in the first.\n\n"
    return Result(
        rows, [("error_estimate.png", caption)], f"{remark}{table(found.cases)}\n\n{wrong(found.cases, 'finer')}"
    )


def _draw(path: Path, cases: Sequence[Case]) -> None:
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(7.4, 3.7), width_ratios=(1.1, 1.0))
        _draw_calibration(left, cases)
        _draw_shares(right, cases)
        figure.savefig(path)
        plt.close(figure)


def _draw_calibration(axes: Axes, cases: Sequence[Case]) -> None:
    """Draw the estimates of the finer run over the true errors."""
    errors = np.array([case.error for case in cases])
    limits = np.array([0.3 * errors.min(), 3.0 * errors.max()])
    axes.fill_between(limits, limits / FACTOR, limits * FACTOR, color="0.9", linewidth=0.0)
    axes.plot(limits, limits, color=GREY, linewidth=0.8)
    for group, colour, marker in zip(GROUPS, COLOURS, MARKERS, strict=False):
        mine = [case for case in cases if case.group == group]
        x, y = [case.error for case in mine], [case.error * case.ratio["finer"] for case in mine]
        axes.scatter(x, y, s=15, marker=marker, color=colour, alpha=0.75, linewidth=0.0, label=group, zorder=3)
    axes.set(xscale="log", yscale="log", xlim=limits, ylim=limits, box_aspect=1.0)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(100.0))
        axis.set_minor_locator(NullLocator())
    axes.set(xlabel="True error / peak-to-peak [–]", ylabel="Estimated error / peak-to-peak [–]")
    axes.legend(loc="upper left", handletextpad=0.2, borderaxespad=0.2, fontsize=7.5)


def _draw_shares(axes: Axes, cases: Sequence[Case]) -> None:
    """Draw the cumulative distribution of estimated over true error for both second runs."""
    axes.axvspan(1.0 / FACTOR, FACTOR, color="0.9", linewidth=0.0)
    axes.axvline(1.0, color=GREY, linewidth=0.8)
    for kind, colour in zip(RATIOS, (BLUE, VERMILION), strict=True):
        label = f"{kind} run:\n{shares(cases, kind)[0]:.0%} within\na factor 3"
        ratios = np.nan_to_num([case.ratio[kind] for case in cases], nan=np.inf)
        axes.ecdf(ratios, color=colour, label=label)
    axes.set(xscale="log", xlim=(0.01, 20.0), ylim=(0.0, 1.0), xticks=(0.1, 1 / 3, 1, 3, 10))
    axes.set(
        xticklabels=("0.1", "1/3", "1", "3", "10"), xlabel="Estimated / true error [–]", ylabel="Share of the cases [–]"
    )
    axes.xaxis.set_minor_locator(NullLocator())
    axes.legend(loc="upper left", handlelength=1.2, borderaxespad=0.2, labelspacing=0.8, fontsize=7.5)
