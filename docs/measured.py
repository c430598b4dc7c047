"""Measure what README and docs say in numbers, and write it there: ``make measure``.

The numbers go to ``docs/measured.json`` and from there into the pages, between ``<!-- measured: NAME -->`` and
``<!-- end -->``. ``python docs/measured.py --fill`` fills the pages from the file alone.
"""

from __future__ import annotations

import json
import re
import sys
from itertools import pairwise
from math import log
from pathlib import Path
from time import process_time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "docs" / "measured.json"
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", DOCS / "howto" / "choose_master.md", DOCS / "methods" / "error.md")
BLOCK = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.S)

SCENARIO, STOP = "landing_200m_point9", 25.0
IMPLICIT, STEPS = ("interface_jacobian", "iqn_ils"), (0.01, 0.005, 0.0025)
EXPLICIT, SHORT_STEPS, LONG_STEPS = "gauss_seidel", (0.002, 0.001), (0.01, 0.005)
SIGNALS = {"Z": "robot.body.position.z", "roll": "robot.roll"}


# -- measuring ----------------------------------------------------------------------------------------------------


def measured() -> dict[str, Any]:
    """Return all numbers."""
    from orchestrator import __version__

    return {"version": __version__, "landing": landing()}


class Clock:
    """Told of the progress of runs; says what CPU time each took for a simulated second, its first step left out.

    CPU time, because other programs run beside: their share of a wall clock is not ours.

    Attributes
    ----------
    marks : task → CPU time and simulated time when it was first heard of, s
    costs : task → CPU time for a simulated second; of the first time that it came to its end
    """

    def __init__(self) -> None:
        self.marks: dict[str, tuple[float, float]] = {}
        self.costs: dict[str, float] = {}

    def __call__(self, task: str, time: float, stop: float) -> None:
        spent = process_time()
        before, since = self.marks.setdefault(task, (spent, time))
        if time >= stop - 1e-9 and task not in self.costs:
            self.costs[task] = (spent - before) / (time - since)


def landing() -> dict[str, Any]:
    """Return errors and costs of the flagship landing: the reference and a row for each run."""
    import orchestrator

    clock = Clock()
    common: dict[str, Any] = {"stop": STOP, "progress": clock}
    implicit = orchestrator.compare(SCENARIO, masters=list(IMPLICIT), macro_steps=list(STEPS), **common)
    reference = clock.costs["reference"]
    explicit = orchestrator.compare(SCENARIO, masters=[EXPLICIT], macro_steps=list(SHORT_STEPS), **common)
    parts, scales = implicit.runs[0].errors, implicit.runs[0].signals
    mesh = {name: (parts[signal].mesh or 0.0) / scales[signal].scale for name, signal in SIGNALS.items()}
    return {
        "scenario": SCENARIO,
        "stop": STOP,
        "reference": {"mesh": mesh, "cpu": reference},
        "rows": [row(run, clock) for run in (*implicit.runs, *explicit.runs)]
        + [cut_short(step) for step in LONG_STEPS],
    }


def row(run: Any, clock: Clock) -> dict[str, Any]:
    """Return the numbers of one run; times are s of CPU time for a simulated second."""
    from orchestrator.runs.result import run_label

    return {
        "master": run.master,
        "macro_step": run.macro_step,
        "error": {name: run.signals[signal].relative_max_error for name, signal in SIGNALS.items()},
        "solves": run.cable_steps / run.steps,
        "unconverged": run.unconverged_steps,
        "cpu": clock.costs[run_label(run.master, run.macro_step)],
    }


def cut_short(macro_step: float) -> dict[str, Any]:
    """Return the row of an explicit run with too long a step: when it ends because a wheel would jump past the line."""
    import orchestrator

    run = orchestrator.run(SCENARIO, master=EXPLICIT, macro_step=macro_step, stop=STOP, estimate="none")
    return {"master": EXPLICIT, "macro_step": macro_step, "end": float(run.time[-1]), "reason": run.error}


# -- filling ------------------------------------------------------------------------------------------------------


def landing_block(found: dict[str, Any]) -> str:
    """Return the text and table of the landing."""
    here, reference = found["landing"], found["landing"]["reference"]
    mesh = reference["mesh"]
    lines = [
        f"`{here['scenario']}`, {here['stop']:g} s, against the monolithic solution on the same mesh. Errors, of coupling",
        "and inner steps, are the largest over the whole run, relative to the peak-to-peak.",
        "",
        "| master | macro step | error of Z | error of roll | cable solves a step | CPU time a simulated second |",
        "|---|---|---|---|---|---|",
        *(table_row(one) for one in sorted(here["rows"], key=place)),
        "",
        f"The mesh, found by itself, leaves {mesh['Z']:.0e} of Z and {mesh['roll']:.0e} of roll beside. The reference takes",
        f"{reference['cpu']:.2f} s of CPU time a simulated second (cost is a ratio, read it down the column).",
        f"Steps left unconverged: {sum(one.get('unconverged', 0) for one in here['rows'])}.",
    ]
    return "\n".join(lines) + "\n"


def place(one: dict[str, Any]) -> tuple[int, float]:
    """Return where a row stands: by master, the longest step first."""
    return (*IMPLICIT, EXPLICIT).index(one["master"]), -one["macro_step"]


def table_row(one: dict[str, Any]) -> str:
    """Return one row of the table."""
    step = f"{1e3 * one['macro_step']:g} ms"
    if "error" not in one:
        end = f"ends at {one['end']:.2g} s: the wheel would jump past the line" if one["reason"] else "comes to its end"
        return f"| `{one['master']}` | {step} | {end} | | 1 | |"
    errors = " | ".join(f"{value:.1e}" for value in one["error"].values())
    return f"| `{one['master']}` | {step} | {errors} | {one['solves']:.2f} | {one['cpu']:.2f} s |"


def orders_block(found: dict[str, Any]) -> str:
    """Return the observed orders of the implicit masters: the slope of the error between two steps."""
    here = found["landing"]
    lines = [
        f"`{here['scenario']}`, {here['stop']:g} s, slope of the largest error against the monolithic solution.",
        "",
        "| master | from | to | order of Z | order of roll |",
        "|---|---|---|---|---|",
    ]
    for master in IMPLICIT:
        rows = sorted((one for one in here["rows"] if one["master"] == master), key=place)
        for one, finer in pairwise(rows):
            steps = f"{1e3 * one['macro_step']:g} ms | {1e3 * finer['macro_step']:g} ms"
            orders = " | ".join(f"{order(one, finer, name):.1f}" for name in SIGNALS)
            lines.append(f"| `{master}` | {steps} | {orders} |")
    return "\n".join(lines) + "\n"


def order(one: dict[str, Any], finer: dict[str, Any], name: str) -> float:
    """Return the slope of the error of a signal between two runs."""
    return log(one["error"][name] / finer["error"][name]) / log(one["macro_step"] / finer["macro_step"])


BLOCKS = {"landing": landing_block, "orders": orders_block}


def filled(text: str, found: dict[str, Any]) -> str:
    """Return `text` with every measured block as the numbers say."""
    return BLOCK.sub(lambda m: m[1] + re.sub(r"e([-+])0(\d)", r"e\1\2", BLOCKS[m[2]](found)) + m[3], text)


def main() -> None:
    """Measure, unless only filling is asked for, and fill the pages."""
    if "--fill" not in sys.argv:
        FILE.write_text(json.dumps(measured(), indent=1) + "\n", encoding="utf-8")
    found = json.loads(FILE.read_text(encoding="utf-8"))
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
