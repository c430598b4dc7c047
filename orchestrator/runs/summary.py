"""From a finished coupled run to what is kept of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from orchestrator.coupling.run.interrupt import Interruption
from orchestrator.coupling.run.results import Table, plain
from orchestrator.landing.fields import interface_balance
from orchestrator.runs.coupled import Coupled
from orchestrator.runs.result import Run, Verdict
from orchestrator.scenario.types import Scenario

NO_LANDING: Mapping[str, Any] = {"safe": None, "safety": "", "limits": {}, "not_judged": {}}


def result(coupled: Coupled) -> Run:
    """Return the result of a coupled run, not yet written."""
    error = coupled.log.error
    content = {"complete": error is None, "error": None if error is None else str(error)}
    content |= manifest(coupled.scenario, coupled.fmus)
    tables = coupled.table, coupled.steps_table, coupled.fields
    said = [f"{n}: {line}" for n, log in coupled.messages.items() for text in log for line in text.splitlines()]
    return Run(*tables, plain(summary(coupled)), plain(content), messages=said)


def manifest(scenario: Scenario, fmus: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run depends on: the resolved scenario, the source of each value, the FMUs."""
    return {
        "scenario": str(scenario.path),
        "resolved": scenario.model_dump(exclude_none=True),
        "provenance": dict(scenario.provenance),
        "fmus": fmus,
    }


def summary(coupled: Coupled) -> dict[str, Any]:
    """Return what ``summary.json`` holds: verdict, cost, convergence, extremes of the signals, interface work."""
    log, scenario, about = coupled.log, coupled.scenario, coupled.system.about(coupled.table)
    time = coupled.table["time"]
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "verdict": verdict(coupled),
        "signal": signal_of(coupled),
        **safety(coupled),
        "notes": scenario.notes,
        "warnings": coupled.system.warnings(coupled.table),
        "wiring": coupled.notes,
        **about,
        "master": coupled.master,
        "exchange": coupled.exchange or None,
        "exchange_asked": coupled.system.exchange or coupled.exchange or None,
        "macro_step": log.macro_step,
        "output_interval": scenario.simulation.output_interval,
        **_cost(coupled),
        "left_the_groove": coupled.fallen,
        "unresolved_impacts": unresolved(coupled),
        "energy": coupled.energy.content() if coupled.energy is not None else about["energy"],
        "interface_work_J": {name: float(work[-1]) for name, work in log.energy.items()},
        "energy_residual_J": {name: float(np.max(np.abs(r))) for name, r in log.energy_residual.items()},
        "energy_made": energy_made(coupled),
        "tolerances": scenario.simulation.tolerances,
        "estimate": scenario.simulation.estimate,
        "estimated_error": {name: parts.content() for name, parts in coupled.error_parts.items()},
        "estimate_failure": coupled.estimate_failure,
        "estimate_doubts": coupled.estimate_doubts,
        "interface_balance": interface_balance(coupled.table, log.energy),
        "fmu_warnings": {name: m.warnings for name, m in coupled.messages.items() if m.warnings},
        "units": {"time": "s"} | {name: log.units[name] for name in coupled.table if name in log.units},
        "extremes": {n: extremes(time, coupled.table, n) for n in coupled.table if n != "time"},
    }


def verdict(coupled: Coupled) -> Verdict:
    """Return how a run ended; what it means stands at `Run.verdict`."""
    if coupled.log.error is not None:
        return "interrupted" if isinstance(coupled.log.error, Interruption) else "failed"
    return "missed" if coupled.log.unconverged or coupled.fallen or coupled.misses else "within"


def signal_of(coupled: Coupled) -> int | None:
    """Return the number of the signal that has ended a run, or its estimate; None where none has."""
    error = coupled.log.error
    return error.number if isinstance(error, Interruption) else coupled.stopped or None


def safety(coupled: Coupled) -> dict[str, Any]:
    """Return what is said of the safety of a landing; of a general graph, that nothing is."""
    error = coupled.log.error
    errors = coupled.estimated_error | {f"{i['contact']}.normal_force_max": np.inf for i in unresolved(coupled)}
    found = coupled.system.safety(coupled.table, coupled.fields, errors, None if error is None else str(error))
    return found.content() if found is not None else dict(NO_LANDING)


def energy_made(coupled: Coupled) -> dict[str, Any] | None:
    """Return what the coupling has made, J: in the end, and at most on the way; None where no load is booked on both sides."""
    log = coupled.log
    if not log.energy_residual:
        return None
    made = np.cumsum(log.steps.column("energy_made"))
    return {
        "end_J": float(made[-1]) if made.size else 0.0,
        "largest_J": float(np.max(made, initial=0.0)),
        "loads_booked": len(log.energy_residual),
        "loads": len(log.energy),
    }


def _cost(coupled: Coupled) -> dict[str, Any]:
    log = coupled.log
    simulated = float(np.ptp(log.time))
    return {
        "simulated_s": simulated,
        "wall_s": log.wall,
        "wall_per_simulated_s": log.wall / simulated if simulated > 0.0 else None,
        "wall_components_s": log.wall_components,
        "steps": len(log.steps),
        "solves": log.solves,
        "iterations_per_step": log.iterations_per_step,
        "unconverged_steps": log.unconverged,
    }


def unresolved(coupled: Coupled) -> list[dict[str, Any]]:
    """Return the impacts whose force rises, in a quarter of the contact's period, within less than a step; one a contact,
    the shortest.

    A macro step that was divided counts as the mean of its parts.
    """
    log, found = coupled.log, dict[str, dict[str, Any]]()
    steps = log.macro_step / (1.0 + log.steps.column("subdivisions"))
    points, row = log.points, log.macro_step * log.every
    for impact in sorted(coupled.system.impacts(coupled.table), key=lambda impact: impact.period):
        rise = 0.25 * impact.period
        during = (points[1:] > impact.time) & (points[:-1] < impact.time + row + rise)
        longest = float(np.max(steps[during], initial=0.0))
        if longest > rise:
            found.setdefault(impact.contact, {**asdict(impact), "step": longest})
    return list(found.values())


def extremes(time: np.ndarray, table: Table, name: str) -> dict[str, float]:
    """Return start, end, least and largest value; the largest within the macro steps where the table has it."""
    values, tops = table[name], table.get(f"{name}_max", table[name])
    low, high = int(np.argmin(values)), int(np.argmax(tops))
    pairs = {
        "start": values[0],
        "end": values[-1],
        "min": values[low],
        "min_time": time[low],
        "max": tops[high],
    }
    return {name: float(value) for name, value in {**pairs, "max_time": time[high]}.items()}
