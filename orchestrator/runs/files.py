"""Who writes a run directory, and who reads it: tables, fields, summary, pictures, and last the manifest.

The pictures are drawn by whoever calls, from the directory alone: a picture that fails is noted and loses no run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import Table, read_fields, read_json, read_table
from orchestrator.runs.compare import Comparison
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.result import Run

FIELD_UNITS = {
    "time": "s", "arc_length": "m", "position": "m", "tension": "N",
    "node_arc_length": "m", "node_position": "m", "node_slope": "1",
}  # fmt: skip
COUNTS = {"iterations": int, "subdivisions": int, "rejected": int, "columns": int, "converged": bool}
"""Columns of ``iterations.csv`` that are no real numbers."""
FMU_LOG = "fmu.log"
Draw = Callable[[Path], object]
"""Draws the pictures of a run or a comparison into its directory."""


def no_pictures(_: Path) -> None:
    """Draw nothing."""


# -- writing --------------------------------------------------------------------------------------------------


def write_run(directory: RunDirectory, run: Run, draw: Draw = no_pictures) -> Run:
    """Write all files of a run and return it as it stands there; one that ended early is marked as incomplete."""
    _write_tables(directory, run)
    return _finish(directory, run, _drawn(directory, draw))


def write_comparison(directory: RunDirectory, comparison: Comparison, draw: Draw = no_pictures) -> Comparison:
    """Write ``comparison.json``, the reference and a run directory for each run, then the manifest."""
    reference = comparison.reference
    directory.write_table("reference.csv", reference.table)
    if reference.fields:
        directory.write_fields("reference.h5", reference.fields, FIELD_UNITS)
    if comparison.reference_energy is not None:
        directory.write_json("reference.json", {"energy": comparison.reference_energy.content()})
    directory.write_json("comparison.json", comparison.content())
    errors = [run.error for run in comparison.results if run.error]
    results = _write_runs(directory, comparison.results, draw, "; ".join(errors) or None)
    return replace(comparison, results=results, directory=directory.path)


def write_unfinished(directory: RunDirectory, runs: Sequence[Run], error: str) -> None:
    """Write the runs of a comparison that could not be finished, a directory each, then the manifest with `error`."""
    _write_runs(directory, runs, no_pictures, error)


def _write_runs(directory: RunDirectory, runs: Sequence[Run], draw: Draw, error: str | None) -> list[Run]:
    folders = [RunDirectory(directory.path / run.label) for run in runs]
    for folder, run in zip(folders, runs, strict=True):
        _write_tables(folder, run)
    missing = _drawn(directory, draw)
    written = [_finish(folder, run, missing) for folder, run in zip(folders, runs, strict=True)]
    directory.write_manifest(_dependencies(runs[0]) | {"pictures": missing}, error)
    return written


def _write_tables(directory: RunDirectory, run: Run) -> None:
    directory.write_table("results.csv", run.table)
    directory.write_table("iterations.csv", run.iterations)
    if run.fields:
        directory.write_fields("fields.h5", run.fields, FIELD_UNITS)
    if run.messages:
        directory.write_lines(FMU_LOG, run.messages)
    directory.write_json("summary.json", run.summary)


def _drawn(directory: RunDirectory, draw: Draw) -> str | None:
    """Let the pictures be drawn; return why there are none, if they cannot be."""
    try:
        draw(directory.path)
    except Exception as error:  # whatever it is: the numbers are there, and worth more
        return f"{type(error).__name__}: {error}"
    return None


def _finish(directory: RunDirectory, run: Run, missing: str | None) -> Run:
    directory.write_manifest(_dependencies(run) | {"pictures": missing}, run.error)
    return replace(run, directory=directory.path, manifest=read_json(directory.path / "manifest.json"))


def _dependencies(run: Run) -> dict[str, Any]:
    return {name: value for name, value in run.manifest.items() if name not in ("complete", "error")}


# -- reading --------------------------------------------------------------------------------------------------


def load_run(directory: Path | str) -> Run:
    """Return the result of the finished run in `directory`; `InputError` if there is none."""
    require_finished(Path(directory))
    return read_run(Path(directory))


def load_comparison(directory: Path | str) -> Comparison:
    """Return the finished comparison in `directory`; `InputError` if there is none."""
    require_finished(Path(directory))
    return read_comparison(Path(directory))


def require_finished(directory: Path) -> None:
    """Raise `InputError` where `directory` is not that of a finished run or comparison."""
    if not (directory / "manifest.json").is_file():
        raise InputError(f"{directory}: no manifest.json; it is not the directory of a finished run")


def read_run(directory: Path) -> Run:
    """Return what the run in `directory` has left, its manifest still missing or not."""
    manifest = directory / "manifest.json"
    return Run(
        read_table(directory / "results.csv"),
        _counted(read_table(directory / "iterations.csv")),
        read_fields(directory / "fields.h5"),
        read_json(directory / "summary.json"),
        read_json(manifest) if manifest.is_file() else {},
        directory,
        _lines(directory / FMU_LOG),
    )


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


def read_comparison(directory: Path) -> Comparison:
    """Return the comparison in `directory` with its runs, its manifest still missing or not."""
    comparison = Comparison.from_content(
        read_json(directory / "comparison.json"), read_table(directory / "reference.csv")
    )
    comparison.reference.fields = read_fields(directory / "reference.h5")
    results = [read_run(directory / run.label) for run in comparison.runs]
    return replace(comparison, results=results, directory=directory)


def _counted(table: Table) -> Table:
    return {name: np.asarray(values, dtype=COUNTS.get(name, float)) for name, values in table.items()}
