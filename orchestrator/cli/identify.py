"""``orchestrator identify``: parameters from claims or measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestrator.cli import options, printing
from orchestrator.cli.start import importing

if TYPE_CHECKING:
    from orchestrator.studies.identification.solve import Identified


def identify(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="Study file (TOML), or one of the paper: points, masses, both.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder of results; taken up again. Default: runs/identify-STUDY.")
    ] = None,
    save: Annotated[Path | None, typer.Option(help="Write the result, JSON, there too.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes. Default: one a processor.")] = None,
    quiet: options.Quiet = False,
) -> None:
    """Find parameters from measurements or claims, and how well these determine them.

    An interrupted study goes on where it was. Exit status 1 where a parameter is not determined, or lies at a bound.
    """
    with importing():
        from orchestrator.coupling.errors import DONE, MISSED
        from orchestrator.coupling.run.results import write_json
        from orchestrator.runs.directory import folder_for
        from orchestrator.studies.identification.solve import identify as find
        from orchestrator.studies.identification.study import load_study, path_of
        from orchestrator.studies.identification.write import STORE, content, place_of, write

    found_study = load_study(path_of(study))
    folder = place_of(out, found_study.name)
    if save is not None:
        folder_for(save.parent, "--save")
    with _search_line(quiet) as told:
        found = find(found_study, folder / STORE, workers, told)
    _print(found)
    written = write(folder, found)
    if save is not None:
        write_json(save, content(found))
    print(f"page in {written[1]}")
    raise typer.Exit(MISSED if found.doubts else DONE)


def _print(found: Identified) -> None:
    """Print parameters, what was fitted and what is foretold, and what is doubtful."""
    from orchestrator.studies.identification import write

    printing.print_table(write.PARAMETERS, write.parameter_rows(found))
    printing.print_table(write.DATA, write.data_rows(found))
    for line in found.doubts:
        printing.complain(line)


@contextmanager
def _search_line(quiet: bool) -> Iterator[Callable[[str, int, float], None]]:
    """Give what shows a line: the stage, the sets of parameters calculated, and the least sum of squares."""
    from fmus.kernels import notice

    notice.muted = quiet
    if quiet:
        yield lambda stage, count, least: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("first landings")

        def show(stage: str, count: int, least: float) -> None:
            bars.update(task, description=f"{stage}: {count} sets of parameters, sum of squares {least:.4g}")

        yield show
