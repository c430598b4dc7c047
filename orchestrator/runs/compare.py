"""How wrong the coupled runs are: errors against a reference, observed orders, verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import MISSED
from orchestrator.coupling.run.compare import (
    SignalError,
    observed_order,
    signal_errors,
)
from orchestrator.coupling.run.results import Table
from orchestrator.landing.audit import Audit, of_monolithic
from orchestrator.landing.intervals import coarsened
from orchestrator.runs.errors import Parts, differences, judged, left_out, range_of
from orchestrator.runs.result import EXIT_STATUS, Run, Verdict, pandas_module, run_label

SAFETY = ("safe", "safety", "limits", "not_judged")
"""Keys of what is said of the safety of a landing."""
REFERENCE_MARGIN = 0.1
"""The reference's own error may be this part of a tolerance, or the verdict means nothing."""


@dataclass
class Reference:
    """The solution that is held against the runs.

    Attributes
    ----------
    kind : how it was made, in words
    table : its signals at all communication points of all runs
    wall_s : s
    estimated_error : its own error by signal, in the signal's unit; of the signals judged with what the finer mesh leaves
    fields : arrays over time, as in ``fields.h5``
    finer : the signals on a mesh `mesh_ratio` times as fine as the runs'; None where no mesh is judged
    safety : what it says of the safety of a landing, as ``summary.json`` of a run; empty of a general graph
    """

    kind: str
    table: Table
    wall_s: float
    estimated_error: dict[str, float]
    fields: dict[str, np.ndarray] = field(default_factory=dict)
    finer: Table | None = None
    mesh_ratio: float = float("nan")
    safety: Mapping[str, Any] = field(default_factory=dict)

    @property
    def safe(self) -> bool | None:
        """Whether the landing is safe by the reference; None where nothing is judged."""
        return self.safety.get("safe")

    def parts(self, table: Table, names: Iterable[str]) -> dict[str, Parts]:
        """Return the errors of a run's signals by their parts; that of the inner steps is in that of the coupling."""
        names = [name for name in names if name in self.table]
        coupling = differences(table, self.table, names)
        if self.finer is None:
            return {name: Parts(error, None, None, error) for name, error in coupling.items()}
        by = left_out(self.mesh_ratio)
        mesh, total = differences(self.table, self.finer, names), differences(table, self.finer, names)
        return {name: Parts(coupling[name], None, by * mesh[name], total[name]) for name in names}


@dataclass
class RunErrors:
    """One coupled run held against the reference: what it cost, and how wrong each signal is.

    `signals` are held against the reference on the run's own mesh: what the coupling costs. `errors` are those of the
    signals judged, by their parts, the mesh's among them.
    """

    master: str
    macro_step: float
    steps: int
    iterations_per_step: float
    unconverged_steps: int
    cable_steps: int
    wall_s: float
    signals: dict[str, SignalError]
    errors: dict[str, Parts] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Master and macro step, as folders are called."""
        return run_label(self.master, self.macro_step)


@dataclass(frozen=True)
class Check:
    """One line of the verdict: a signal of a run against its tolerance; its error and the parts are shares of its range."""

    master: str
    macro_step: float
    signal: str
    error: float
    tolerance: float
    passed: bool
    note: str = ""
    coupling: float | None = None
    mesh: float | None = None


@dataclass(repr=False)
class Comparison:
    """All runs against one reference.

    Attributes
    ----------
    runs : cost and errors of every run, as in ``comparison.json``
    tolerance : the largest `relative_max_error` allowed, by signal
    results : the runs themselves, with their signals, in the same order
    directory : where it was written; None if it was not
    """

    reference: Reference
    runs: list[RunErrors]
    tolerance: dict[str, float]
    results: list[Run] = field(default_factory=list)
    directory: Path | None = None

    @property
    def checks(self) -> list[Check]:
        """Every tolerance held against every run."""
        return [
            _check(run, signal, tolerance, self.reference)
            for run in self.runs
            for signal, tolerance in self.tolerance.items()
        ]

    @property
    def reference_energy(self) -> Audit | None:
        """The reference's energy audit; None where it does not show its energy."""
        return of_monolithic(self.reference.table, self.reference.estimated_error)

    @property
    def passed(self) -> bool:
        """Whether every run meets every tolerance, with every macro step converged."""
        return all(check.passed for check in self.checks) and not any(run.unconverged_steps for run in self.runs)

    @property
    def verdict(self) -> Verdict:
        """``within`` or ``missed``; ``failed`` or ``interrupted`` if a run ended before its time."""
        verdicts = [run.verdict for run in self.results]
        for verdict in reversed(verdicts):
            if verdict in ("failed", "interrupted"):
                return verdict
        return "within" if self.passed and "missed" not in verdicts else "missed"

    @property
    def exit_status(self) -> int:
        """The exit status of ``orchestrator compare``: 0 within and not unsafe, 1 missed or not safe, 3 failed, 130
        interrupted (128 + the number of the signal)."""
        signalled = [run.exit_status for run in self.results if run.verdict == "interrupted"]
        if self.verdict == "interrupted" and signalled:
            return signalled[-1]
        return MISSED if self.verdict == "within" and self.safe is False else EXIT_STATUS[self.verdict]

    @property
    def safe(self) -> bool | None:
        """Whether every run and the reference say that the landing is safe; None where nothing is judged."""
        found = [self.reference.safe, *(run.safe for run in self.results)]
        return False if False in found else None if None in found else True

    @property
    def observed_order(self) -> dict[str, dict[str, float]]:
        """Slope of the largest error over the macro step, by master and signal; two macro steps at least."""
        return {
            master: orders
            for master in dict.fromkeys(run.master for run in self.runs)
            if (orders := _orders([run for run in self.runs if run.master == master]))
        }

    def content(self) -> dict[str, Any]:
        """Return what ``comparison.json`` holds."""
        reference = self.reference
        return {
            "reference": {
                "kind": reference.kind,
                "wall_s": reference.wall_s,
                "estimated_error": reference.estimated_error,
                **reference.safety,
            },
            "runs": self.runs,
            "observed_order": self.observed_order,
            "tolerance": self.tolerance,
            "verdict": "pass" if self.passed else "fail",
        }

    def frame(self) -> Any:
        """Return errors and cost as a pandas ``DataFrame``, a row a run and signal; `ImportError` without pandas."""
        rows = [
            {"master": run.master, "macro_step": run.macro_step, "signal": name, **asdict(error), "wall_s": run.wall_s}
            for run in self.runs
            for name, error in run.signals.items()
        ]
        return pandas_module().DataFrame(rows)

    def __repr__(self) -> str:
        place = f"; {self.directory}" if self.directory is not None else ""
        return f"Comparison({len(self.runs)} runs against {self.reference.kind}, {self.verdict}{place})"

    @classmethod
    def from_content(cls, content: Mapping[str, Any], table: Table) -> Comparison:
        """Return the comparison that ``comparison.json`` and ``reference.csv`` hold."""
        known = content["reference"]
        reference = Reference(known["kind"], table, known["wall_s"], _numbers(known["estimated_error"], "nan"))
        reference.safety = {key: known[key] for key in SAFETY if key in known}
        return cls(reference, [_run_errors(run) for run in content["runs"]], content["tolerance"])


