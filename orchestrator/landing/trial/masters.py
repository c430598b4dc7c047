"""Which masters fit an FMU, and with which macro step to begin."""

from __future__ import annotations

from collections.abc import Iterable

from orchestrator.coupling.errors import digits
from orchestrator.coupling.masters import MASTERS
from orchestrator.landing.trial.bench import Bench, Course
from orchestrator.landing.trial.general import step_error
from orchestrator.landing.trial.row import ACCURACY, Row, untestable

FORWARD_STEP = 1e-3
"""s; what explicit masters need with contact (docs/howto/choose_master.md)."""
FIRST_CHOICE = "interface_jacobian"
HALVINGS = 5


def masters_row(bench: Bench, rows: Iterable[Row]) -> Row:
    """Return which masters fit, by what the FMU can do and what the `rows` have shown."""
    replay = next((row for row in rows if row.name == "state replay"), None)
    goes_back = replay is not None and replay.verdict == "pass"
    fit = [name for name, master in MASTERS.items() if goes_back or not master.IMPLICIT]
    if goes_back:
        said = f"all; begin with {FIRST_CHOICE}"
    else:
        said = f"{', '.join(fit)}: none that goes back; begin with gauss_seidel"
    why = "state replay passes" if goes_back else (replay.why if replay is not None else "")
    return Row("masters", "those that its answers allow", "capabilities and state replay", said, "pass", why)


def macro_step_row(bench: Bench, course: Course, goes_back: bool) -> Row:
    """Return the macro step to begin with: as long as its own error stays below what a landing asks."""
    name, expected = "macro step", f"its own error stays below {ACCURACY:g} of what it moves"
    H = bench.H
    if not bench.divides:
        return Row(name, expected, "its own step", f"{digits(H)} s, which it cannot vary", "pass")
    error = step_error(bench, course)[0]
    for _ in range(HALVINGS):
        if error <= ACCURACY:
            break
        H, error = H / 2, error / 2  # of order 1 at least
    else:
        return untestable(name, f"even steps of {H:g} s are too coarse for it", expected)
    step = H if goes_back else min(H, FORWARD_STEP)
    return Row(name, expected, "H against H/2", f"begin with {digits(step)} s", "pass")
