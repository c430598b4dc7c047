"""Who writes a run directory, and who reads it: tables, fields, summary, pictures, page, and last the manifest.

Pictures and page are made by whoever calls, from what stands there: one that fails is noted and loses no run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from orchestrator.coupling.errors import InputError, OrchestratorError
from orchestrator.coupling.run.columns import Columns
from orchestrator.coupling.run.results import Table, plain, read_fields, read_json, read_table
from orchestrator.coupling.run.steps import KINDS
from orchestrator.runs.compare import Comparison
from orchestrator.runs.directory import RunDirectory, manifest
from orchestrator.runs.going_on import FOLDER, keep_signals
from orchestrator.runs.result import Run

FIELD_UNITS = {
    "time": "s", "arc_length": "m", "position": "m", "tension": "N",
    "node_arc_length": "m", "node_position": "m", "node_slope": "1", "tension_max": "N",
}  # fmt: skip
FMU_LOG = "fmu.log"
Manifest = dict[str, Any]


@dataclass(frozen=True)
class Views:
    """What people look at, made in a directory: the pictures, and the page, which shows what the manifest will say."""

    pictures: Callable[[Path], object] = lambda directory: None
    page: Callable[[Path, Manifest], object] = lambda directory, manifest: None


NO_VIEWS = Views()


# -- writing --------------------------------------------------------------------------------------------------


def write_run(directory: RunDirectory, run: Run, views: Views = NO_VIEWS) -> Run:
    """Write all files of a run and return it as it stands there; one that ended early is marked as incomplete."""
    _write_tables(directory, run)
    notes = _viewed(directory, run, run.error, views)
    return _finish(directory, run, notes)


def write_comparison(directory: RunDirectory, comparison: Comparison, views: Views = NO_VIEWS) -> Comparison:
    """Write ``comparison.json``, the reference and a run directory for each run, then the manifest."""
    reference = comparison.reference
    directory.write_table("reference.csv", reference.table)
    if reference.fields:
        directory.write_fields("reference.h5", reference.fields, FIELD_UNITS)
    if comparison.reference_energy is not None:
        directory.write_json("reference.json", {"energy": comparison.reference_energy.content()})
    directory.write_json("comparison.json", comparison.content())
    errors = [run.error for run in comparison.results if run.error]
    results = _write_runs(directory, comparison.results, views, "; ".join(errors) or None)
    return replace(comparison, results=results, directory=directory.path)


def write_unfinished(directory: RunDirectory, runs: Sequence[Run], error: str, views: Views = NO_VIEWS) -> None:
    """Write the runs of a comparison that could not be finished, a directory each, then the manifest with `error`."""
    _write_runs(directory, runs, views, error)


def _write_runs(directory: RunDirectory, runs: Sequence[Run], views: Views, error: str | None) -> list[Run]:
    folders = [RunDirectory.within(directory, run.label) for run in runs]
    for folder, run in zip(folders, runs, strict=True):
        _write_tables(folder, run)
    notes = _viewed(directory, runs[0], error, views)
    written = [_finish(folder, run, notes) for folder, run in zip(folders, runs, strict=True)]
    directory.write_manifest(_dependencies(runs[0]) | notes, error)
    return written


def _write_tables(directory: RunDirectory, run: Run) -> None:
    directory.write_table("results.csv", run.table)
    directory.write_table("iterations.csv", run.iterations)
    if run.fields:
        directory.write_fields("fields.h5", run.fields, FIELD_UNITS)
    if "tension_max" in run.fields:  # the shapes at some times; all are in this file
        keep_signals(directory.path)
    if run.messages:
        directory.write_lines(FMU_LOG, run.messages)
    directory.write_json("summary.json", run.summary)


def _viewed(directory: RunDirectory, run: Run, error: str | None, views: Views) -> dict[str, str | None]:
    """Let pictures and page be made; return why there are none of either, None where there are."""
    drawn = _failure(lambda: views.pictures(directory.path))
    said = plain(manifest(_dependencies(run) | {"pictures": drawn}, error))
    return {"pictures": drawn, "page": _failure(lambda: views.page(directory.path, said))}


def _failure(make: Callable[[], object]) -> str | None:
    """Return why something could not be made; None if it was."""
    try:
        make()
    except Exception as error:  # whatever it is: the numbers are there, and worth more
        return f"{type(error).__name__}: {error}"
    return None


def _finish(directory: RunDirectory, run: Run, notes: dict[str, str | None]) -> Run:
    directory.write_manifest(_dependencies(run) | notes, run.error)
    return replace(run, directory=directory.path, manifest=read_json(directory.path / "manifest.json"))


def _dependencies(run: Run) -> dict[str, Any]:
    return {name: value for name, value in run.manifest.items() if name not in ("complete", "error")}


def write_end(directory: RunDirectory, first: Run, error: str, views: Views = NO_VIEWS) -> None:
    """Write what stands beside the runs of a comparison that has died: page and manifest, with `error`."""
    directory.write_manifest(_dependencies(first) | _viewed(directory, first, error, views), error)


# -- reading --------------------------------------------------------------------------------------------------


def load_run(directory: Path | str) -> Run:
    """Return the result of the finished run in `directory`; `InputError` if there is none."""
    require_finished(Path(directory))
    return undamaged(Path(directory), read_run)


def load_comparison(directory: Path | str) -> Comparison:
    """Return the finished comparison in `directory`; `InputError` if there is none."""
    require_finished(Path(directory))
    return undamaged(Path(directory), read_comparison)


Read = TypeVar("Read")


def undamaged(directory: Path, read: Callable[[Path], Read]) -> Read:
    """Return what `read` makes of a directory; `InputError` where it is damaged, whatever that comes to."""
    try:
        return read(directory)
    except OrchestratorError:
        raise
    except Exception as error:  # a file of another kind, half a table, a missing key
        raise InputError(f"{directory}: damaged results ({type(error).__name__}: {error}); run it again") from error


def _said(path: Path) -> dict[str, Any]:
    """Return the content of a JSON file that is a table."""
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no table but {type(content).__name__}; run it again")
    return content


def require_finished(directory: Path) -> None:
    """Raise `InputError` where `directory` is not that of a finished run or comparison."""
    if (directory / "manifest.json").is_file():
        return
    message = f"{directory}: no manifest.json; it is not the directory of a finished run"
    if (directory / FOLDER).is_dir():
        message += "; what an unfinished one has left is read by load_unfinished, and drawn by `orchestrator report`"
    raise InputError(message)


def read_run(directory: Path) -> Run:
    """Return what the run in `directory` has left, its manifest still missing or not."""
    manifest = directory / "manifest.json"
    return Run(
        read_table(directory / "results.csv"),
        _counted(read_table(directory / "iterations.csv")),
        read_fields(directory / "fields.h5"),
        _said(directory / "summary.json"),
        _said(manifest) if manifest.is_file() else {},
        directory,
        _lines(directory / FMU_LOG),
    )


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []


def read_comparison(directory: Path) -> Comparison:
    """Return the comparison in `directory` with its runs, its manifest still missing or not."""
    comparison = Comparison.from_content(
        read_json(directory / "comparison.json"), read_table(directory / "reference.csv")
    )
    comparison.reference.fields = read_fields(directory / "reference.h5")
    results = [read_run(directory / run.label) for run in comparison.runs]
    return replace(comparison, results=results, directory=directory)


def _counted(table: Table) -> Table:
    if isinstance(table, Columns):
        return table.of_kinds({name: KINDS[name] for name in table if name in KINDS})
    return {name: np.asarray(values, dtype=KINDS.get(name, float)) for name, values in table.items()}
