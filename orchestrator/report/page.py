"""Pictures and a page, from the tables of a run or a comparison, just made or read back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import Table, read_fields, read_json, read_table, replacing
from orchestrator.runs.compare import Comparison
from orchestrator.runs.record import Record, run_label, verdict_word

PAGE = """<!doctype html>
<meta charset="utf-8"><title>{title}</title>
<style>body{{font:15px/1.5 system-ui,sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}
table{{border-collapse:collapse}}
th,td{{text-align:left;padding:.2em 1.2em .2em 0;border-bottom:1px solid #ddd}}
img{{max-width:100%;margin:1em 0}}</style>
<h1>{title}</h1>
{body}
"""


def draw_run(directory: Path, record: Record, reference: Table | None, tolerances: Mapping[str, float]) -> None:
    """Draw the pictures of one run into ``plots``; `tolerances` are those of the signals that it is judged by."""
    from orchestrator.landing import audit
    from orchestrator.report import plots

    if len(record.table["time"]) < 2:
        return
    folder = directory / "plots"
    panels = plots.panels_for(record.table, reference, list(tolerances))
    plots.overview(folder / "overview.png", record.table, reference, panels)
    plots.iterations(folder / "iterations.png", {record.legend: record.steps})
    if record.fields and "robot.body.position.z" in record.table:
        plots.shapes(folder / "shapes.png", record.fields, record.table)
    energy = audit.of_coupled(record.table, tolerances.values())
    if energy is not None:
        plots.energy(folder / "energy.png", energy)


def draw_comparison(directory: Path, comparison: Comparison, records: Sequence[Record]) -> None:
    """Draw the pictures of all runs together, and the overview of the first."""
    from orchestrator.report import plots

    records = [record for record in records if len(record.table["time"]) > 1]
    if not records:
        return
    folder, reference, signals = directory / "plots", comparison.reference.table, list(comparison.tolerance)
    panels = plots.panels_for(records[0].table, reference, signals)
    plots.overview(folder / "overview.png", records[0].table, reference, panels)
    plots.errors(folder / "errors.png", {r.legend: r.table for r in records}, reference, panels)
    plots.iterations(folder / "iterations.png", {r.legend: r.steps for r in records})
    if records[0].fields and "robot.body.position.z" in records[0].table:
        plots.shapes(folder / "shapes.png", records[0].fields, records[0].table)
    if len({run.macro_step for run in comparison.runs}) > 1 and signals:
        plots.convergence(folder / "convergence.png", comparison)
    if len(comparison.runs) > 1 and signals:
        plots.work_precision(folder / "work_precision.png", comparison)


def report(directory: Path) -> Path:
    """Draw the pictures of a finished run or comparison anew and return the page that shows them."""
    if not (directory / "manifest.json").is_file():
        raise InputError(f"{directory}: no manifest.json; it is not the directory of a finished run")
    manifest = read_json(directory / "manifest.json")
    tolerances = manifest["resolved"]["simulation"]["tolerances"]
    if (directory / "comparison.json").is_file():
        content = read_json(directory / "comparison.json")
        comparison = Comparison.from_content(content, read_table(directory / "reference.csv"))
        labels = [run_label(run.master, run.macro_step) for run in comparison.runs]
        draw_comparison(directory, comparison, [read_record(directory / label) for label in labels])
        rows = _comparison_rows(comparison)
    else:
        draw_run(directory, read_record(directory), None, tolerances)
        rows = _summary_rows(read_json(directory / "summary.json"))
    return _write_page(directory, manifest, rows)


def read_record(directory: Path) -> Record:
    """Return what the run in `directory` left."""
    summary = read_json(directory / "summary.json")
    return Record(
        summary["master"],
        summary["macro_step"],
        read_table(directory / "results.csv"),
        read_table(directory / "iterations.csv"),
        read_fields(directory / "fields.h5"),
    )


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
