"""What the commands print: tables and answers on stdout, progress and complaints on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fmus.kernels import notice

if TYPE_CHECKING:
    from orchestrator.runs.compare import Comparison
    from orchestrator.runs.result import Run


def complain_of(runs: Sequence[Run]) -> None:
    """Say on stderr what is to be known of `runs`, and what went wrong in them."""
    for note in dict.fromkeys(note for run in runs for note in run.notes):
        complain(note)
    for run in runs:
        for line in run.warnings:
            complain(f"{run.label}: {line}")


def print_run(run: Run) -> None:
    """Print the extremes of the main signals, the cost, the estimated error and the drift of the energy."""
    from rich.table import Table

    from orchestrator.report.plots import panels_for

    summary, units = run.summary, run.summary["units"]
    if summary["exchange_asked"] != summary["exchange"]:
        asked, got = summary["exchange_asked"], summary["exchange"]
        complain(f"cable or robot has no means or slopes for exchange {asked}: {got} in its place")
    table = Table("signal", "unit", "start", "min", "max", "end", box=None, pad_edge=False)
    for panel in panels_for(run.table, units=units):
        values = run.table[panel.signal] * panel.factor
        numbers = (values[0], values.min(), values.max(), values[-1])
        table.add_row(panel.signal, panel.unit, *(f"{number:.5g}" for number in numbers))
    print_table(table)
    print(
        f"{run.master}, macro step {run.macro_step:g} s: {summary['steps']} steps, "
        f"{summary['iterations_per_step']:.2f} iterations a step, {summary['unconverged_steps']} unconverged, "
        f"{summary['wall_s']:.2f} s"
    )
    for line in _estimates(run):
        print(line)
    if run.energy is not None:
        print(f"energy drift: {run.energy.drift:.2g} J of {run.energy.exchanged:.3g} J exchanged")


def _estimates(run: Run) -> Iterator[str]:
    """Yield a line for each signal with a tolerance: its estimated error beside what is allowed."""
    from orchestrator.runs.result import CONSTANT

    for name, error in run.estimated_error.items():
        values, tolerance = run.table[name], run.tolerances[name]
        share = error / max(float(values.max() - values.min()), CONSTANT)
        if run.estimate_failure:
            kind = run.summary["estimate"]
            yield f"estimated error of {name}: not known, the {kind} run failed: {run.estimate_failure}"
            continue
        verdict = "within" if share <= tolerance else "MISSED"
        yield f"estimated error of {name}: {error:.1e} ({share:.1e} of its range, allowed {tolerance:g}): {verdict}"


def print_comparison(comparison: Comparison) -> None:
    from rich.table import Table

    from orchestrator.runs.result import verdict_word

    reference = comparison.reference
    print(f"reference: {reference.kind}, {reference.wall_s:.2f} s")
    energy = comparison.reference_energy
    if energy is not None:
        print(f"reference's energy drift: {energy.drift:.2g} J of {energy.exchanged:.3g} J exchanged")
        if (warning := energy.warning()) is not None:
            complain(f"reference: {warning}")
    costs = Table(
        "master", "H \\[s]", "iterations", "unconverged", "cable steps", "wall \\[s]", box=None, pad_edge=False
    )
    for r in comparison.runs:
        numbers = (
            f"{r.iterations_per_step:.2f}",
            f"{r.unconverged_steps}",
            f"{r.cable_steps}",
            f"{r.wall_s:.2f}",
        )
        costs.add_row(r.master, f"{r.macro_step:g}", *numbers)
    print_table(costs)
    checks = Table("master", "H \\[s]", "signal", "relative error", "allowed", "verdict", box=None, pad_edge=False)
    for c in comparison.checks:
        word = markup(verdict_word(c.passed, c.note))
        shown = f"[green]{word}[/]" if c.passed else f"[red]{word}[/]"
        checks.add_row(c.master, f"{c.macro_step:g}", c.signal, f"{c.error:.2e}", f"{c.tolerance:g}", shown)
    print_table(checks)
    for master, orders in comparison.observed_order.items():
        shown = ", ".join(f"{name} {orders[name]:.2f}" for name in comparison.tolerance if name in orders)
        print(f"observed order, {master}: {shown}")


def print_table(table: object) -> None:
    """Print a rich table on stdout; a pipe gets every column whole."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else 200, highlight=False).print(table)


def markup(text: str) -> str:
    from rich.markup import escape

    return escape(text)


@contextmanager
def progress_bars(quiet: bool) -> Iterator[Callable[[str, float, float], None]]:
    """Give what shows a bar for each task, and how far it is."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} of {task.total:g} s"),
    )
    notice.muted = quiet
    console, tasks = Console(stderr=True, quiet=quiet), dict[str, TaskID]()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=quiet) as bars:

        def show(task: str, time: float, stop: float) -> None:
            if task not in tasks:
                tasks[task] = bars.add_task(task, total=stop)
            bars.update(tasks[task], completed=time)

        yield show


def complain(message: str) -> None:
    print(f"orchestrator: {message}", file=sys.stderr)
