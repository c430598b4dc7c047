"""docs/benchmarks.json: what was measured, a part for each case."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.pack.case import Case
from benchmarks.pack.cases import CASES
from benchmarks.pack.contest import TITLES
from orchestrator.coupling.run.results import read_json, write_json

DOCS = Path(__file__).resolve().parents[2] / "docs"
FILE = DOCS / "benchmarks.json"


def merged(found: dict[str, Any], case: Case, engines: Sequence[str], rows: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return the results with new rows of a case in the place of all that it had of these engines."""
    kept = [one for one in found.get(case.name, {}).get("rows", []) if one["engine"] not in engines]
    reference = case.reference()
    part = {
        "stop": case.stop,
        "grid": case.grid,
        "expensive": case.expensive,
        "reference": {"method": reference.method, "error": reference.relative_error()},
        "python": platform.python_version(),
        "rows": sorted([*rows, *kept], key=_place),
    }
    both = found | {case.name: part}
    return {name: both[name] for name in CASES if name in both}


def _place(one: dict[str, Any]) -> int:
    """Return where a row's engine stands among all."""
    return list(TITLES).index(one["engine"])


def add(case: Case, engines: Sequence[str], rows: Sequence[dict[str, Any]], file: Path = FILE) -> None:
    """Write new rows of a case into the file."""
    write_json(file, merged(read(file), case, engines, rows))


def read(file: Path = FILE) -> dict[str, Any]:
    """Return what was measured by case; nothing if there is no file yet."""
    return read_json(file) if file.exists() else {}
