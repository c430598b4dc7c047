"""What a sweep leaves: ``table.csv``, a row a run; ``study.json``; and the runs themselves in ``runs/``."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import read_json, replacing, write_json
from orchestrator.runs.directory import circumstances
from orchestrator.studies.sweep import atlas
from orchestrator.studies.sweep.outcome import cells
from orchestrator.studies.sweep.sensitivity import Index
from orchestrator.studies.sweep.solve import Swept, describe
from orchestrator.studies.sweep.study import Study

STORE, TABLE, PARQUET, MAP, RESULT = atlas.STORE, "table.csv", "table.parquet", "map.json", "study.json"
ALWAYS = ("safe", "least_margin")
"""Columns that are there even where nothing is judged."""
Columns = dict[str, np.ndarray]
"""Columns of a table by name, (n,) each: numbers (NaN where one is not known) or words."""


def place_of(out: Path | None, study: Study) -> Path:
    """Return the folder of a sweep; one that holds something else, or another study, is refused."""
    folder = out or Path("runs") / f"sweep-{study.name}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is no folder; choose another with --out")
    if folder.is_dir() and any(folder.iterdir()):
        _require_same(folder, study)
    return folder


def _require_same(folder: Path, study: Study) -> None:
    cure = "choose another with --out, or remove it"
    if not (folder / RESULT).is_file():
        raise InputError(f"{folder}: holds something else than a sweep; {cure}")
    there = read_json(folder / RESULT)
    if not isinstance(there, dict) or "hash" not in there:
        raise InputError(f"{folder / RESULT}: is not a sweep's; {cure}")
    if there["hash"] == study.hash:
        return
    if there.get("study") == study.name:
        raise InputError(f"{folder}: {study.path} has changed since the sweep there; {cure}")
    raise InputError(f"{folder}: holds the sweep of another study, {there.get('study')}; {cure}")


def save(folder: Path, found: Swept) -> None:
    """Write table and maps, then ``study.json``: what is complete has all."""
    rows = [cells(found.study, outcome) for outcome in found.outcomes]
    write_rows(folder / TABLE, rows)
    write_parquet(folder / PARQUET, folder / TABLE)
    write_json(folder / MAP, atlas.content(found))
    write_json(folder / RESULT, {**describe(found), **circumstances()})


def page(folder: Path) -> str | None:
    """Make the page of a sweep; return why there is none, if it cannot be made."""
    from orchestrator.report.page import write_sweep

    try:
        write_sweep(folder)
    except Exception as error:  # whatever it is: the numbers are there, and worth more
        return f"no page: {type(error).__name__}: {error}"
    return None


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as CSV: flags as 1 and 0, numbers that read back bit for bit, nothing where nothing is known."""
    names = list(dict.fromkeys(name for row in rows for name in row if name in ALWAYS or _is_known(rows, name)))
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_text(row.get(name)) for name in names] for row in rows)


def _is_known(rows: Sequence[Mapping[str, Any]], name: str) -> bool:
    """Whether a column has a value anywhere: a limit that no landing has needs none."""
    return any(row.get(name) is not None for row in rows)


def _text(value: Any) -> str:
    if value is None:
        return ""
    return str(int(value)) if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def read_columns(path: Path) -> Columns:
    """Return the columns of a ``table.csv``."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            names, *rows = csv.reader(file)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as the table of a sweep: {error}") from None
    return {name: _column([row[i] for row in rows]) for i, name in enumerate(names)}


def _column(texts: list[str]) -> np.ndarray:
    """Return numbers where all are; else words."""
    try:
        numbers = np.array([float(text) if text else np.nan for text in texts], float)
    except ValueError:
        return np.array(texts, dtype=object)
    return np.array(texts, dtype=object) if not any(texts) else numbers


def write_parquet(path: Path, table: Path) -> None:
    """Write the columns of `table` as Parquet, where pyarrow is there: numbers as such, null where nothing is known."""
    if find_spec("pyarrow") is None:
        return
    pyarrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    columns = {
        name: pyarrow.array(values, from_pandas=True)
        if values.dtype == float
        else pyarrow.array(values.tolist(), "string")
        for name, values in read_columns(table).items()
    }
    with replacing(path) as temporary:
        parquet.write_table(pyarrow.table(columns), temporary)


# -- words ------------------------------------------------------------------------------------------------------


CHANCES = ("where", "limit", "samples", "probability", "95 % interval", "not known")


def said(found: Swept) -> str:
    """Return how many runs there are of each kind, in a line."""
    counts = found.counts
    names = {"safe": "safe", "not_safe": "not safe", "not_judged": "not judged", "failed": "failed"}
    kinds = ", ".join(f"{counts[key]} {name}" for key, name in names.items() if counts[key])
    early = "; stopped, because the interval is as narrow as asked" if found.stopped else ""
    return f"{counts['runs']} runs: {kinds}{early}"


def chance_rows(found: Swept) -> Iterator[tuple[str, ...]]:
    """Yield a row for each probability, under `CHANCES`."""
    for one in found.chances:
        where = ", ".join(f"{key} {value}" for key, value in one.where.items())
        for name, p in one.of.items():
            least, most = (f"{x:.4g}" for x in p.estimate)
            estimate = least if least == most else f"{least} to {most}"
            interval = f"{p.interval[0]:.4f} to {p.interval[1]:.4f}"
            yield where, name, str(p.count), estimate, interval, str(p.unknown or "")


INDICES = ("where", "margin", "parameter", "first", "95 % interval", "total", "95 % interval")


def index_rows(found: Swept) -> Iterator[tuple[str, ...]]:
    """Yield a row for each parameter that a margin hangs on, under `INDICES`."""
    for one in found.sensitivities:
        where = ", ".join(f"{key} {value}" for key, value in one.where.items())
        for name in (name for name in one.of if "margin" in name):
            for parameter, both in one.of[name].items():
                texts = (t for index in (both.first, both.total) for t in _index(index))
                yield where, name.removeprefix("margin."), parameter, *texts


def _index(index: Index) -> tuple[str, str]:
    return f"{index.estimate:.3f}", f"{index.interval[0]:.3f} to {index.interval[1]:.3f}"
