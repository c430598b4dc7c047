"""Observed order while a wheel rolls along the test rig, with the contact point moving within the step, and held.

The wheel of `rig_10m` is driven from rest by a torque that rises from 0.1 s to 0.2 s, for 0.6 s: along a mesh of equal
elements without meeting a node, along the scenario's own mesh, across its nodes; it rolls down a line that falls by 1 in 10,
where it slides while it touches lightly at first; and it is driven so hard that it slides. Errors are the largest against
the monolithic solver (tolerance 1e-12; 1e-9 of the range is its own), by the range; orders are slopes of the error.
Expected: order 4 in z; what is asked of the rest is at least 2.7, where nothing slides.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestrator.api import load_scenario
from orchestrator.coupling.run.compare import communication_times
from orchestrator.landing.monolithic.solve import solve
from orchestrator.runs.systems import resolve
from verification.exchange.landing import coupled, relative_error
from verification.study import Result, Row

TITLE = "Rolling"
SIGNALS = {"z": "robot.body.position.z", "y": "robot.body.position.y", "roll": "robot.roll"}
STEPS = (0.01, 0.005, 0.0025, 0.00125)
STOP, LEAST = 0.6, 2.7
HELD = {"contact.parameters.moving_port": False}
STICKS = {"contact.parameters.friction_coefficient": 2.0}
EQUAL = {"landing.position": 5.3, "cable.parameters.n_elements": 20}
DOWN = {"cable.parameters.level_difference": -1.0, "cable.parameters.unstretched_length": float(np.sqrt(101.0))}
LANDS = {"landing.position": 5.05}


def _torque(value: float) -> dict[str, object]:
    course = {"time": [0.0, 0.1, 0.2], "value": [0.0, 0.0, value], "unit": "N.m"}
    return {"robot.inputs.wheel[1].drive_torque": course | {"source": "assumed", "reason": "driven off from rest"}}


CASES: tuple[tuple[str, dict[str, object], bool], ...] = (
    ("no node is met", _torque(2.0) | STICKS | EQUAL, True),
    ("nodes are met", _torque(2.0) | STICKS, False),
    ("no node is met, the place held", _torque(2.0) | STICKS | EQUAL | HELD, False),
    ("down a slope, slides at first", DOWN | LANDS, False),
    ("driven till it slides", _torque(40.0), False),
)
"""Name, settings, and whether orders are asked for."""


def errors(settings: dict[str, object], steps: tuple[float, ...] = STEPS) -> np.ndarray:
    """Return the relative errors of the signals, (len(steps), 3)."""
    common = {"robot.parameters.wheel[1].braked": False, "master.tolerance": 1e-9, **settings}
    time = communication_times(STOP, steps)
    one = load_scenario("rig_10m", stop=STOP, macro_step=steps[0], set=common)
    reference = solve(resolve(one).problem(), time, 1e-12).signals | {"time": time}
    tables = [coupled(one, step).table for step in steps]
    return np.array([[relative_error(name, table, reference) for name in SIGNALS.values()] for table in tables])


def run(figures: Path) -> Result:
    """Return the orders where nothing slides, and a table of all errors."""
    rows, lines = [], ["| case | signal | 10 ms | 5 ms | 2.5 ms | 1.25 ms | order, 10 to 2.5 ms | 5 to 1.25 ms |"]
    lines.append("|" + "---|" * 8)
    for name, settings, asked in CASES:
        found = errors(settings)
        orders = np.log2(found[:2] / found[2:]) / 2.0
        for k, signal in enumerate(SIGNALS):
            numbers = [*(f"{e:.1e}" for e in found[:, k]), *(f"{o:.1f}" for o in orders[:, k])]
            lines.append(f"| {name} | {signal} | " + " | ".join(numbers) + " |")
            if asked:
                short = max(0.0, LEAST - float(orders[1, k]))
                rows.append(
                    Row(f"{name}, {signal}: order short of {LEAST}", short, 0.0, "asked for", 0.1, relative=False)
                )
        if asked:
            rows.append(Row(f"{name}: order of z", float(orders[1, 0]), 4.0, "theory", 0.5, relative=False))
    return Result(rows, remark="\n".join(lines))
