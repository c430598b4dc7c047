"""The landings of these studies: scenario files, shortened, and their references."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

from orchestrator.runs.compare import Reference
from orchestrator.runs.coupled import Coupled, run_coupled
from orchestrator.runs.reference import solve_reference
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario

FOLDER = Path(__file__).resolve().parents[2] / "scenarios"


class Landing(NamedTuple):
    """A scenario file, the robot in its place, and settings in place of the file's."""

    file: str
    robot: str | None = None
    settings: tuple[str, ...] = ()


LANDINGS = {
    "20 m from the tower": Landing("landing_200m_point9"),
    "the same, physical": Landing("landing_200m_point9_undamped"),
    "midspan": Landing("landing_200m_midspan"),
    "drop from 5 cm": Landing("drop_5cm"),
    "inclined rig": Landing("rig_10m_inclined"),
    "two wheels": Landing("landing_200m_point9", "hybrid_robot_2"),
}
STOP = 1.2
SIGNALS = ("robot.body.position.z", "robot.roll")


def scenario(landing: str, master: str | None = None, macro_step: float | None = None, *more: str) -> Scenario:
    """Return a landing over `STOP` s with another master, macro step, and `more` settings."""
    file, robot, settings = LANDINGS[landing]
    times = [f"simulation.stop_time={STOP}"]
    times += [f"simulation.macro_step={macro_step!r}"] if macro_step else []
    return load(FOLDER / f"{file}.toml", [*settings, *times, *more], robot, master)


@cache
def reference(landing: str, macro_steps: tuple[float, ...]) -> Reference:
    """Return the monolithic solution at the communication points of all `macro_steps`."""
    return solve_reference(scenario(landing), macro_steps)


def coupled(landing: str, master: str, macro_step: float) -> Coupled:
    """Return a finished run."""
    return run_coupled(scenario(landing, master, macro_step))
