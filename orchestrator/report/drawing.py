"""Pictures, drawn from the directory of a run or a comparison alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import Table
from orchestrator.landing.fields import tension_of
from orchestrator.landing.flight import flight
from orchestrator.report.signals import panels_for
from orchestrator.report.thinned import left_out, thinned
from orchestrator.runs.compare import Comparison
from orchestrator.runs.files import read_comparison, read_run
from orchestrator.runs.result import Run


def draw(directory: Path) -> list[Path]:
    """Draw the pictures of a run or a comparison, and of its runs, from what stands in `directory`.

    Returns
    -------
    list of Path
        the pictures, in folders ``plots``; none of a run that ended before its second communication point

    Raises
    ------
    InputError : there are no results
    """
    return list(pictures(directory, results_in(directory)))


def results_in(directory: Path) -> Comparison | list[Run]:
    """Return the comparison in `directory`, or the run, or those of a comparison that was not finished."""
    if (directory / "comparison.json").is_file():
        return read_comparison(directory)
    folders = run_folders(directory)
    if not folders:
        raise InputError(f"{directory}: no summary.json; there are no results of a run")
    return [read_run(folder) for folder in folders]


def pictures(directory: Path, results: Comparison | list[Run]) -> Iterator[Path]:
    """Draw the pictures of what was read from `directory`; yield each when it is there."""
    if isinstance(results, Comparison):
        for run in results.results:
            yield from draw_run(directory / run.label, run, results.reference.table)
        yield from draw_comparison(directory, results)
        return
    for folder, run in zip(run_folders(directory), results, strict=True):
        yield from draw_run(folder, run)


def run_folders(directory: Path) -> list[Path]:
    """Return the folder of a run itself, or those of the runs of a comparison that was not finished."""
    if (directory / "summary.json").is_file():
        return [directory]
    return sorted(path.parent for path in directory.glob("*/summary.json"))


def draw_run(directory: Path, run: Run, reference: Table | None = None) -> Iterator[Path]:
    """Draw the pictures of one run into ``plots``; yield each when it is there."""
    from orchestrator.report import style

    if len(run.time) < 2:
        return
    shown = thinned(run)
    with style.noted(left_out(shown, run)):
        yield from _drawn(directory / "plots", shown, reference)


def _drawn(folder: Path, run: Run, reference: Table | None) -> Iterator[Path]:
    from orchestrator.report import plots

    if len(run.table) > 1:
        yield _overview(folder, run, reference)
    plots.iterations(folder / "iterations.png", {legend(run): run.iterations})
    yield folder / "iterations.png"
    yield from _limits(folder, run)
    yield from _shapes(folder, run)
    if run.energy is not None:
        plots.energy(folder / "energy.png", run.energy)
        yield folder / "energy.png"


def draw_comparison(directory: Path, comparison: Comparison) -> Iterator[Path]:
    """Draw the pictures of all runs together, and the overview of the first; yield each when it is there."""
    from orchestrator.report import accuracy, plots

    runs = [run for run in comparison.results if len(run.time) > 1]
    if not runs:
        return
    folder, reference, first = directory / "plots", comparison.reference.table, runs[0]
    yield _overview(folder, first, reference)
    plots.errors(folder / "errors.png", {legend(run): run.table for run in runs}, reference, _panels(first, reference))
    yield folder / "errors.png"
    plots.iterations(folder / "iterations.png", {legend(run): run.iterations for run in runs})
    yield folder / "iterations.png"
    yield from _limits(folder, first)
    yield from _shapes(folder, first)
    if len({run.macro_step for run in comparison.runs}) > 1 and comparison.tolerance:
        accuracy.convergence(folder / "convergence.png", comparison)
        yield folder / "convergence.png"
    if len(comparison.runs) > 1 and comparison.tolerance:
        accuracy.work_precision(folder / "work_precision.png", comparison)
        yield folder / "work_precision.png"


def _overview(folder: Path, run: Run, reference: Table | None) -> Path:
    from orchestrator.report import plots

    panels = _panels(run, reference)
    plots.overview(folder / "overview.png", run.table, reference, panels, flight(run.table))
    return folder / "overview.png"


def _panels(run: Run, reference: Table | None) -> list[Any]:
    """Return the panels of a run; with a reference those of signals that it has as well."""
    table = run.table if reference is None else {name: x for name, x in run.table.items() if name in reference}
    return panels_for(table, run.tolerances, run.summary["units"])


def _limits(folder: Path, run: Run) -> Iterator[Path]:
    from orchestrator.report.limits import limits

    if run.limits:
        limits(folder / "limits.png", run.limits, run.table, tension_of(run.fields))
        yield folder / "limits.png"


def _shapes(folder: Path, run: Run) -> Iterator[Path]:
    from orchestrator.report import plots

    if run.fields and "robot.body.position.z" in run.table:
        plots.shapes(folder / "shapes.png", run.fields, run.table)
        yield folder / "shapes.png"


def legend(run: Run) -> str:
    """Return master and macro step, for people."""
    return f"{run.master}, {1e3 * run.macro_step:g} ms"