def _run_errors(content: Mapping[str, Any]) -> RunErrors:
    signals = {name: SignalError(**_numbers(error)) for name, error in content["signals"].items()}
    errors = {name: Parts.from_content(parts) for name, parts in content.get("errors", {}).items()}
    return RunErrors(**{**content, "signals": signals, "errors": errors})


def _numbers(values: Mapping[str, float | None], null: str = "inf") -> dict[str, float]:
    """Return `values` with the number back that JSON, which has no infinity, has as null."""
    return {name: float(null) if value is None else value for name, value in values.items()}


def _check(run: RunErrors, signal: str, tolerance: float, reference: Reference) -> Check:
    error = run.signals.get(signal)
    if error is None:
        note = "not among the signals of run and reference"
        return Check(run.master, run.macro_step, signal, float("nan"), tolerance, False, note)
    parts = run.errors.get(signal) or Parts(error.max_error, None, None, error.max_error)
    scale = range_of(reference.table[signal], error.scale)
    value, own, note = parts.total / scale, reference.estimated_error.get(signal), ""
    if own is None:
        note = "the reference does not say how accurate it is"
    elif not own <= REFERENCE_MARGIN * tolerance * scale:
        note = f"reference not accurate enough: its own error is {own / scale:.1e}"
    passed = value <= tolerance and not note
    shares = (None if part is None else part / scale for part in (parts.coupling, parts.mesh))
    return Check(run.master, run.macro_step, signal, value, tolerance, passed, note, *shares)


def _orders(runs: list[RunErrors]) -> dict[str, float]:
    steps = [run.macro_step for run in runs]
    if len(set(steps)) < 2:
        return {}
    common = [name for name in runs[0].signals if all(name in run.signals for run in runs)]
    return {name: observed_order(steps, [run.signals[name].max_error for run in runs]) for name in common}


def held_against(run: Run, reference: Reference) -> RunErrors:
    """Return the errors and the cost of one coupled run."""
    summary, solves = run.summary, run.summary["solves"]
    return RunErrors(
        master=run.master,
        macro_step=run.macro_step,
        steps=summary["steps"],
        iterations_per_step=summary["iterations_per_step"],
        unconverged_steps=summary["unconverged_steps"],
        cable_steps=solves.get("cable", max(solves.values(), default=0)),
        wall_s=summary["wall_s"],
        signals=signal_errors(run.table, coarsened(reference.table, run.time)),
        errors=reference.parts(run.table, judged(run.table, run.tolerances)),
    )


def compared(runs: list[Run], reference: Reference) -> Comparison:
    """Hold all runs against the reference."""
    held = [held_against(run, reference) for run in runs]
    return Comparison(reference, held, dict(runs[0].tolerances), list(runs))
