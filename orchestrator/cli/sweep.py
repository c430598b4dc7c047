"""``orchestrator sweep``: many landings, and how surely they are safe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestrator.cli import options, printing
from orchestrator.cli.start import importing

if TYPE_CHECKING:
    from orchestrator.studies.sweep.solve import Swept


def sweep(
    study: Annotated[str, typer.Argument(metavar="STUDY", help="Study file (TOML), or the name of a shipped one.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of results; taken up again. Default: runs/sweep-STUDY.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes. Default: one a processor.")] = None,
    timeout: Annotated[float | None, typer.Option(help="Seconds that a run may take. Default: the study's.")] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers make the runs. Default: here.")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Run a scenario with many values: which landings are safe, by which margin, and how probably.

    An interrupted sweep goes on where it was. Exit status 1 where a run has failed.
    """
    with importing():
        from orchestrator.coupling.errors import DONE, MISSED
        from orchestrator.report.drawn import drawn
        from orchestrator.studies.sweep import bars, maps, odds, write
        from orchestrator.studies.sweep.solve import sweep as run_all
        from orchestrator.studies.sweep.study import load_study, path_of

    read = load_study(path_of(study))
    folder = write.place_of(out, read)
    with _bar(quiet) as told:
        found = run_all(
            read, folder / write.STORE, lambda swept: write.save(folder, swept), workers, timeout, told, dask
        )
    _print(found)
    print(f"table in {folder / write.TABLE}")
    pictures = (
        lambda: maps.write(folder, read, found.outcomes),
        lambda: odds.write(folder, read, found.chances),
        lambda: bars.write(folder, found.sensitivities),
    )
    for path in chain(*map(drawn, pictures)):
        print(f"picture in {path}")
    if (missing := write.page(folder)) is not None:
        printing.complain(missing)
    else:
        print(f"page in {folder / 'report.html'}")
    raise typer.Exit(MISSED if found.failed else DONE)


def _print(found: Swept) -> None:
    """Print how many are safe, how probably, and which runs failed."""
    from orchestrator.studies.sweep import odds, write
    from orchestrator.studies.sweep.ranges import all_ranges

    print(write.said(found))
    for line in [*all_ranges(found.study, found.outcomes), *odds.words(found.study, found.chances)]:
        print(line)
    if found.chances:
        printing.print_table(write.CHANCES, write.chance_rows(found))
    if found.sensitivities:
        printing.print_table(write.INDICES, write.index_rows(found))
    for outcome in found.failed:
        printing.complain(f"run {outcome.row.number}: {outcome.done.failure}")


@contextmanager
def _bar(quiet: bool) -> Iterator[Callable[[int, int, int], None]]:
    """Give what shows runs done, failures so far, and the time left."""
    from fmus.kernels import notice

    notice.muted = quiet
    if quiet:
        yield lambda done, of, failed: None
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

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("runs", total=None)

        def show(done: int, of: int, failed: int) -> None:
            bars.update(task, description=f"runs, {failed} failed", completed=done, total=of)

        yield show
