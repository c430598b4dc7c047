"""Scenarios of the repository, shortened or varied, and their solutions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import Solution, integrate, solve
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario

SCENARIOS = Path(__file__).resolve().parent.parent.parent / "scenarios"
FLAGSHIP = "landing_200m_point9"
MACRO_STEP = 0.005


def scenario(name: str = FLAGSHIP, stop: float | None = None, **settings: object) -> Scenario:
    """Return a scenario with the settings in place of its own; `stop` in s."""
    values = dict(settings) | ({"simulation.stop_time": float(stop)} if stop is not None else {})
    return load(SCENARIOS / f"{name}.toml", [f"{key}={value}" for key, value in values.items()])


def times(one: Scenario) -> np.ndarray:
    """Return the communication points of a scenario at `MACRO_STEP`."""
    return MACRO_STEP * np.arange(round(one.simulation.stop_time / MACRO_STEP) + 1)


def estimated(one: Scenario, tolerance: float = 1e-9) -> Solution:
    """Return the monolithic solution with its estimated error."""
    return solve(lambda: landing.problem(one), times(one), tolerance)


def monolithic(one: Scenario, tolerance: float = 1e-9) -> Table:
    """Return the signals of the monolithic solution."""
    return integrate(lambda: landing.problem(one), times(one), tolerance).signals


def relative_error(table: Table, truth: Table, signal: str) -> float:
    """Return the largest difference over the peak-to-peak of `truth`."""
    return float(np.max(np.abs(table[signal] - truth[signal])) / np.ptp(truth[signal]))
