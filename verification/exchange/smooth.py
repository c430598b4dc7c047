"""Observed order of the coupling on a contact that stays closed, and of `point` with the masters that use it.

Landing from touch (`landing_200m_point9`) to 0.3 s. The order is the slope of the error of z against the monolithic
solver between two macro steps: 10 and 5 ms for `waveform` and `hermite`, 5 and 2.5 ms for `point` joined by an implicit
master, below 1.25 ms for explicit masters. Expected: docs/methods/exchange.md. Tolerance: cable step and
reference leave 1e-8, against a coupling error of 5e-8 at 5 ms, so that an order of 4 is seen to within log2(1.2) on
either step.
"""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.reference import solve_reference
from verification.exchange.landing import balance, coupled, relative_error, scenario
from verification.study import Result, Row, observed_order

TITLE = "Observed order on smooth contact"
SIGNAL = "robot.body.position.z"
CASES = (
    ("waveform, iqn_ils", "iqn_ils", "waveform", (0.01, 0.005), "tolerance=1e-9", 4.0),
    ("hermite, iqn_ils", "iqn_ils", "hermite", (0.01, 0.005), "tolerance=1e-9", 4.0),
    ("point, iqn_ils", "iqn_ils", "point", (0.005, 0.0025), "tolerance=1e-9", 2.0),
    ("point, gauss_seidel, held", "gauss_seidel", "point", (0.00125, 0.000625), "extrapolation=0", 1.0),
    ("point, gauss_seidel, linear", "gauss_seidel", "point", (0.000625, 0.0003125), "extrapolation=1", 2.0),
)
NAME, STOP = "landing_200m_point9", 0.3


def run(figures: Path) -> Result:
    """Return the orders and the energy balance."""
    monolithic = solve_reference(scenario(NAME, STOP), sorted({step for case in CASES for step in case[3]})).table
    rows = []
    for case, master, exchange, steps, option, order in CASES:
        made = scenario(
            NAME, STOP, f'simulation.master="{master}"', f'simulation.exchange="{exchange}"', f"master.{option}"
        )
        results = [coupled(made, step) for step in steps]
        errors = [relative_error(SIGNAL, result.table, monolithic) for result in results]
        rows.append(
            Row(f"{case}: order of z", observed_order(steps, errors), order, "theory", 0.125 * order, relative=False)
        )
        if exchange == "waveform":
            residual = max(balance(result) for result in results)
            rows.append(Row(f"{case}: energy residual", residual, 0.0, "law's work", 1e-6, relative=False))
    return Result(rows)
