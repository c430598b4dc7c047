"""Let go or set down, over all points of the paper: ``python docs/setting_down.py [FOLDER]``.

The landings go to FOLDER (``setting_down`` if none is named), where a second call finds them; what the page needs goes to
``docs/setting_down.json``, and from there into ``docs/setting_down.md`` and its picture. ``--fill`` writes both from the
file alone.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE, PAGE = ROOT / "docs" / "setting_down.json", ROOT / "docs" / "setting_down.md"
PICTURE = ROOT / "docs" / "figures" / "setting_down.png"
POINTS = {k: 110.0 - 10.0 * k for k in range(1, 11)}
"""Point of the paper → m from the tower: point 1 at midspan, 10 m between points; point 11 would be the tower itself."""
LINES = {
    "landing_200m_point9_physical": "Damped as the paper says, 1 1/s",
    "landing_200m_point9_undamped": "Without the damping that the paper states",
}
"""Scenario → what it stands for."""
FLOWN = {
    "landing.height": 0.5,
    "controller.model": "setdown",
    "controller.parameters.descent_speed": 0.3,
    "controller.parameters.ramp_time": 5.0,
}
WAYS: Mapping[str, Mapping[str, Any]] = {
    "let go": {},
    "set down": FLOWN | {"controller.parameters.torque_after_touch": False},
    "and roll compensated": FLOWN,
    "and a fifth of the thrust kept": FLOWN | {"controller.parameters.final_share": 0.2},
}
"""How the robot comes down → what its scenario says."""
SIGNALS = ("robot.body.position.z", "robot.roll", "contact1.normal_force_max")
COMMANDS = ("controller.torque.x", "controller.thrust")
Found = dict[str, Any]


# -- running ------------------------------------------------------------------------------------------------------


def measured(folder: Path) -> Found:
    """Return what the page needs of all landings."""
    from orchestrator import __version__
    from orchestrator.runs.batch import run_batch
    from orchestrator.runs.job import Job

    keys = [(line, way, point) for line in LINES for way in WAYS for point in POINTS]
    jobs = [Job(line, {"landing.position": POINTS[p], **WAYS[way]}, signals=signals(way)) for line, way, p in keys]
    rows = [row(*key, done) for key, done in zip(keys, run_batch(jobs, folder), strict=True)]
    return {"version": __version__, "landings": rows}


def signals(way: str) -> tuple[str, ...]:
    """Return the signals that are kept of a landing of that way."""
    return SIGNALS + (COMMANDS if WAYS[way] else ())


def row(line: str, way: str, point: int, done: Any) -> Found:
    """Return what is said of a landing; angles in degrees, the sunk in m from touching, the force by the robot's weight."""
    import numpy as np

    table, height = done.table, WAYS[way].get("landing.height", 0.0)
    z, said = table["robot.body.position.z"], done.summary
    torque = table.get("controller.torque.x", np.zeros(1))
    return {
        "line": line,
        "way": way,
        "point": point,
        "roll": round(float(np.degrees(np.max(np.abs(table["robot.roll"])))), 3),
        "sunk": round(float(z[0] - height - np.min(z)), 4),
        "force": round(float(np.max(table["contact1.normal_force_max"])) / at_rest(), 4),
        "torque": round(float(np.max(np.abs(torque))), 3),
        "verdict": said["safety"].partition(":")[0].partition(" until")[0],
        "binding": binding(said["limits"]),
        "share": round(max(one["share"] for one in said["limits"].values()), 4),
    }


def at_rest() -> float:
    """Return the sum of the wall forces (N) of the robot at rest: its weight over the sine of half the groove's angle."""
    from math import radians, sin

    from orchestrator.catalogue.robot_spec import load_robot

    mass = float(load_robot("fptlir").parameters["mass"])
    return mass * 9.8 / sin(radians(50.0))


