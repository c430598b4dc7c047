"""A drop from 5 cm: impacts shorter than the macro step.

38 kg hit the line at 1 m/s, 20 m from the tower, with a wall stiffness of 1e8 and 1e10 N/m^2.5. The vertical impulse of
the first 0.1 s after touch is taken from the robot's momentum. The errors are held against the monolithic solver. The
energy residual is taken with an iteration tolerance of 1e-9, since with the default the tolerance is most of it
(7e-5 at 1e10 N/m^2.5 and 10 ms).
"""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.reference import solve_reference
from verification.exchange.landing import balance, coupled, impulse, relative_error, scenario
from verification.study import Result, Row

TITLE = "Drop from 5 cm"
TOUCH, WINDOW = 0.1, 0.1
MACRO_STEPS = (0.01, 0.005)
BAR_Z, BAR_IMPULSE, BAR_ENERGY = 1e-4, 1e-3, 1e-6


def rows(stiffness: float) -> list[Row]:
    """Return the rows of one wall stiffness."""
    settings = "drop_5cm", TOUCH + WINDOW + 0.1, f"contact.parameters.stiffness={stiffness:g}"
    made, tight = scenario(*settings), scenario(*settings, "master.tolerance=1e-9")
    monolithic = solve_reference(made, MACRO_STEPS).table
    exact = impulse(made, monolithic, TOUCH, TOUCH + WINDOW)
    found = []
    for step in MACRO_STEPS:
        result = coupled(made, step)
        case = f"k = {stiffness:.0e} N/m^2.5, H = {1e3 * step:g} ms"
        error = relative_error("robot.body.position.z", result.table, monolithic)
        ours = impulse(made, result.table, TOUCH, TOUCH + WINDOW)
        found += [
            Row(f"{case}: error of z by its peak-to-peak", error, 0.0, "monolithic", BAR_Z, relative=False),
            Row(f"{case}: impulse, N s", ours, exact, "monolithic", BAR_IMPULSE),
            Row(f"{case}: steps not converged", result.log.unconverged, 0.0, "counted", 0.5, relative=False),
            Row(
                f"{case}: energy residual", balance(coupled(tight, step)), 0.0, "law's work", BAR_ENERGY, relative=False
            ),
        ]
    return found


def run(figures: Path) -> Result:
    """Return all rows."""
    return Result([row for stiffness in (1e8, 1e10) for row in rows(stiffness)])
