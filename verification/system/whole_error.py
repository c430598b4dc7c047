"""The whole error that a run estimates, time and mesh together, against the true one.

A grid written down before it was run: six lines of 10 to 500 m, landing points from near a support to midspan, drops from
0 to 1 m, robots of one and two wheels of 10 to 100 kg, contact stiffnesses of 1e8 and 1e10 N/m^2.5, each line with each
height, the rest in turn; no mesh keys, 5 ms, 2 s. Z, roll, and the peak contact force. *True* is the difference from the
monolithic solution on four times as many elements, with a local tolerance of 1e-9 m. Right is an estimate within a factor 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from orchestrator.report.style import COLOURS, GREY, MARKERS, STYLE
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.errors import CONSTANT, differences, judged, range_of
from orchestrator.runs.estimate import estimate_error, solved
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.read import load
from verification.study import Result, Row

TITLE = "Whole error"
FOLDER = Path(__file__).resolve().parents[2] / "scenarios"
STOP, FACTOR, FINE, TRUTH = 2.0, 3.0, 4.0, 1e-9
TOLERANCES = {"robot.body.position.z": 1e-3, "robot.roll": 1e-2, "contact1.normal_force_max": 1e-2}
PARAMETERS = ("span", "sag", "level_difference", "linear_density", "axial_stiffness", "bending_stiffness")
LINES: dict[str, tuple[str, tuple[float, ...]]] = {
    "rig, 10 m": ("rig_10m", ()),
    "60 m": ("landing_200m_point9", (60.0, 0.6, 2.0, 0.7, 1.5e7, 300.0)),
    "200 m, table1": ("landing_200m_point9", ()),
    "200 m, physical": ("landing_200m_point9_undamped", ()),
    "300 m, inclined": ("landing_200m_point9", (300.0, 6.0, 12.0, 0.964, 2.11e7, 821.0)),
    "500 m": ("landing_200m_point9", (500.0, 14.0, 0.0, 1.35, 3.4e7, 1500.0)),
}
SPANS = {"rig, 10 m": 10.0, "60 m": 60.0, "300 m, inclined": 300.0, "500 m": 500.0}
HEIGHTS = (0.0, 0.05, 0.3, 1.0)
POSITIONS = (0.2, 0.5, 0.05, 0.35, 0.1)
ROBOTS = ("fptlir", "hybrid_robot_2", "fptlir_10kg")
STIFFNESSES = (1e8, 1e8, 1e8, 1e10)


@dataclass(frozen=True)
class Case:
    """One signal of one run: its true error and the estimated one, by its range, and the part that is most of it."""

    words: str
    signal: str
    true: float
    estimated: float
    part: str
    allowed: float


def systems() -> Iterator[tuple[str, System]]:
    """Yield the grid: what a case is in words, and the landing."""
    for i, (line, height) in enumerate(product(LINES, HEIGHTS)):
        file, numbers = LINES[line]
        position = POSITIONS[i % len(POSITIONS)] * SPANS.get(line, 200.0)
        robot, stiffness = ROBOTS[i % len(ROBOTS)], STIFFNESSES[i % len(STIFFNESSES)]
        settings = [f"cable.parameters.{name}={value}" for name, value in zip(PARAMETERS, numbers, strict=False)]
        settings += [f"landing.position={position}", f"landing.height={height}"]
        settings += [f"contact.parameters.stiffness={stiffness}", f"simulation.stop_time={STOP}"]
        words = f"{line}, at {position:g} m from {height:g} m, {robot}, k = {stiffness:.0e}"
        yield words, resolve(load(FOLDER / f"{file}.toml", settings, robot))


def cases_of(words: str, system: System) -> Iterator[Case]:
    """Run one landing with its estimate, and hold it against the truth."""
    run = run_coupled(system)
    estimate_error(run)
    finer = system.meshed(FINE)
    assert finer is not None
    truth = solved(finer.system, run.table["time"], lambda _: None, TRUTH)
    errors = differences(run.table, truth, judged(run.table, TOLERANCES))
    for name, error in errors.items():
        scale = range_of(truth[name])
        if name in TOLERANCES and scale > CONSTANT:
            parts = run.error_parts[name]
            yield Case(words, name, error / scale, parts.total / scale, parts.largest, TOLERANCES[name])


def run(figures: Path) -> Result:
    """Run the grid, count and draw."""
    cases = [case for words, system in systems() for case in cases_of(words, system)]
    _draw(figures / "whole_error.png", cases)
    wrong = [case for case in cases if not 1.0 / FACTOR <= case.estimated / case.true <= FACTOR]
    misled = [case for case in cases if case.estimated <= case.allowed and case.true >= FACTOR * case.allowed]
    rows = [
        Row("share of estimates not within a factor 3", len(wrong) / len(cases), 0.0, "finer solution", 0.1, False),
        Row("cases said to be within, three times the tolerance off", len(misled), 0.0, "finer solution", 0.5, False),
    ]
    caption = "Estimated over true error, by the signal's range; grey: a factor 3"
    return Result(rows, [("whole_error.png", caption)], f"{len(cases)} signals.\n\n{_table(cases)}\n\n{_listed(wrong)}")


def _table(cases: Sequence[Case]) -> str:
    lines = ["| signal | number | right | true error, median | largest | within tolerance | mesh is most of it |"]
    lines.append("|---|---|---|---|---|---|---|")
    for name in TOLERANCES:
        mine = [case for case in cases if case.signal == name]
        ratios, true = np.array([c.estimated / c.true for c in mine]), np.array([c.true for c in mine])
        right = np.mean((ratios >= 1.0 / FACTOR) & (ratios <= FACTOR))
        mesh = np.mean([case.part == "mesh" for case in mine])
        within = np.mean([case.true <= case.allowed for case in mine])
        lines.append(
            f"| {name} | {len(mine)} | {right:.0%} | {np.median(true):.1e} | {true.max():.1e} | {within:.0%} | {mesh:.0%} |"
        )
    return "\n".join(lines)


def _listed(wrong: Sequence[Case]) -> str:
    listed = (
        f"{c.words}, {c.signal}: {c.estimated / c.true:.2g} (true {c.true:.1e})"
        for c in sorted(wrong, key=lambda c: c.estimated / c.true)
    )
    return f"Outside the band, estimated over true: {'; '.join(listed) or 'none'}."


def _draw(path: Path, cases: Sequence[Case]) -> None:
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(4.6, 4.3))
        true = np.array([case.true for case in cases])
        limits = np.array([0.3 * true.min(), 3.0 * true.max()])
        axes.fill_between(limits, limits / FACTOR, limits * FACTOR, color="0.9", linewidth=0.0)
        axes.plot(limits, limits, color=GREY, linewidth=0.8)
        for name, colour, marker in zip(TOLERANCES, COLOURS, MARKERS, strict=False):
            mine = [case for case in cases if case.signal == name]
            label = name.removeprefix("robot.").removeprefix("contact1.")
            points = [case.true for case in mine], [case.estimated for case in mine]
            axes.scatter(*points, s=18, color=colour, marker=marker, alpha=0.8, linewidth=0.0, label=label, zorder=3)
        axes.set(xscale="log", yscale="log", xlim=limits, box_aspect=1.0)
        axes.set(xlabel="True error / range [–]", ylabel="Estimated error / range [–]")
        axes.legend(loc="upper left", handletextpad=0.2, fontsize=7.5)
        figure.savefig(path)
        plt.close(figure)
