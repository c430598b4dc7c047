"""Pictures and a page, drawn from the directory of a run or a comparison alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from html import escape
from math import isnan
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError, OrchestratorError
from orchestrator.coupling.run.results import Table, read_json, replacing
from orchestrator.landing.flight import flight
from orchestrator.landing.safety import HEAD, rows, why_not_judged
from orchestrator.report.signals import extremes, in_the_air, panels_for
from orchestrator.runs.compare import Comparison
from orchestrator.runs.errors import NAMES, Parts
from orchestrator.runs.files import read_comparison, read_run, require_finished
from orchestrator.runs.result import Run, verdict_word

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{title}</title>
<style>body{{font:15px/1.5 system-ui,sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}
table{{border-collapse:collapse;margin:1em 0}}
th,td{{text-align:left;padding:.2em 1.2em .2em 0;border-bottom:1px solid #ddd}}
img{{max-width:100%;margin:1em 0}}</style>
<h1>{title}</h1>
{body}
</html>
"""


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
    return list(_pictures(directory, _results(directory)))


def _results(directory: Path) -> Comparison | list[Run]:
    """Return the comparison in `directory`, or the run, or those of a comparison that was not finished."""
    if (directory / "comparison.json").is_file():
        return read_comparison(directory)
    folders = run_folders(directory)
    if not folders:
        raise InputError(f"{directory}: no summary.json; there are no results of a run")
    return [read_run(folder) for folder in folders]


def _pictures(directory: Path, results: Comparison | list[Run]) -> Iterator[Path]:
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
    from orchestrator.report import plots

    if len(run.time) < 2:
        return
    folder = directory / "plots"
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
        limits(folder / "limits.png", run.limits, run.table, run.fields.get("tension"))
        yield folder / "limits.png"


def _shapes(folder: Path, run: Run) -> Iterator[Path]:
    from orchestrator.report import plots

    if run.fields and "robot.body.position.z" in run.table:
        plots.shapes(folder / "shapes.png", run.fields, run.table)
        yield folder / "shapes.png"


def legend(run: Run) -> str:
    """Return master and macro step, for people."""
    return f"{run.master}, {1e3 * run.macro_step:g} ms"


# -- the page -------------------------------------------------------------------------------------------------


def report(directory: Path) -> Path:
    """Draw the pictures of a finished run or comparison anew and return the page that shows them.

    Raises
    ------
    InputError : there are no results, or they are damaged
    """
    require_finished(directory)
    try:
        results, manifest = _results(directory), read_json(directory / "manifest.json")
        pictures = list(_pictures(directory, results))
        return _write_page(directory, manifest, list(_tables(results)), pictures)
    except Exception as error:  # whatever is in a damaged folder: a file of another kind, half a table, a missing key
        if isinstance(error, OrchestratorError) or (isinstance(error, OSError) and error.errno):
            raise  # said already; or the system's word, a full disk for instance
        raise InputError(f"{directory}: damaged results ({type(error).__name__}: {error}); run it again") from error


def _tables(results: Comparison | list[Run]) -> Iterator[list[tuple[str, ...]]]:
    """Yield the tables of a comparison or of runs, the head of each first."""
    if isinstance(results, Comparison):
        yield _comparison_rows(results)
        yield from _safety_rows(results.reference.safety, "reference")
        for run in results.results:
            yield from _safety_rows(run.summary, run.label)
        return
    for run in results:
        yield _summary_rows(run)
        yield from _safety_rows(run.summary)
        yield [
            ("signal", "unit", "start", "min", "max", "end"),
            *extremes(run.table, run.tolerances, run.summary["units"]),
        ]


def _comparison_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    head = ("master", "macro step [s]", "signal", "coupling", "mesh", "whole error", "tolerance", "verdict")
    return [head] + [
        (
            c.master,
            f"{c.macro_step:g}",
            c.signal,
            *("–" if share is None else f"{share:.2e}" for share in (c.coupling, c.mesh, c.error)),
            f"{c.tolerance:g}",
            verdict_word(c.passed, c.note),
        )
        for c in comparison.checks
    ]


def _safety_rows(said: Mapping[str, Any], whose: str = "") -> Iterator[list[tuple[str, ...]]]:
    """Yield the verdict on safety and its reasons, then the margins; nothing of a general graph."""
    if said.get("safety"):
        verdict = [("safety" + (f", {whose}" if whose else ""), said["safety"])]
        yield [*verdict, *(("not judged", line) for line in why_not_judged(said))]
    if said.get("limits"):
        yield [HEAD, *rows(said)]


def _summary_rows(run: Run) -> list[tuple[str, ...]]:
    summary = run.summary
    shown = ("robot", "stiffness_set", "master", "exchange", "macro_step", "simulated_s", "wall_s")
    shown += ("iterations_per_step", "unconverged_steps", "left_the_groove")
    energy = summary.get("energy") or {}
    lines = [("energy " + name, str(energy[name])) for name in ("drift_J", "exchanged_J", "verdict") if name in energy]
    lines += [(f"estimated error of {name}", _error_words(parts)) for name, parts in run.error_parts.items()]
    lines += [("in the air", line) for line in in_the_air(run.table)]
    return [("what", "value"), *((name, str(summary[name])) for name in shown if name in summary), *lines]


def _error_words(parts: Parts) -> str:
    if isnan(parts.total):
        return "not known"
    values = (f"{NAMES[part]} {value:.2e}" for part, value in parts.known.items())
    return f"{parts.total:.2e} ({', '.join(values)})"


def _write_page(
    directory: Path, manifest: dict[str, Any], tables: list[list[tuple[str, ...]]], pictures: list[Path]
) -> Path:
    body = [] if manifest["complete"] else [f"<p><b>Incomplete:</b> {escape(str(manifest['error']))}</p>"]
    body += [_html_table(rows) for rows in tables]
    body += [_image(picture.relative_to(directory)) for picture in pictures if picture.is_file()]
    page = directory / "report.html"
    with replacing(page) as temporary:
        title = escape(manifest["resolved"]["title"])
        temporary.write_text(PAGE.format(title=title, body="\n".join(body)), encoding="utf-8")
    return page


def _image(place: Path) -> str:
    return f'<img src="{escape(place.as_posix())}" alt="{escape(place.with_suffix("").as_posix())}">'


def _html_table(rows: Iterable[tuple[str, ...]]) -> str:
    head, *body = rows
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in body]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
