"""What the commands print: tables and answers on stdout, progress and complaints on stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from orchestrator.cli.terminal import complain

if TYPE_CHECKING:
    from orchestrator.landing.contract import Finding
    from orchestrator.landing.modes import CableModes
    from orchestrator.landing.robot_modes import SystemModes
    from orchestrator.landing.safety import Limits
    from orchestrator.runs.compare import Comparison
    from orchestrator.runs.errors import Parts
    from orchestrator.runs.result import Run
    from orchestrator.studies.reproduce import Reproduction

COLOURS = {
    "ok": "green", "pass": "green", "missing": "red", "wrong": "red", "FAIL": "red", "advice": "yellow",
    "EXCEEDED": "red", "NOT CLEAR": "red",
}  # fmt: skip
"""First word of a verdict → its colour on a terminal."""


# -- a run ----------------------------------------------------------------------------------------------------


def print_run(run: Run) -> None:
    """Print the extremes of the main signals, the cost, the estimated error and the drift of the energy."""
    from orchestrator.landing.line_state import rest_words
    from orchestrator.report.signals import extremes, in_the_air

    summary = run.summary
    for note in run.wiring:
        complain(note)
    for name, count in summary.get("fmu_warnings", {}).items():
        complain(f"{name}: the FMU has warned {count} times; fmu.log has what it says")
    if summary.get("line"):
        print(rest_words(summary["line"]))
    rows = extremes(run.table, run.tolerances, summary["units"])
    print_table(("signal", "unit", "start", "min", "max", "end"), rows)
    print(
        f"{run.master}, macro step {run.macro_step:g} s: {summary['steps']} steps, "
        f"{summary['iterations_per_step']:.2f} iterations a step, {summary['unconverged_steps']} unconverged, "
        f"{summary['wall_s']:.2f} s"
    )
    for line in in_the_air(run.table):
        print(f"in the air: {line}")
    print_safety(run.summary)
    _print_estimates(run)
    if run.energy is not None:
        print(f"energy drift: {run.energy.drift:.2g} J of {run.energy.exchanged:.3g} J exchanged")
    if (made := summary.get("energy_made")) is not None:
        end, largest = (_joules(made[key]) for key in ("end_J", "largest_J"))
        booked = f"{made['loads_booked']} of {made['loads']} loads booked"
        print(f"energy made by the coupling: {end}, at most {largest} on the way; {booked}")


def _joules(energy: float | None) -> str:
    """Return an energy for people; a run that ends in overflow has none."""
    return "unknown" if energy is None else f"{energy:.2g} J"


def page_of(directory: Path | None) -> str:
    """Return where the page of a run or comparison is, to be added to where its results are; empty where there is none."""
    page = directory / "report.html" if directory is not None else None
    return f", page {page}" if page is not None and page.is_file() else ""


def print_safety(said: Mapping[str, Any], whose: str = "") -> None:
    """Print each limit with its worst value and margin, the verdict, and what is not judged.

    Parameters
    ----------
    said : as in ``summary.json``
    whose : what it is said of, where there are several
    """
    from orchestrator.landing.safety import HEAD, rows, why_not_judged

    if said.get("limits"):
        print_table(HEAD, rows(said))
    if said.get("safety"):
        typer.secho(f"{whose}{said['safety']}", fg={True: "green", False: "red", None: "yellow"}[said["safe"]])
        for line in why_not_judged(said):
            print(f"not judged: {line}")


def print_limits(limits: Limits) -> None:
    """Print the limits of a landing: each with the formula that it follows from, its numbers, and its source."""
    from orchestrator.landing.safety import readable

    head = ("limit", "value", "unit", "formula", "source")
    lines = []
    for limit in limits.known.values():
        value, unit = readable(limit.value, limit.unit)
        formula = f"{limit.formula.text} = {limit.formula.filled}" if limit.formula is not None else "given"
        formula = f"T_max / {1e-3 * limit.reference:.4g} kN" if limit.name == "tension" and limit.reference else formula
        lines.append((limit.name, f"{value:.4g}", unit, formula, limit.source))
    print_table(head, lines)
    for name, why in limits.missing.items():
        print(f"not judged: {name} ({why})")


def _print_estimates(run: Run) -> None:
    """Print the estimated error of each signal judged by its parts, as shares of its range."""
    from orchestrator.runs.errors import NAMES, RIGHT, range_of

    if not run.error_parts:
        return
    covered = next(iter(run.error_parts.values())).covered
    often = RIGHT[run.summary["estimate"]]
    print(f"estimated error, by the signal's range, right within a factor 3 in {often}; it covers {', '.join(covered)}")
    rows = [_error_row(name, parts, range_of(run.table[name]), run) for name, parts in run.error_parts.items()]
    print_table(("signal", *NAMES.values(), "sum", "allowed", "verdict"), rows)
    if run.estimate_failure:
        print(f"estimated error: not known, {run.estimate_failure}")


def _error_row(name: str, parts: Parts, scale: float, run: Run) -> tuple[str, ...]:
    from orchestrator.runs.errors import verdict_on

    shares = [None if part is None else part / scale for part in parts.by_part.values()]
    cells = ["–" if share is None else _share(share) for share in (*shares, parts.total / scale)]
    tolerance = run.tolerances.get(name)
    if tolerance is None:
        return (name, *cells, "", "")
    verdict = verdict_on(parts, tolerance * scale, bool(run.estimate_doubts))
    return (name, *cells, f"{tolerance:g}", "MISSED" if verdict == "missed" else verdict)


def _share(share: float) -> str:
    return "?" if isnan(share) else f"{share:.1e}"


# -- a comparison ---------------------------------------------------------------------------------------------


def print_comparison(comparison: Comparison) -> None:
    """Print the reference, cost and errors of every run, and the observed orders."""
    reference, energy = comparison.reference, comparison.reference_energy
    print(f"reference: {reference.kind}, {reference.wall_s:.2f} s")
    if energy is not None:
        print(f"reference's energy drift: {energy.drift:.2g} J of {energy.exchanged:.3g} J exchanged")
        if (warning := energy.warning()) is not None:
            complain(f"reference: {warning}")
    print_table(("master", "H [s]", "iterations", "unconverged", "cable steps", "wall [s]"), _costs(comparison))
    print("error, by the signal's range; the coupling's includes that of the inner steps")
    print_table(("master", "H [s]", "signal", "coupling", "mesh", "whole", "allowed", "verdict"), _checks(comparison))
    for master, orders in comparison.observed_order.items():
        shown = ", ".join(f"{name} {orders[name]:.2f}" for name in comparison.tolerance if name in orders)
        print(f"observed order, {master}: {shown}")
    _print_safeties(comparison)


def _print_safeties(comparison: Comparison) -> None:
    """Print whether the landing was safe by the reference, with its margins, and by each run."""
    print_safety(comparison.reference.safety, "reference: ")
    for run in comparison.results:
        if run.safety:
            print(f"{run.label}: {run.safety}")


def _costs(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    for r in comparison.runs:
        numbers = (f"{r.iterations_per_step:.2f}", f"{r.unconverged_steps}", f"{r.cable_steps}", f"{r.wall_s:.2f}")
        yield r.master, f"{r.macro_step:g}", *numbers


def _checks(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    from orchestrator.runs.result import verdict_word

    for c in comparison.checks:
        verdict = verdict_word(c.passed, c.note)
        shares = ("–" if share is None else f"{share:.2e}" for share in (c.coupling, c.mesh, c.error))
        yield c.master, f"{c.macro_step:g}", c.signal, *shares, f"{c.tolerance:g}", verdict


# -- what there is, what an FMU lacks, modes ------------------------------------------------------------------


def print_catalogue(groups: Mapping[str, Mapping[str, str]]) -> None:
    """Print names with a line each, under the title of their group."""
    for title, lines in groups.items():
        print_table((title, ""), ((f"  {name}", line) for name, line in lines.items()))


def print_findings(kind: str, findings: Iterable[Finding]) -> None:
    """Print point by point what was found of a contract."""
    print_table((f"{kind} contract", "", ""), ((f.what, f.verdict, f.note) for f in findings))


def print_modes(found: CableModes) -> None:
    """Print frequencies and damping ratios."""
    groups = (found.out_of_plane, found.in_plane)
    count = max(group.frequency.size for group in groups)
    rows = [
        (str(k + 1), *(f"{x[k]:{form}}" if k < x.size else "" for g in groups for x, form in g.columns()))
        for k in range(count)
    ]
    print_table(("mode", "out of plane [Hz]", "damping", "in plane [Hz]", "damping"), rows)


def print_robot_modes(found: SystemModes, count: int) -> None:
    """Print the first `count` modes of the line with the robot on it, and what is to be said of them."""
    from orchestrator.landing.robot_modes import SHARES

    few = found.first(count)
    numbers = zip(few.kinds, few.frequency, few.damping_ratio, few.growth, few.shares, strict=True)
    rows = [
        (str(k), kind, f"{f:.5g}", f"{zeta:.3g}", f"{growth:.3g}", *(f"{abs(100.0 * share):.0f}" for share in shares))
        for k, (kind, f, zeta, growth, shares) in enumerate(numbers, start=1)
    ]
    head = ("mode", "", "frequency [Hz]", "damping", "growth [1/s]", *(f"{share} [%]" for share in SHARES))
    print_table(head, rows)
    for warning in found.warnings:
        complain(warning)


def print_reproduction(found: Reproduction) -> None:
    """Print the verdict on every claim, and on stderr which runs failed."""
    from orchestrator.studies.markdown import number

    judge = found.book.judged_by
    ours = [row.ours.get(judge) or next(iter(row.ours.values()), None) for row in found.rows]
    rows = (
        (row.claim.id, number(row.claim.values), number(values, 4), row.claim.unit, row.verdict)
        for row, values in zip(found.rows, ours, strict=True)
    )
    print_table(("claim", "paper", f"ours, {judge}", "unit", "verdict"), rows)
    for line in found.book.failures():
        complain(line)


# -- tables and lines -----------------------------------------------------------------------------------------


def print_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print columns on stdout, each as wide as its widest cell; no line ends in blanks. Verdicts are coloured on a
    terminal."""
    lines = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(head, *lines, strict=True)]
    for i, line in enumerate((head, *lines)):
        *cells, last = (
            _styled(cell, bold=i == 0) + " " * (w - len(cell)) for cell, w in zip(line, widths, strict=True)
        )
        typer.echo("  ".join([*cells, last.rstrip()]).rstrip())


