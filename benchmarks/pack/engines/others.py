"""Engines of others: each runs in a process of its own what we export, and counts its own CPU time."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pack.case import Case
from benchmarks.pack.engines.run import Run
from orchestrator.coupling.run.results import Table
from orchestrator.export.write import export

ROOT = Path(__file__).resolve().parents[3]
MASTER = "explicit"
COUNTS = "one do_step of the component a macro step"
PATIENCE = 900.0
"""s, for all steps of one case."""


def unavailable(library: str) -> str:
    """Return that a library is not installed; empty if it is."""
    return "" if find_spec(library) is not None else f"{library} is not installed: pip install -e '.[engines]'"


def packed(case: Case, folder: Path) -> Path:
    """Return the SSP archive of a case, which serves all shorter macro steps too; `InputError` or `RunError` if it fails."""
    path = folder / f"{case.name}.ssp"
    export(case.scenario(master="jacobi", macro_step=max(case.others)), ssp_file=path)
    return path


def runs(engine: str, archive: Path, case: Case, macro_steps: Sequence[float], stop: float) -> Iterator[Run]:
    """Yield the runs of a case up to `stop` (s) by an engine; what ends its process costs that run alone."""
    left = list(macro_steps)
    while left:
        found, failure = _driven(engine, archive, case, left, stop)
        for one in found:
            H = left.pop(0)
            yield Run(engine, MASTER, H, _table(case, one["rows"]), round(stop / H), one["cpu"])
        if left:
            yield Run(engine, MASTER, left.pop(0), {}, why=failure)


def _driven(
    engine: str, archive: Path, case: Case, macro_steps: Sequence[float], stop: float
) -> tuple[list[dict[str, Any]], str]:
    """Return rows and CPU time of the runs as far as they came, and why no further."""
    plan = [(H, round(stop / H), case.every(H)) for H in macro_steps]
    command = [sys.executable, "-m", f"benchmarks.pack.engines.{engine}", str(archive), json.dumps(plan), *case.signals]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return [], f"no end within {PATIENCE:g} s"
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"cpu"')]
    return found, _last_words(done.stderr) or f"the process ended with status {done.returncode}"


def _last_words(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""


def _table(case: Case, rows: list[list[float]]) -> Table:
    """Return the signals by name; their start is that of the reference, which no engine shows before its first step."""
    start = case.reference().table
    values = np.array(rows, dtype=float)
    table = {name: np.append(start[name][0], values[:, j]) for j, name in enumerate(case.signals)}
    return {"time": case.times[: len(values) + 1]} | table
