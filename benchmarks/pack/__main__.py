"""Run the benchmark pack, make its references anew, write it out for others, score their results."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.pack import figures, package, results, table
from benchmarks.pack.case import REFERENCES, Case
from benchmarks.pack.cases import CASES
from benchmarks.pack.contest import TITLES, Extent, contested
from orchestrator.coupling.errors import InputError, RunError, nearest

app = typer.Typer(add_completion=False, help=__doc__, pretty_exceptions_enable=False)
AT_ONCE = ("ours", "ecos")
"""Engines of a short run, if none is asked for."""
Cases = Annotated[list[str] | None, typer.Option("--case", help=f"a case, or several: {', '.join(CASES)}")]
Engines = Annotated[list[str] | None, typer.Option("--engine", help=f"an engine, or several: {', '.join(TITLES)}")]
Quick = Annotated[bool, typer.Option("--quick", help=f"short runs of {' and '.join(AT_ONCE)}; nothing is written")]


@app.callback(invoke_without_command=True)
def run(ctx: typer.Context, case: Cases = None, engine: Engines = None, quick: Quick = False) -> None:
    """Run cases with engines; write docs/benchmarks.json, the page's tables and its pictures."""
    if ctx.invoked_subcommand is not None:
        return
    engines = _chosen(engine or (list(AT_ONCE) if quick else None), TITLES, "engine")
    for one in _cases(case):
        rows = [_shown(one, row) for row in contested(one, engines, Extent(quick))]
        if not quick:
            results.add(one, engines, rows)
    if not quick:
        fill()


@app.command()
def fill() -> None:
    """Write tables and pictures of the page from docs/benchmarks.json alone."""
    found = results.read()
    table.PAGE.write_text(table.filled(table.PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
    figures.draw(found)


@app.command()
def references(case: Cases = None) -> None:
    """Make the reference solutions anew, with their errors."""
    for one in _cases(case):
        found = one.solved()
        found.write(REFERENCES, one.name)
        typer.echo(f"{one.name}: {_numbers(found.relative_error())}")


@app.command()
def export(folder: Path, case: Cases = None) -> None:
    """Write the pack for other groups: FMUs, SSP and OSP structures, references, a page for each case."""
    for one in _cases(case):
        typer.echo(package.written(one, folder))


@app.command()
def score(folder: Path, result: Path) -> None:
    """Print the errors of a result (CSV) of the case that `export` has written into FOLDER."""
    for name, error, reference in package.scored(folder, result):
        typer.echo(f"{name}: {error:.2e} of the range (reference good to {reference:.0e})")


def _cases(names: list[str] | None) -> list[Case]:
    return [CASES[name] for name in _chosen(names, CASES, "case")]


def _chosen(names: list[str] | None, known: Iterable[str], what: str) -> list[str]:
    """Return the names that are asked for, all if none is; `InputError` names the nearest of one that is not known."""
    known = list(known)
    for name in names or []:
        if name not in known:
            raise InputError(f"no {what} {name!r}{nearest(name, known)}; there are {', '.join(known)}")
    return names or known


def _shown(case: Case, row: dict[str, Any]) -> dict[str, Any]:
    """Print a row."""
    head = f"{case.name:18s} {row['engine']:9s} {row['master']:18s} {1e3 * row['macro_step']:6g} ms  "
    if "why" in row:
        typer.echo(head + row["why"])
    else:
        costs = f"{row['solves']:.2f} solves a step, {1e3 * row['cpu']:.0f} ms of CPU a second"
        typer.echo(f"{head}{_numbers(row['error'])}, {costs}")
    return row


def _numbers(by_signal: dict[str, float]) -> str:
    return ", ".join(f"{table.short(name)} {value:.1e}" for name, value in by_signal.items())


def main() -> None:
    """Run the program; what is wrong with its input is one line."""
    try:
        app()
    except (InputError, RunError) as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
