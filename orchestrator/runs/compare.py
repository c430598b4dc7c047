"""How wrong the coupled runs are: errors against a reference, observed orders, verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from orchestrator.coupling.run.compare import (
    SignalError,
    observed_order,
    signal_errors,
)
from orchestrator.coupling.run.results import Table
from orchestrator.landing.audit import Audit, of_monolithic
from orchestrator.runs.record import Coupled

REFERENCE_MARGIN = 0.1
"""The reference's own error may be this part of a tolerance, or the verdict means nothing."""
CONSTANT = 1e-6
"""A signal whose reference moves by less than this (m, rad …) counts as constant: the verdict then takes this as its
scale, as for the roll of a landing at midspan, which is zero by symmetry."""


@dataclass
class Reference:
    """The solution that is held against the runs.

    Attributes
    ----------
    kind : how it was made, in words
    table : its signals at all communication points of all runs
    wall_s : s
    estimated_error : its own error by signal, in the signal's unit
    fields : arrays over time, as in ``fields.h5``
    """

    kind: str
    table: Table
    wall_s: float
    estimated_error: dict[str, float]
    fields: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass
class Run:
    """One coupled run, held against the reference."""

    master: str
    macro_step: float
    steps: int
    iterations_per_step: float
    unconverged_steps: int
    cable_steps: int
    wall_s: float
    signals: dict[str, SignalError]


@dataclass(frozen=True)
class Check:
    """One line of the verdict: a signal of a run against its tolerance."""

    master: str
    macro_step: float
    signal: str
    error: float
    tolerance: float
    passed: bool
    note: str = ""


@dataclass
class Comparison:
    """All runs against one reference; `tolerance` is the largest `relative_max_error` by signal."""

    reference: Reference
    runs: list[Run]
    tolerance: dict[str, float]

    @property
    def checks(self) -> list[Check]:
        """Every tolerance held against every run."""
        return [
            _check(run, signal, tolerance, self.reference.estimated_error.get(signal))
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
            },
            "runs": self.runs,
            "observed_order": self.observed_order,
            "tolerance": self.tolerance,
            "verdict": "pass" if self.passed else "fail",
        }

    @classmethod
    def from_content(cls, content: Mapping[str, Any], table: Table) -> Comparison:
        """Return the comparison that ``comparison.json`` and ``reference.csv`` hold."""
        reference = Reference(table=table, **content["reference"])
        runs = [
            Run(**{**run, "signals": {n: SignalError(**_numbers(e)) for n, e in run["signals"].items()}})
            for run in content["runs"]
        ]
        return cls(reference, runs, content["tolerance"])


def _numbers(values: Mapping[str, float | None]) -> dict[str, float]:
    """Return `values` with the infinity back that JSON has as null."""
    return {name: float("inf") if value is None else value for name, value in values.items()}


def _check(run: Run, signal: str, tolerance: float, estimate: float | None) -> Check:
    error = run.signals.get(signal)
    if error is None:
        note = "not among the signals of run and reference"
        return Check(run.master, run.macro_step, signal, float("nan"), tolerance, False, note)
    scale = max(error.scale, CONSTANT)
    value, note = error.max_error / scale, ""
    if estimate is None:
        note = "the reference does not say how accurate it is"
    elif not estimate <= REFERENCE_MARGIN * tolerance * scale:
        note = f"reference not accurate enough: its own error is {estimate / scale:.1e}"
    return Check(run.master, run.macro_step, signal, value, tolerance, value <= tolerance and not note, note)


def _orders(runs: list[Run]) -> dict[str, float]:
    steps = [run.macro_step for run in runs]
    if len(set(steps)) < 2:
        return {}
    common = [name for name in runs[0].signals if all(name in run.signals for run in runs)]
    return {name: observed_order(steps, [run.signals[name].max_error for run in runs]) for name in common}


def held_against(coupled: Coupled, reference: Reference) -> Run:
    """Return the errors and the cost of one coupled run."""
    log = coupled.log
    return Run(
        master=coupled.master,
        macro_step=log.macro_step,
        steps=len(log.steps),
        iterations_per_step=log.iterations_per_step,
        unconverged_steps=log.unconverged,
        cable_steps=log.solves.get("cable", max(log.solves.values(), default=0)),
        wall_s=log.wall,
        signals=signal_errors(coupled.table, reference.table),
    )


def compared(runs: list[Coupled], reference: Reference) -> Comparison:
    """Hold all runs against the reference."""
    tolerance = runs[0].scenario.simulation.tolerances
    return Comparison(reference, [held_against(coupled, reference) for coupled in runs], dict(tolerance))
