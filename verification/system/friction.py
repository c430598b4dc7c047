"""Friction on a slope, in whole runs: the rig inclined by 5 degrees, the wheel braked.

With μ = 0.7 the robot must stick for 60 s. Creep is how fast the wheel moves along the cable once the swinging has died
down: the arc length of its foot, averaged over the last 10 s, less that over the 10 s before. The groove's walls carry
the load at half the groove angle, so that sliding takes the friction coefficient μ' = μ/sin(θ/2): the limit at 5° is
μ = tan 5° sin 50° = 0.0670. It is bracketed by runs that slide on and runs that come to rest.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.runs.coupled import run_coupled
from verification.study import Result, Row
from verification.system.setups import monolithic, scenario, times

TITLE = "Friction on a slope"
LIMIT = float(np.tan(np.radians(5.0)) * np.sin(np.radians(50.0)))
CREEP = 1e-6
"""m/s"""


def _mean(table: Table, time: np.ndarray, start: float, end: float) -> float:
    return float(np.mean(table["contact1.cable.s"][(time >= start) & (time < end)]))


def run(figures: Path) -> Result:
    one = scenario("rig_10m_inclined", 60.0)
    coupled, reference = run_coupled(one).table, monolithic(one)
    rows = []
    for kind, table, time in (("coupled", coupled, coupled["time"]), ("monolithic", reference, times(one))):
        creep = abs(_mean(table, time, 50.0, 60.0) - _mean(table, time, 40.0, 50.0)) / 10.0
        rows.append(Row(f"creep at μ = 0.7, {kind} [m/s]", creep, 0.0, "sticking is without creep", CREEP, False))
        late = time >= 10.0
        slid = float(np.mean(table["contact1.status"][late] == 2))
        rows.append(Row(f"part of the time that it slides, 10 to 60 s, {kind} [-]", slid, 0.0, "it sticks", 0.0, False))
    slides, rests = 0.0, 1.0
    for factor in (0.85, 0.92, 0.98, 1.02, 1.08, 1.15):
        settings = {"contact.parameters.friction_coefficient": factor * LIMIT}
        table = monolithic(scenario("rig_10m_inclined", 12.0, **settings))
        time = times(scenario("rig_10m_inclined", 12.0))
        way = _mean(table, time, 11.0, 12.0) - _mean(table, time, 9.0, 10.0)
        slides, rests = (factor, rests) if way > 2e-3 else (slides, min(rests, factor))
    middle = 0.5 * (slides + rests) * LIMIT
    rows.append(Row("friction coefficient at which it slides at 5° [-]", middle, LIMIT, "tan 5° sin 50°", 0.1))
    return Result(rows, remark=f"Slides at {slides * LIMIT:.4f}, rests at {rests * LIMIT:.4f}; limit {LIMIT:.4f}.")
