"""Measure what README and docs say in numbers, and write it there: ``make measure``.

The numbers go to ``docs/measured.json`` and from there into the pages, between ``<!-- measured: NAME -->`` and
``<!-- end -->``. ``python docs/measured.py --fill`` fills the pages from the file alone.
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "docs" / "measured.json"
PAGES = (ROOT / "README.md", ROOT / "docs" / "howto" / "choose_master.md")
BLOCK = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.S)

SCENARIO, STOP, ROUNDS = "landing_200m_point9", 25.0, 1
IMPLICIT, STEPS = ("interface_jacobian", "iqn_ils"), (0.01, 0.005, 0.0025)
EXPLICIT, SHORT_STEPS, LONG_STEPS = "gauss_seidel", (0.002, 0.001), (0.01, 0.005)
SIGNALS = {"Z": "robot.body.position.z", "roll": "robot.roll"}


# -- measuring ----------------------------------------------------------------------------------------------------


def measured() -> dict[str, Any]:
    """Return all numbers."""
    from orchestrator import __version__

    return {"version": __version__, "cores": len(os.sched_getaffinity(0)), "landing": landing()}


def landing() -> dict[str, Any]:
    """Return errors and costs of the flagship landing; of the times the best of several rounds."""
    rounds = [one_round() for _ in range(ROUNDS)]
    first, walls = rounds[0], [[row["wall"] for row in one["rows"]] for one in rounds]
    for row, times in zip(first["rows"], zip(*walls, strict=True), strict=True):
        row["wall"] = min(times)
    first["reference"]["wall"] = min(one["reference"]["wall"] for one in rounds)
    first["rows"] += [fallen(step) for step in LONG_STEPS]
    return first


def one_round() -> dict[str, Any]:
    """Return the landing compared once: the reference and a row for each run."""
    import orchestrator

    implicit = orchestrator.compare(SCENARIO, masters=list(IMPLICIT), macro_steps=list(STEPS), stop=STOP)
    explicit = orchestrator.compare(SCENARIO, masters=[EXPLICIT], macro_steps=list(SHORT_STEPS), stop=STOP)
    reference, scales = implicit.reference, implicit.runs[0].signals
    parts = implicit.runs[0].errors
    mesh = {name: (parts[signal].mesh or 0.0) / scales[signal].scale for name, signal in SIGNALS.items()}
    rows = [row(run) for run in (*implicit.runs, *explicit.runs)]
    return {
        "scenario": SCENARIO,
        "stop": STOP,
        "reference": {"mesh": mesh, "wall": reference.wall_s / STOP},
        "rows": rows,
    }


def row(run: Any) -> dict[str, Any]:
    """Return the numbers of one run; times are s of wall time for a simulated second."""
    return {
        "master": run.master,
        "macro_step": run.macro_step,
        "error": {name: run.signals[signal].relative_max_error for name, signal in SIGNALS.items()},
        "solves": run.cable_steps / run.steps,
        "unconverged": run.unconverged_steps,
        "wall": run.wall_s / STOP,
    }


def fallen(macro_step: float) -> dict[str, Any]:
    """Return the row of an explicit run with too long a step: whether the robot falls off the line."""
    import orchestrator

    run = orchestrator.run(SCENARIO, master=EXPLICIT, macro_step=macro_step, stop=STOP, estimate="none")
    return {"master": EXPLICIT, "macro_step": macro_step, "fallen": bool(run.summary["left_the_groove"])}


# -- filling ------------------------------------------------------------------------------------------------------


def landing_block(found: dict[str, Any]) -> str:
    """Return the text and table of the landing."""
    here, reference = found["landing"], found["landing"]["reference"]
    mesh = reference["mesh"]
    lines = [
        f"`{here['scenario']}`, {here['stop']:g} s, against the monolithic solution on the same mesh. Errors, of coupling",
        "and inner steps, are the largest over the whole run, relative to the peak-to-peak.",
        "",
        "| master | macro step | error of Z | error of roll | cable solves a step | wall time a simulated second |",
        "|---|---|---|---|---|---|",
        *(table_row(one) for one in sorted(here["rows"], key=place)),
        "",
        f"The mesh, found by itself, leaves {mesh['Z']:.0e} of Z and {mesh['roll']:.0e} of roll beside. The reference takes",
        f"{reference['wall']:.2f} s of wall time a simulated second ({found['cores']} cores; cost is a ratio, read it down the",
        f"column). Steps left unconverged: {sum(one.get('unconverged', 0) for one in here['rows'])}.",
    ]
    return "\n".join(lines) + "\n"


def place(one: dict[str, Any]) -> tuple[int, float]:
    """Return where a row stands: by master, the longest step first."""
    return (*IMPLICIT, EXPLICIT).index(one["master"]), -one["macro_step"]


def table_row(one: dict[str, Any]) -> str:
    """Return one row of the table."""
    step = f"{1e3 * one['macro_step']:g} ms"
    if "error" not in one:
        return (
            f"| `{one['master']}` | {step} | {'falls off the line' if one['fallen'] else 'stays on the line'} | | 1 | |"
        )
    errors = " | ".join(f"{value:.1e}" for value in one["error"].values())
    return f"| `{one['master']}` | {step} | {errors} | {one['solves']:.1f} | {one['wall']:.2f} s |"


BLOCKS = {"landing": landing_block}


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
