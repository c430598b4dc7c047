"""Landings to be solved anew: with values set by their keys, or wished by the sliders of a page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.landing import monolithic
from orchestrator.landing.monolithic.solve import Integrator, Problem
from orchestrator.landing.monolithic.starts import REFINEMENT
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.systems import LandingSystem, resolve
from orchestrator.runs.whatif import TOLERANCE, leave
from orchestrator.scenario.read import load
from tests.scenarios import ROOT, SCENARIOS

WEB = ROOT / "orchestrator" / "report" / "web"
SOURCES, DIST, SCRIPTS = WEB / "src", WEB / "dist", ROOT / "tests" / "web"
FLAGSHIP, IMPACT, MIDSPAN = "landing_200m_point9", "landing_200m_point9_impact", "landing_200m_midspan"
THRUST = 'robot.inputs.thrust={ time = [0.0, 0.05, 0.05, 0.113], value = [100.0, 20.0, 250.0, 0.0], interpolation = "linear" }'


HELD = "cable.parameters.landing_load"
WISHES = [
    (FLAGSHIP, None, {"mass": ("robot.parameters.mass", 80.0)}),
    (
        FLAGSHIP,
        None,
        {"speed": ("landing.velocity", 0.35), "friction": ("contact.parameters.friction_coefficient", 0.2)},
    ),
    (FLAGSHIP, None, {"damping": ("contact.parameters.damping", 0.25)}),
    (IMPACT, None, {"damping": ("contact.parameters.damping_coefficient", 3000.0)}),
    (MIDSPAN, "hybrid_robot_2", {"mass": ("robot.parameters.mass", 31.0), "speed": ("landing.velocity", 0.1)}),
]


def system_of(name: str = FLAGSHIP, *values: str, robot: str | None = None, stop: float = 1.0) -> LandingSystem:
    """A shipped landing with other values."""
    found = resolve(load(SCENARIOS / f"{name}.toml", [f"simulation.stop_time={stop}", *values], robot))
    assert isinstance(found, LandingSystem)
    return found


def problem_of(system: LandingSystem) -> Problem:
    made = system.problem()
    assert made is not None
    return made()


def integrator_of(system: LandingSystem, begun: bool = True) -> Integrator:
    return Integrator(problem_of(system), TOLERANCE, REFINEMENT, 0.0 if begun else None)


def times_of(stop: float, step: float = 0.01) -> np.ndarray:
    return np.minimum(step * np.arange(round(stop / step) + 1), stop)


def exact(landing: LandingSystem, times: np.ndarray, estimate: bool = False) -> monolithic.Solution:
    """The solution by the orchestrator's own solver, to the tolerance of a what-if."""
    made = landing.problem()
    assert made is not None
    return monolithic.solve(made, times, TOLERANCE, estimate)


def share(value: np.ndarray, wanted: np.ndarray) -> float:
    """The largest difference by the range."""
    return float(np.max(np.abs(value - wanted)) / np.ptp(wanted))


def wished(name: str, robot: str | None, wishes: Mapping[str, tuple[str, float]], *values: str, stop: float = 1.0):
    """A landing, and the same with values set by their keys; on one mesh, which is found for the weight of the first."""
    plain_one = system_of(name, *values, robot=robot, stop=stop)
    load_of = plain_one.landing.cable.settings.get("landing_load")
    held = [f"{HELD}={load_of!r}"] if load_of is not None else []
    return plain_one, system_of(
        name, *values, *held, *(f"{key}={value!r}" for key, value in wishes.values()), robot=robot, stop=stop
    )


def left(folder: Path, system: LandingSystem, others: bool = False) -> dict[str, Any]:
    leave(RunDirectory(folder), system, others)
    return json.loads((folder / "start.json").read_text(encoding="utf-8"))
