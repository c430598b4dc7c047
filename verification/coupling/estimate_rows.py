"""Measure the grid of the error estimate: true and estimated errors of every signal, kept in ``docs/estimate.json``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.linalg import expm

from orchestrator.coupling.run.results import Table, replacing
from orchestrator.landing.monolithic.solve import solve
from orchestrator.runs.coupled import Coupled, run_coupled
from orchestrator.runs.errors import differences, judged, range_of
from orchestrator.runs.estimate import RATIOS, estimate_error, until
from orchestrator.runs.systems import resolve
from orchestrator.scenario.types import Scenario
from verification.coupling import estimate_grid as grid
from verification.coupling.estimate_grid import Spec

FILE = Path(__file__).resolve().parents[2] / "docs" / "estimate.json"
TRUTH = 1e-11
"""m; local tolerance of the monolithic solution that errors are judged by."""
POSITIONS = ("left.position", "right.position")
Row = dict[str, Any]


def measured(spec: Spec) -> Iterator[Row]:
    """Yield a row for each signal of one run: errors are in the signal's unit."""
    run = run_coupled(grid.scenario(spec))
    run.log.raise_error()
    truth, own = true_solution(spec, run)
    true = differences(run.table, truth, run.judged)
    for name, found in estimates(run).items():
        yield {
            "group": spec.group,
            "case": spec.words,
            "signal": name,
            "range": range_of(truth[name], moved(truth[name])),
            "moved": moved(truth[name]),
            "true": true[name],
            "own": own[name],
            "unconverged": run.log.unconverged,
            **found,
        }


def moved(values: np.ndarray) -> float:
    """Return the peak-to-peak of a signal, in its unit."""
    return float(np.ptp(values))


def estimates(run: Coupled) -> dict[str, Row]:
    """Return by signal what both kinds of estimate say, and what they cost relative to the run."""
    rows: dict[str, Row] = {name: {} for name in run.judged}
    for kind in RATIOS:
        copy = replace(run, system=run.system.changed(dict(run.scenario.master), estimate=kind))
        other = estimate_error(copy, parts=("coupling", "inner_steps"))
        cost = solves(other) / solves(run) if other else float("nan")
        bad = other.log.unconverged if other else 0
        for name, parts in copy.error_parts.items():
            rows[name][kind] = parts.content() | {"cost": cost, "failed": copy.estimate_failure, "unconverged": bad}
    return rows


def solves(run: Coupled) -> int:
    """Return the steps of the cable, which cost most; without one, those of any mass."""
    return run.log.solves.get("cable", max(run.log.solves.values()))


# -- the truth ------------------------------------------------------------------------------------------------


def true_solution(spec: Spec, run: Coupled) -> tuple[Table, Mapping[str, float]]:
    """Return the true signals up to the run's end, and a bound of the error of each."""
    if spec.place == "oscillator":
        exact = exact_oscillator(run.scenario, run.table["time"])
        return exact, dict.fromkeys(exact, 0.0)
    truth, own = monolithic(spec.place)
    return until(truth, run.table["time"][-1]), own


@lru_cache(maxsize=2)
def monolithic(place: str) -> tuple[Table, Mapping[str, float]]:
    """Return what is judged of the monolithic solution of a landing, at the times of all macro steps, and its errors."""
    system = resolve(grid.scenario(Spec("", place, grid.Coupling(grid.OWN, 0.005, {}))))
    make = system.problem()
    assert make is not None
    found = solve(make, grid.times_at(place), TRUTH)
    names = judged(found.signals, grid.SIGNALS)
    return {"time": found.time} | {n: found.signals[n] for n in names}, {n: found.estimated_error[n] for n in names}


def exact_oscillator(one: Scenario, time: np.ndarray) -> Table:
    """Return the positions of both masses: the exponential of the 4 x 4 matrix, one macro step after the other."""
    left, right = one.components["left"].parameters, one.components["right"].parameters
    own, between = (
        np.array([right[f"{kind}{name}"] for name in ("stiffness", "damping")]) for kind in ("", "coupling_")
    )
    masses = np.array([left["mass"], right["mass"]])
    blocks = [
        -(np.diag([o, o]) + b * np.array([[1, -1], [-1, 1]])) / masses[:, None]
        for o, b in zip(own, between, strict=True)
    ]
    step = expm(np.block([[np.zeros((2, 2)), np.eye(2)], blocks]) * (time[1] - time[0]))
    states = [np.array([left["initial_position"], 0.0, 0.0, 0.0])]
    for _ in time[1:]:
        states.append(step @ states[-1])
    return {"time": time} | dict(zip(POSITIONS, np.array(states).T, strict=False))


# -- the file -------------------------------------------------------------------------------------------------


def read() -> list[Row]:
    """Return what has been measured."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else []


def write(rows: Sequence[Row]) -> None:
    """Write what has been measured, a line each signal."""
    with replacing(FILE) as path:  # after every run, of an hour of them: whoever interrupts loses one
        path.write_text("[\n" + ",\n".join(json.dumps(_short(row)) for row in rows) + "\n]\n", encoding="utf-8")


def _short(value: Any) -> Any:
    """Return numbers with four digits: more would be noise."""
    if isinstance(value, float):
        return float(f"{value:.4g}") if np.isfinite(value) else None
    return {name: _short(v) for name, v in value.items()} if isinstance(value, dict) else value


def measure(again: Callable[[Spec], bool], told: Callable[[str], None]) -> list[Row]:
    """Measure what the file does not have, and what is wanted `again`; the file is written after every run."""
    wanted = list(grid.specs())
    rows = {spec.words: [row for row in read() if row["case"] == spec.words] for spec in wanted}
    for spec in sorted(wanted, key=lambda one: grid.in_turn().index(one.place)):
        if not rows[spec.words] or again(spec):
            start = process_time()
            rows[spec.words] = list(measured(spec))
            write([row for group in rows.values() for row in group])
            told(f"{spec.words}: {process_time() - start:.1f} s")
    return [row for group in rows.values() for row in group]
