"""Who writes a run directory: tables, fields, summary, and last the manifest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import RunDirectory
from orchestrator.landing import audit
from orchestrator.landing.fields import interface_balance
from orchestrator.report.page import draw_comparison, draw_run
from orchestrator.runs.compare import Comparison, Reference
from orchestrator.runs.record import Coupled
from orchestrator.scenario.types import LandingScenario, Scenario

FIELD_UNITS = {"time": "s", "arc_length": "m", "position": "m", "tension": "N"}


def summary(coupled: Coupled) -> dict[str, Any]:
    """Return what ``summary.json`` holds: cost, convergence, extremes of the signals, interface work."""
    log, scenario = coupled.log, coupled.scenario
    simulated = float(log.time[-1] - log.time[0])
    landing = scenario if isinstance(scenario, LandingScenario) else None
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "stiffness_set": landing.cable.stiffness_set if landing else None,
        "robot": landing.robot.model or landing.robot.fmu if landing else None,
        "master": coupled.master,
        "exchange": coupled.exchange or None,
        "macro_step": log.macro_step,
        "simulated_s": simulated,
        "wall_s": log.wall,
        "wall_per_simulated_s": log.wall / simulated if simulated > 0.0 else None,
        "wall_components_s": log.wall_components,
        "steps": len(log.steps),
        "solves": log.solves,
        "iterations_per_step": log.iterations_per_step,
        "unconverged_steps": log.unconverged,
        "left_the_groove": coupled.fallen,
        "energy": energy_content(coupled),
        "interface_work_J": {name: float(work[-1]) for name, work in log.energy.items()},
        "energy_residual_J": {name: float(np.max(np.abs(r))) for name, r in log.energy_residual.items()},
        "estimated_error": coupled.estimated_error,
        "interface_balance": interface_balance(coupled.table, log.energy),
        "extremes": {n: _extremes(log.time, values) for n, values in coupled.table.items() if n != "time"},
    }


def energy_content(coupled: Coupled) -> dict[str, Any]:
    """Return what ``summary.json`` says of the energy."""
    if coupled.energy is not None:
        return coupled.energy.content()
    is_audited = isinstance(coupled.scenario, LandingScenario)
    return {"verdict": None, "missing": audit.missing(coupled.table)} if is_audited else {}


def _extremes(time: np.ndarray, values: np.ndarray) -> dict[str, float]:
    low, high = int(np.argmin(values)), int(np.argmax(values))
    pairs = {
        "start": values[0],
        "end": values[-1],
        "min": values[low],
        "min_time": time[low],
        "max": values[high],
    }
    return {name: float(value) for name, value in {**pairs, "max_time": time[high]}.items()}


def write(directory: RunDirectory, coupled: Coupled, reference: Reference | None = None) -> None:
    """Write all files of a coupled run, the manifest last; an interrupted run is marked as incomplete."""
    directory.write_table("results.csv", coupled.table)
    directory.write_table("iterations.csv", coupled.steps_table)
    if coupled.fields:
        directory.write_fields("fields.h5", coupled.fields, FIELD_UNITS)
    directory.write_json("summary.json", summary(coupled))
    tolerances = coupled.scenario.simulation.tolerances
    draw_run(directory.path, coupled.record, reference.table if reference else None, tolerances)
    error = coupled.log.error
    directory.write_manifest(manifest(coupled.scenario, coupled.fmus), error=str(error) if error else None)


def manifest(scenario: Scenario, fmus: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run depends on: the resolved scenario, the source of each value, the FMUs."""
    return {
        "scenario": str(scenario.path),
        "resolved": scenario.model_dump(exclude_none=True),
        "provenance": dict(scenario.provenance),
        "fmus": fmus,
    }


def write_runs(directory: RunDirectory, runs: list[Coupled], error: str) -> None:
    """Write the runs of a comparison that could not be finished, a directory each, then the manifest with `error`."""
    for coupled in runs:
        write(RunDirectory(directory.path / coupled.label), coupled)
    directory.write_manifest(manifest(runs[0].scenario, runs[0].fmus), error=error)


def write_comparison(directory: RunDirectory, comparison: Comparison, runs: list[Coupled]) -> None:
    """Write ``comparison.json``, the reference and one run directory for each run, then the manifest."""
    reference, failures = comparison.reference, [str(c.log.error) for c in runs if c.log.error]
    directory.write_table("reference.csv", reference.table)
    if reference.fields:
        directory.write_fields("reference.h5", reference.fields, FIELD_UNITS)
    for coupled in runs:
        write(RunDirectory(directory.path / coupled.label), coupled, reference)
    if comparison.reference_energy is not None:
        directory.write_json("reference.json", {"energy": comparison.reference_energy.content()})
    directory.write_json("comparison.json", comparison.content())
    draw_comparison(directory.path, comparison, [coupled.record for coupled in runs])
    error = "; ".join(failures) or None
    directory.write_manifest(manifest(runs[0].scenario, runs[0].fmus), error=error)
