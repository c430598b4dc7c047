"""What accuracy costs: all masters on one landing, 20 m from the tower, over 1.2 s.

Error against the monolithic solution, relative to peak-to-peak, over wall time (on a shared machine: good to a factor
of two) and over the solves of the cable, which are what a large mesh costs. Explicit masters run with the `point`
exchange. A run that ends early or is wrong by more than its range is left out; `fixed_point` and `aitken` sub-divide
without end beyond 5 ms.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestrator.report.accuracy import work_precision
from orchestrator.runs.compare import Comparison, held_against
from orchestrator.runs.coupled import Coupled
from orchestrator.runs.summary import result
from verification.coupling.landings import SIGNALS, coupled, reference
from verification.study import Result, Row

TITLE = "Work and precision"
LANDING = "20 m from the tower"
IMPLICIT, SHORT, EXPLICIT = (0.02, 0.01, 0.005, 0.0025), (0.005, 0.0025), (0.001, 0.0005, 0.00025)
STEPS = {
    "iqn_ils": IMPLICIT,
    "interface_jacobian": IMPLICIT,
    "anderson": IMPLICIT[1:],
    "aitken": SHORT,
    "fixed_point": SHORT,
    "semi_implicit": SHORT,
    "reduced_interface": (0.005, 0.0025, 0.001),
    "gauss_seidel": EXPLICIT,
    "jacobi": EXPLICIT,
    "nepce": EXPLICIT[1:],
}
"""Master → macro steps, s."""


def comparison() -> Comparison:
    """Run all masters at their macro steps."""
    true = reference(LANDING, tuple(sorted({step for steps in STEPS.values() for step in steps})))
    runs = [coupled(LANDING, master, step) for master, steps in STEPS.items() for step in steps]
    held = [held_against(result(run), true) for run in runs if _finished(run)]
    held = [run for run in held if all(run.signals[name].relative_max_error < 1.0 for name in SIGNALS)]
    return Comparison(true, held, dict(runs[0].scenario.simulation.tolerances))


def _finished(run: Coupled) -> bool:
    return run.log.error is None and bool(np.isfinite(run.table[SIGNALS[0]]).all())


def table(found: Comparison) -> str:
    """Return errors and cost of every run."""
    lines = ["| master | H, ms | Z | roll | cable solves | unconverged | wall, s |", "|---|---|---|---|---|---|---|"]
    for run in found.runs:
        errors = " | ".join(f"{run.signals[name].relative_max_error:.1e}" for name in SIGNALS)
        cost = f"{run.cable_steps} | {run.unconverged_steps} | {run.wall_s:.2f}"
        lines.append(f"| `{run.master}` | {1e3 * run.macro_step:g} | {errors} | {cost} |")
    shown = {(run.master, run.macro_step) for run in found.runs}
    wanted = ((master, step) for master, steps in STEPS.items() for step in steps)
    out = [f"`{master}` at {1e3 * step:g} ms" for master, step in wanted if (master, step) not in shown]
    return "\n".join(lines) + f"\n\nLeft out: {', '.join(out) or 'none'}."


def run(figures: Path) -> Result:
    """Run and draw; the default masters at 5 ms must be within 5e-6 of peak-to-peak."""
    found = comparison()
    images = figures.parent / "images"
    images.mkdir(exist_ok=True)
    work_precision(images / "work_precision.png", found)
    rows = [
        Row(
            f"{r.master}, {1e3 * r.macro_step:g} ms: Z",
            r.signals[SIGNALS[0]].relative_max_error,
            0.0,
            "monolithic",
            5e-6,
            False,
        )
        for r in found.runs
        if r.master in ("iqn_ils", "interface_jacobian") and r.macro_step == 0.005
    ]
    caption = "Error of all masters over wall time and over cable solves; one line a master, one dot a macro step"
    return Result(rows, [("../images/work_precision.png", caption)], table(found))
