"""The first law over whole runs: kinetic, elastic, gravitational and dissipated energy, less the control's work.

The drift of the sum over the energy exchanged (half the sum of all changes, at its largest). Coupled runs must keep it
below 1e-6 of the energy exchanged at H = 5 ms in a landing without impact, and below 1e-5 with one; what remains is the
numerical damping of the cable's time integration at spectral radius 0.9, and of third order. The reference must keep it
within the sum of the estimated errors of its terms.
"""

from __future__ import annotations

from pathlib import Path

from orchestrator.landing import audit
from orchestrator.report import plots
from orchestrator.runs.coupled import run_coupled
from verification.study import Result, Row
from verification.system.setups import FLAGSHIP, estimated, scenario

TITLE = "Energy of whole runs"
CASES = {FLAGSHIP: (25.0, 1e-6), "landing_200m_midspan": (5.0, 1e-6), "drop_5cm": (2.0, 1e-5), "rig_10m": (5.0, 1e-5)}
"""Scenario → s simulated, drift of the coupled run allowed."""


def run(figures: Path) -> Result:
    rows = []
    for name, (stop, allowed) in CASES.items():
        one = scenario(name, stop)
        coupled, solution = run_coupled(one).energy, estimated(one)
        assert coupled is not None
        reference = audit.of_monolithic({"time": solution.time} | solution.signals, solution.estimated_error)
        assert reference is not None
        scale = coupled.exchanged
        label = f"{name}, {stop:g} s, {scale:.0f} J exchanged"
        rows.append(Row(f"{label}: coupled, drift [-]", coupled.drift / scale, 0.0, "first law", allowed, False))
        rows.append(
            Row(
                f"{label}: monolithic, drift [-]",
                reference.drift / scale,
                0.0,
                "first law",
                reference.allowed / scale,
                False,
            )
        )
        if name == FLAGSHIP:
            plots.energy(figures / "system_energy.png", coupled)
    figure = ("system_energy.png", "Energy of the coupled landing at 20 m, its drift, and where that comes from.")
    return Result(rows, [figure])
