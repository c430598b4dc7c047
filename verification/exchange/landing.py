"""Coupled landings beside the monolithic solver: what the studies of the exchange share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from orchestrator.coupling.run.results import Table
from orchestrator.landing.fields import interface_balance
from orchestrator.landing.resolve import resolve
from orchestrator.runs.coupled import Coupled, run_coupled
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
AXES = "xyz"


def scenario(name: str, stop: float, *settings: str) -> Scenario:
    """Return a scenario of the project that ends at `stop` (s), with settings ``key=value``."""
    return load(SCENARIOS / f"{name}.toml", [f"simulation.stop_time={stop}", *settings])


def coupled(made: Scenario, macro_step: float) -> Coupled:
    """Return a run that came to its end."""
    result = run_coupled(made.changed(macro_step=macro_step))
    if result.log.error is not None:
        raise RuntimeError(f"{made.name}, macro step {macro_step:g} s: {result.log.error}")
    return result


def balance(result: Coupled) -> float:
    """Return the largest energy residual of the first contact by the energy exchanged."""
    return interface_balance(result.table, result.log.energy)["contact1"]["relative"]


def relative_error(signal: str, result: Table, reference: Table) -> float:
    """Return the largest error at the communication points of `result` by the reference's peak-to-peak."""
    there = reference[signal]
    here = np.interp(result["time"], reference["time"], there)
    places = np.abs(reference["time"][:, None] - result["time"]).min(axis=0)
    assert np.max(places) < 1e-9, "every communication point is an output time of the reference"
    return float(np.max(np.abs(result[signal] - here)) / np.ptp(there))


def impulse(made: Scenario, table: Table, start: float, stop: float) -> float:
    """Return the vertical impulse of the contact on the robot, N s, from its momentum and its weight."""
    parameters = resolve(made).robot.module
    arm = np.array([float(parameters.get(f"center_of_mass.{axis}", 0.0)) for axis in AXES])
    mass, gravity = float(parameters["mass"]), float(parameters.get("gravity", 9.8))
    places = [int(np.argmin(np.abs(table["time"] - t))) for t in (start, stop)]
    speeds = []
    for i in places:
        angles = [table[f"robot.{name}"][i] for name in ("roll", "pitch", "yaw")]
        spin = [table[f"robot.body.angular_velocity.{axis}"][i] for axis in AXES]
        turned = Rotation.from_euler("xyz", angles).apply(arm)
        speeds.append(table["robot.body.velocity.z"][i] + np.cross(spin, turned)[2])
    return mass * (speeds[1] - speeds[0] + gravity * (stop - start))