def binding(limits: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the limit that a landing comes nearest to."""
    return max(limits, key=lambda name: limits[name]["share"])


# -- the page -----------------------------------------------------------------------------------------------------

HEAD = """
# Let go, or set down

<!-- made by `python docs/setting_down.py`; edit that script, not this page -->

Jia et al. 2025 let the robot go on the line and name *roll compensation for the farthest landing points* as future work.
Here are their points 1 (midspan) to 10 (10 m from the tower), 38 kg, by the monolithic solver over 25 s, in four ways:

* *let go*: as in the paper. The wheel touches, the rotors are off, the line takes the weight at once;
* *set down*: [the controller](concepts/controller.md) brings it down from 0.5 m at 0.3 m/s and takes the thrust away
  within 5 s of touch-down; after that it turns the robot no more;
* *and roll compensated*: as before, and roll is fed back as far as the thrust lets the rotors;
* *and a fifth of the thrust kept*: the rotors go on with 20 % of the weight, so that there is a torque to the end.

*Roll* is the largest, either way. *Sunk* counts from where the wheel touches the line at rest. *Force* is the largest
contact force by that of the robot at rest. *Used* is the share of [the limit](concepts/limits.md) that binds.
"""


def page(found: Found) -> str:
    """Return the page."""
    parts = [HEAD, *(section(found, line) for line in LINES), figure_text(), conclusions(found)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def section(found: Found, line: str) -> str:
    """Return what is said of one line: a table of all points and ways, and the verdicts."""
    columns = ["point", "from the tower", *WAYS]
    rows = [[str(p), f"{POINTS[p]:.0f} m", *cells(found, line, p)] for p in POINTS]
    heads = ["", "safe", "most of a limit used", "by", "largest torque"]
    return "\n\n".join([
        f"## {LINES[line]}",
        f"`{line}`. In each cell: roll, sunk, force.",
        table(columns, rows),
        table(heads, [[way, *verdicts(found, line, way)] for way in WAYS]),
    ])  # fmt: skip


def cells(found: Found, line: str, point: int) -> Iterator[str]:
    """Yield roll, sunk and force of a point, way after way."""
    for way in WAYS:
        one = next(r for r in of(found, line, way) if r["point"] == point)
        yield f"{one['roll']:.2f}° · {one['sunk']:.2f} m · {one['force']:.2f}"


def verdicts(found: Found, line: str, way: str) -> list[str]:
    """Return how many points are safe, and what comes nearest to its limit."""
    rows = of(found, line, way)
    worst = max(rows, key=lambda r: r["share"])
    safe = sum(r["verdict"] == "SAFE" for r in rows)
    by = f"{worst['binding']} at point {worst['point']}"
    return [
        f"{safe} of {len(rows)}",
        f"{100.0 * worst['share']:.0f} %",
        by,
        f"{max(r['torque'] for r in rows):.1f} N m",
    ]


def of(found: Found, line: str, way: str) -> list[Found]:
    """Return the landings of one way on one line, point after point."""
    return [r for r in found["landings"] if (r["line"], r["way"]) == (line, way)]


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [head, ["---"] * len(head), *rows])


def most(found: Found, line: str, way: str, key: str) -> float:
    """Return the largest of all points."""
    return max(r[key] for r in of(found, line, way))


def figure_text() -> str:
    """Return the picture."""
    image = "![Largest roll at the points of the paper, in four ways](figures/setting_down.png)"
    return f"## Roll over the span\n\n{image}\n\nAt midspan, point 1, roll is zero by symmetry."


def conclusions(found: Found) -> str:
    """Return what to make of it, in sentences with the numbers of the file."""
    damped, undamped = LINES
    rolls = {line: [most(found, line, way, "roll") for way in WAYS] for line in LINES}
    forces = {line: [most(found, line, way, "force") for way in WAYS] for line in LINES}
    alone, fed, kept = (of(found, undamped, way)[1:] for way in list(WAYS)[1:])
    worse = [b["point"] for a, b in zip(alone, fed, strict=True) if b["roll"] > a["roll"]]
    gain = [a["roll"] / b["roll"] for a, b in zip(alone, kept, strict=True)]
    lines = [
        f"**Most of the gain is in the thrust, not in the torque.** With the paper's damping the largest roll falls from"
        f" {rolls[damped][0]:.2f}° to {rolls[damped][1]:.2f}° by setting down alone; without it, where bounce and pendulum"
        f" resonate, from {rolls[undamped][0]:.1f}° to {rolls[undamped][1]:.1f}°. A weight that comes within 5 s does not"
        " excite a bounce of 0.6 Hz as one that comes at once.",
        f"**Roll compensation adds little while the thrust goes to zero** ({rolls[damped][2]:.2f}° and"
        f" {rolls[undamped][2]:.1f}°): rotors that push cannot turn the robot without thrust, and what swings on afterwards"
        f" is left to itself. Without damping it ends in a larger roll at {len(worse)} of 9 points"
        f" ({', '.join(map(str, worse))}).",
        f"**With a fifth of the thrust kept** roll is held at {rolls[damped][3]:.2f}° and {rolls[undamped][3]:.2f}°, and the"
        f" line bears a fifth less. Point by point, without damping, that is {min(gain):.1f} to {max(gain):.1f} times less"
        " than set down alone. So the compensation that the paper asks for works as long as the rotors turn.",
        f"**The largest force** is {forces[damped][1]:.2f} and {forces[undamped][1]:.2f} of that at rest, against"
        f" {forces[damped][0]:.2f} and {forces[undamped][0]:.2f} let go.",
        "**What this does not say.** Pose and force are known without noise or delay, rotors follow at once, the air is"
        " still, and nothing holds the robot over the line on the way down. The lever of the rotors and the share of the"
        " thrust are assumed ([equations and sources](reference/controller.md)).",
    ]
    items = "\n".join(fill(text, 118, initial_indent="* ", subsequent_indent="  ") for text in lines)
    return f"## What to make of it\n{items}\n\nMake it anew: `python docs/setting_down.py`."


# -- the picture --------------------------------------------------------------------------------------------------


def draw(found: Found) -> None:
    """Draw the largest roll of each point but midspan, where it is zero by symmetry, a panel a line, a curve a way."""
    from orchestrator.report.style import COLOURS, MARKERS, saved

    with saved(PICTURE, (7.2, 3.0)) as figure:
        panels = figure.subplots(1, len(LINES))
        for panel, (line, title) in zip(panels, LINES.items(), strict=True):
            for k, way in enumerate(WAYS):
                rows = of(found, line, way)[1:]
                x, y = [r["point"] for r in rows], [r["roll"] for r in rows]
                panel.plot(x, y, marker=MARKERS[k], color=COLOURS[k], markersize=4, linewidth=1.0, label=way)
            panel.set_yscale("log")
            panel.set_xlabel("point of the paper")
            panel.set_xticks(list(POINTS)[1:])
            panel.text(0.02, 1.03, title, transform=panel.transAxes, fontsize=8)
        panels[0].set_ylabel("largest roll, °")
        panels[0].legend(fontsize=6.5)


def main() -> None:
    """Run what is not there yet, unless only filling is asked for, and write page and picture."""
    given = [word for word in sys.argv[1:] if word != "--fill"]
    if "--fill" not in sys.argv:
        found = measured(Path(given[0] if given else "setting_down"))
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    found = json.loads(FILE.read_text(encoding="utf-8"))
    PAGE.write_text(page(found), encoding="utf-8")
    draw(found)


if __name__ == "__main__":
    main()
