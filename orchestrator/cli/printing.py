"""What the commands print: tables and answers on stdout, progress and complaints on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

from orchestrator.coupling.errors import DONE, FAILED, INTERRUPTED, MISSED

if TYPE_CHECKING:
    from orchestrator.runs.compare import Comparison
    from orchestrator.runs.record import Coupled


def status(runs: list[Coupled], within: bool) -> int:
    """Return the exit status, and say on stderr what failed."""
    from orchestrator.coupling.run.interrupt import Interruption

    status = DONE if within and not any(coupled.log.unconverged for coupled in runs) else MISSED
    for coupled in runs:
        if coupled.log.unconverged:
            complain(f"{coupled.label}: {_unconverged(coupled)}")
        for contact in coupled.fallen:
            complain(f"{contact}: the cable left the groove; the robot has fallen off")
        drift = coupled.energy.warning() if coupled.energy is not None else None
        if drift is not None:
            complain(f"{coupled.label}: {drift}")
        if coupled.log.error is not None:
            complain(f"{coupled.label}: {coupled.log.error}; the results up to there are kept")
            status = INTERRUPTED if isinstance(coupled.log.error, Interruption) else FAILED
    return status


def _unconverged(coupled: Coupled) -> str:
    """Return how many macro steps did not converge, where, and what helps."""
    log, steps = coupled.log, [step for step in coupled.log.steps if not step.converged]
    return (
        f"{len(steps)} of {len(log.steps)} macro steps did not converge, the first at t = {steps[0].time:g} s (residual "
        f"{steps[0].residual:.1e}); see iterations.csv, take a smaller macro step or another implicit master"
    )


def print_run(coupled: Coupled) -> None:
    from rich.table import Table

    from orchestrator.report.plots import panels_for

    if coupled.exchange_asked != coupled.exchange:
        complain(
            f"cable or robot has no means or slopes for exchange {coupled.exchange_asked}: {coupled.exchange} in its place"
        )
    log, table = coupled.log, Table("signal", "unit", "start", "min", "max", "end", box=None, pad_edge=False)
    for panel in panels_for(coupled.table):
        values = coupled.table[panel.signal] * panel.factor
        numbers = (values[0], values.min(), values.max(), values[-1])
        table.add_row(panel.signal, panel.unit, *(f"{number:.5g}" for number in numbers))
    print_table(table)
    print(
        f"{coupled.master}, macro step {log.macro_step:g} s: {len(log.steps)} steps, "
        f"{log.iterations_per_step:.2f} iterations a step, {log.unconverged} unconverged, {log.wall:.2f} s"
    )
    for line in _estimates(coupled):
        print(line)
    if coupled.energy is not None:
        print(f"energy drift: {coupled.energy.drift:.2g} J of {coupled.energy.exchanged:.3g} J exchanged")


def _estimates(coupled: Coupled) -> Iterator[str]:
    """Yield a line for each signal with a tolerance: its estimated error beside what is allowed."""
    from orchestrator.runs.compare import CONSTANT

    for name, error in coupled.estimated_error.items():
        values, tolerance = coupled.table[name], coupled.scenario.simulation.tolerances[name]
        share = error / max(float(values.max() - values.min()), CONSTANT)
        if coupled.estimate_failure:
            kind = coupled.scenario.simulation.estimate
            yield f"estimated error of {name}: not known, the {kind} run failed: {coupled.estimate_failure}"
            continue
        verdict = "within" if share <= tolerance else "MISSED"
        yield f"estimated error of {name}: {error:.1e} ({share:.1e} of its range, allowed {tolerance:g}): {verdict}"


def print_comparison(comparison: Comparison) -> None:
    from rich.table import Table

    from orchestrator.runs.record import verdict_word

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
def progress_bars(quiet: bool) -> Iterator[Callable[[str, float], Callable[[float], None]]]:
    """Give a function that starts a bar, and returns what tells the bar how far the run is."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} of {task.total:g} s"),
    )
    console = Console(stderr=True, quiet=quiet)
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=quiet) as bars:

        def start(description: str, total: float) -> Callable[[float], None]:
            task = bars.add_task(description, total=total)
            return lambda time: bars.update(task, completed=time)

        yield start


def complain(message: str) -> None:
    print(f"orchestrator: {message}", file=sys.stderr)


@cache
def complain_once(message: str) -> None:
    """Print it on stderr, but once in a command, which may read a scenario many times."""
    complain(message)
