"""Who takes part, and the runs of cases by engines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.pack.case import Case, Reference
from benchmarks.pack.engines import ecos, fmpy, libcosim, others, ours
from benchmarks.pack.engines.run import Run
from benchmarks.pack.norm import errors
from orchestrator.coupling.run.compare import observed_order

OTHERS = {module.NAME: module for module in (fmpy, libcosim, ecos)}
TITLES = {ours.NAME: ours.TITLE} | {name: module.TITLE for name, module in OTHERS.items()}
"""Engines, by name."""
WRONG = 1.0
"""An error that is no result: as large as the motion itself."""


@dataclass(frozen=True)
class Extent:
    """How much of a case is run: all of it, or a short run with the two longest steps of ours, the longest of others."""

    quick: bool = False

    def stop(self, case: Case) -> float:
        """Return the end of the runs, s."""
        return case.quick if self.quick else case.stop

    def ours(self, case: Case) -> list[tuple[str, float]]:
        """Return our masters and their macro steps, s."""
        few = (*case.implicit[:2], case.explicit[0])
        return [one for one in ours.plan(case) if not self.quick or one[1] in few]

    def others(self, case: Case) -> tuple[float, ...]:
        """Return the macro steps of the other engines, s."""
        return case.others[:1] if self.quick else case.others


def contested(case: Case, engines: Sequence[str], extent: Extent) -> Iterator[dict[str, Any]]:
    """Yield a row for each run of a case by the engines."""
    stop = extent.stop(case)
    reference = case.reference().until(stop)
    if ours.NAME in engines:
        for master, step in extent.ours(case):
            yield row(ours.run(case, master, step, stop), reference, stop)
    with TemporaryDirectory() as folder:
        for run in _by_others(case, [name for name in engines if name in OTHERS], extent, Path(folder)):
            yield row(run, reference, stop)


def _by_others(case: Case, engines: Sequence[str], extent: Extent, folder: Path) -> Iterator[Run]:
    """Yield the runs of other engines, all of one archive."""
    steps = extent.others(case)
    lacking = {name: others.unavailable(OTHERS[name].LIBRARY) for name in engines}
    for name, why in lacking.items():
        yield from (Run(name, others.MASTER, step, {}, why=why) for step in steps if why)
    present = [name for name, why in lacking.items() if not why]
    archive = others.packed(case, folder) if present else folder
    for name in present:
        yield from others.runs(name, archive, case, steps, extent.stop(case))


def row(run: Run, reference: Reference, stop: float) -> dict[str, Any]:
    """Return the row of a run: its errors and costs, or why there are none."""
    about = {"engine": run.engine, "master": run.master, "macro_step": run.macro_step}
    if run.why:
        return about | {"why": run.why}
    found = errors(run.table, reference.table)
    if not np.all(np.array(list(found.values())) < WRONG):
        return about | {"why": "unstable: wrong by more than the motion"}
    steps = round(stop / run.macro_step)
    costs = {"solves": run.solves / steps, "solves_a_second": run.solves / stop, "cpu": run.cpu / stop}
    return about | {"error": found} | costs | {"unconverged": run.unconverged}


def orders(rows: Iterable[dict[str, Any]]) -> dict[tuple[str, str], dict[str, float]]:
    """Return by engine and master the order that each signal shows between the two shortest steps."""
    series: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in rows:
        if "error" in one:
            series.setdefault((one["engine"], one["master"]), []).append(one)
    return {key: _order(sorted(found, key=_step)[:2]) for key, found in series.items() if len(found) > 1}


def _step(one: dict[str, Any]) -> float:
    return one["macro_step"]


def _order(two: list[dict[str, Any]]) -> dict[str, float]:
    steps = [one["macro_step"] for one in two]
    return {name: observed_order(steps, [one["error"][name] for one in two]) for name in two[0]["error"]}
