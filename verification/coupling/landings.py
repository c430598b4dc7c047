"""The landings of these studies: scenario files, shortened, and their references."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from orchestrator import experiment
from orchestrator.compare import Reference
from orchestrator.experiment import Coupled
from orchestrator.scenario import Scenario, load

FOLDER = Path(__file__).resolve().parents[2] / "scenarios"
LANDINGS: dict[str, tuple[str, str | None]] = {
    "20 m from the tower": ("landing_200m_point9", None),
    "the same, physical": ("landing_200m_point9_physical", None),
    "midspan": ("landing_200m_midspan", None),
    "drop from 5 cm": ("drop_5cm", None),
    "inclined rig": ("rig_10m_inclined", None),
    "two wheels": ("landing_200m_point9", "hybrid_robot_2"),
}
"""Words → scenario file, and the robot in its place."""
STOP = 1.2
SIGNALS = ("robot.body.position.z", "robot.roll")


def scenario(landing: str, master: str | None = None, macro_step: float | None = None) -> Scenario:
    """Return a landing over `STOP` s with another master and macro step."""
    name, robot = LANDINGS[landing]
    settings = [f"simulation.stop_time={STOP}"]
    settings += [f"simulation.macro_step={macro_step!r}"] if macro_step else []
    return load(FOLDER / f"{name}.toml", settings, robot, master)


@cache
def reference(landing: str, macro_steps: tuple[float, ...]) -> Reference:
    """Return the monolithic solution at the communication points of all `macro_steps`."""
    return experiment.reference(scenario(landing), macro_steps)


def coupled(landing: str, master: str, macro_step: float) -> Coupled:
    """Return a finished run."""
    return experiment.run(scenario(landing, master, macro_step))
