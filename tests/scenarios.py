"""The scenarios of the repository, shortened for the tests, and the exact motion of the one that has one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.linalg import expm

from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "scenarios"
OSCILLATOR = SCENARIOS / "oscillator.toml"
LANDING = SCENARIOS / "landing_200m_point9.toml"
DROP = SCENARIOS / "drop_5cm.toml"


def scenario(name: str = LANDING.stem, stop=1.0, master=None, macro_step=0.005, **values: object) -> Scenario:
    """A scenario of the repository, shortened; in `values` ``__`` stands for a dot."""
    settings = {"simulation.stop_time": float(stop), "simulation.macro_step": macro_step}
    settings |= {key.replace("__", "."): value for key, value in values.items()}
    return load(SCENARIOS / f"{name}.toml", [f"{key}={value}" for key, value in settings.items()], None, master)


def exact_oscillator(t: np.ndarray, kc: float = 100.0, k_right: float = 10.0, x_right: float = 0.0) -> np.ndarray:
    """Positions (2, n) of the two masses of scenarios/oscillator.toml: the exponential of the 4 x 4 matrix."""
    k, d, dc = 10.0, 0.1, 1.0
    stiffness = np.array([[k + kc, -kc], [-kc, k_right + kc]])
    damping = np.array([[d + dc, -dc], [-dc, d + dc]])
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    start = np.array([1.0, x_right, 0.0, 0.0])
    return np.array([(expm(matrix * time) @ start)[:2] for time in t]).T