def _styled(cell: str, bold: bool) -> str:
    colour = COLOURS.get(cell.partition(":")[0])
    return typer.style(cell, fg=colour, bold=bold or None) if cell and (colour or bold) else cell


@contextmanager
def progress_bars(quiet: bool) -> Iterator[Callable[[str, float, float], None]]:
    """Give what shows a bar for each task, and how far it is."""
    from fmus.kernels import notice

    notice.muted = quiet
    if quiet:
        yield lambda task, time, stop: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} of {task.total:g} s"),
    )
    tasks = dict[str, TaskID]()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as bars:

        def show(task: str, time: float, stop: float) -> None:
            if task not in tasks:
                tasks[task] = bars.add_task(task, total=stop)
            bars.update(tasks[task], completed=time)

        yield show


@contextmanager
def counting_bar(quiet: bool, what: str) -> Iterator[Callable[[int, int], None]]:
    """Give what shows how many of several things are done, and how long the rest will take."""
    from fmus.kernels import notice

    notice.muted = quiet
    if quiet:
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn(what), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task(what, total=None, visible=False)  # what is wrong with the input is said before
        yield lambda done, of: bars.update(task, completed=done, total=of, visible=True)


def complain_of(runs: Iterable[Run]) -> None:
    """Say on stderr what went wrong in `runs`."""
    for run in runs:
        for line in run.warnings:
            complain(f"{run.label}: {line}")
