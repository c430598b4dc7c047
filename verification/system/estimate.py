"""The error that the monolithic reference estimates of itself, held against its true error.

The estimate is the difference from a solution with steps twice as long; the true error is taken from a solution with a
hundredth of the tolerance. The estimate must bound it over the whole run.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from verification.study import Result, Row
from verification.system.setups import FLAGSHIP, estimated, monolithic, scenario

TITLE = "Error estimate of the reference"
CASES = {
    FLAGSHIP: 25.0,
    "landing_200m_point9_undamped": 25.0,
    "landing_200m_midspan": 25.0,
    "rig_10m": 25.0,
    "drop_5cm": 2.0,
}
SIGNALS = {
    "robot.body.position.z": "Z [m]",
    "robot.roll": "roll [rad]",
    "contact1.normal_force": "contact force [N]",
    "cable.tension_left": "tension at the support [N]",
}


def run(figures: Path) -> Result:
    rows = []
    for name, stop in CASES.items():
        one = scenario(name, stop)
        solution, truth = estimated(one), monolithic(one, 1e-11)
        for signal, label in SIGNALS.items():
            if np.ptp(truth[signal]) < 1e-9 * (1.0 + np.max(np.abs(truth[signal]))):
                continue  # constant by symmetry
            error = float(np.max(np.abs(solution.signals[signal] - truth[signal])))
            estimate = solution.estimated_error[signal]
            source = f"true error; peak to peak {np.ptp(truth[signal]):.3g}"
            rows.append(Row(f"{name}, {stop:g} s: {label}", error, 0.0, source, estimate, False))
    return Result(rows)
