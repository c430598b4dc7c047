"""Pictures and a page, drawn from the directory of a run or a comparison alone."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.coupling.run.results import Table, read_json, replacing
from orchestrator.runs.compare import Comparison
from orchestrator.runs.files import read_comparison, read_run, require_finished
from orchestrator.runs.result import Run, verdict_word

PAGE = """<!doctype html>
<meta charset="utf-8"><title>{title}</title>
<style>body{{font:15px/1.5 system-ui,sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}
table{{border-collapse:collapse}}
th,td{{text-align:left;padding:.2em 1.2em .2em 0;border-bottom:1px solid #ddd}}
img{{max-width:100%;margin:1em 0}}</style>
<h1>{title}</h1>
{body}
"""


def draw(directory: Path) -> None:
    """Draw the pictures of a run or a comparison, and of its runs, into ``plots``, from what stands in `directory`."""
    if not (directory / "comparison.json").is_file():
        if (directory / "results.csv").is_file():
            draw_run(directory, read_run(directory))
        return
    comparison = read_comparison(directory)
    for run in comparison.results:
        draw_run(directory / run.label, run, comparison.reference.table)
    draw_comparison(directory, comparison)


def draw_run(directory: Path, run: Run, reference: Table | None = None) -> None:
    """Draw the pictures of one run into ``plots``."""
    from orchestrator.report import plots

    if len(run.time) < 2:
        return
    folder = directory / "plots"
    panels = plots.panels_for(run.table, reference, list(run.tolerances), run.summary["units"])
    plots.overview(folder / "overview.png", run.table, reference, panels)
    plots.iterations(folder / "iterations.png", {legend(run): run.iterations})
    if run.fields and "robot.body.position.z" in run.table:
        plots.shapes(folder / "shapes.png", run.fields, run.table)
    if run.energy is not None:
        plots.energy(folder / "energy.png", run.energy)


def draw_comparison(directory: Path, comparison: Comparison) -> None:
    """Draw the pictures of all runs together, and the overview of the first."""
    from orchestrator.report import plots

    runs = [run for run in comparison.results if len(run.time) > 1]
    if not runs:
        return
    folder, reference, signals = directory / "plots", comparison.reference.table, list(comparison.tolerance)
    first = runs[0]
    panels = plots.panels_for(first.table, reference, signals, first.summary["units"])
    plots.overview(folder / "overview.png", first.table, reference, panels)
    plots.errors(folder / "errors.png", {legend(run): run.table for run in runs}, reference, panels)
    plots.iterations(folder / "iterations.png", {legend(run): run.iterations for run in runs})
    if first.fields and "robot.body.position.z" in first.table:
        plots.shapes(folder / "shapes.png", first.fields, first.table)
    if len({run.macro_step for run in comparison.runs}) > 1 and signals:
        plots.convergence(folder / "convergence.png", comparison)
    if len(comparison.runs) > 1 and signals:
        plots.work_precision(folder / "work_precision.png", comparison)


def legend(run: Run) -> str:
    """Return master and macro step, for people."""
    return f"{run.master}, {1e3 * run.macro_step:g} ms"


def report(directory: Path) -> Path:
    """Draw the pictures of a finished run or comparison anew and return the page that shows them."""
    require_finished(directory)
    manifest = read_json(directory / "manifest.json")
    draw(directory)
    if (directory / "comparison.json").is_file():
        rows = _comparison_rows(read_comparison(directory))
    else:
        rows = _summary_rows(read_json(directory / "summary.json"))
    return _write_page(directory, manifest, rows)


def _comparison_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    head = ("master", "macro step [s]", "signal", "relative error", "tolerance", "verdict")
    return [head] + [
        (
            c.master,
            f"{c.macro_step:g}",
            c.signal,
            f"{c.error:.2e}",
            f"{c.tolerance:g}",
            verdict_word(c.passed, c.note),
        )
        for c in comparison.checks
    ]


def _summary_rows(summary: dict[str, Any]) -> list[tuple[str, ...]]:
    shown = ("robot", "stiffness_set", "master", "exchange", "macro_step", "simulated_s", "wall_s")
    shown += ("iterations_per_step", "unconverged_steps", "left_the_groove")
    energy = summary.get("energy") or {}
    rows = [("energy " + name, str(energy[name])) for name in ("drift_J", "exchanged_J", "verdict") if name in energy]
    errors = summary.get("estimated_error", {}).items()
    rows += [(f"estimated error of {name}", "not known" if e is None else f"{e:.2e}") for name, e in errors]
    return [("what", "value"), *((name, str(summary[name])) for name in shown), *rows]


def _write_page(directory: Path, manifest: dict[str, Any], rows: list[tuple[str, ...]]) -> Path:
    images = sorted((directory / "plots").glob("*.png"))
    body = [] if manifest["complete"] else [f"<p><b>Incomplete:</b> {escape(str(manifest['error']))}</p>"]
    body += [_html_table(rows), *(f'<img src="plots/{i.name}" alt="{i.stem}">' for i in images)]
    page = directory / "report.html"
    with replacing(page) as temporary:
        title = escape(manifest["resolved"]["title"])
        temporary.write_text(PAGE.format(title=title, body="\n".join(body)), encoding="utf-8")
    return page


def _html_table(rows: Iterable[tuple[str, ...]]) -> str:
    head, *body = rows
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in body]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
