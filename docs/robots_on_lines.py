"""Run the studies of our own lines and write what came of them: ``python docs/robots_on_lines.py [FOLDER]``.

The landings go to FOLDER (``robots_on_lines`` if none is named), where a second call finds them; what the page needs goes to
``docs/robots_on_lines.json``, and from there into ``docs/robots_on_lines.md`` and its picture. ``--fill`` writes both from
the file alone.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE, PAGE = ROOT / "docs" / "robots_on_lines.json", ROOT / "docs" / "robots_on_lines.md"
PICTURE = ROOT / "docs" / "figures" / "robots_on_lines.png"
STUDIES = ("robots_110kv", "robots_220kv", "robots_crossing")
CONFIDENCE = 0.95
PARTS = {"near a tower": (0.0, 0.125), "on the slope": (0.125, 0.25), "in the middle": (0.25, 0.5)}
"""Part of the span → its distance from the nearer tower by the span."""
Found = dict[str, Any]


# -- running ------------------------------------------------------------------------------------------------------


def measured(folder: Path) -> Found:
    """Return what the page needs of all studies."""
    from orchestrator import __version__

    return {"version": __version__, "lines": [of_study(name, folder / name) for name in STUDIES]}


def of_study(name: str, folder: Path) -> Found:
    """Return the line of a study at rest, and of each landing: robot, place, verdict, margin and what binds."""
    import orchestrator
    from orchestrator.landing.resolve import resolve
    from orchestrator.scenario.read import load

    study = orchestrator.sweep(name, out=folder)
    scenario = load(study.swept.study.scenario)
    landing, table = resolve(scenario), study.table
    keys = ("robot", "landing.position", "safe", "least_margin", "binding", "failure")
    rows = [dict(zip(keys, row, strict=True)) for row in zip(*(table[key] for key in keys), strict=True)]
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "span": landing.cable.module["span"],
        "rest": landing.rest.content(),
        "sample": [words(key, law) for key, law in study.swept.study.sample.distributions.items()],
        "landings": [plain(row) for row in rows],
    }


def words(key: str, law: Any) -> str:
    """Return in words how the value of a key is distributed."""
    numbers = ", ".join(f"{number:g}" for number in getattr(law, law.kind))
    return f"`{key}` {law.kind} ({numbers}) {law.unit}".strip()


def plain(row: Found) -> Found:
    """Return a row as JSON has it."""
    return {
        "robot": str(row["robot"]),
        "position": round(float(row["landing.position"]), 2),
        "safe": bool(row["safe"] == 1),
        "margin": round(float(row["least_margin"]), 4),
        "binding": str(row["binding"]),
        "failure": str(row["failure"]),
    }


# -- the page -----------------------------------------------------------------------------------------------------


def page(found: Found) -> str:
    """Return the page."""
    parts = [HEAD, *(section(line) for line in found["lines"]), figure_text(found), FURTHER]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


HEAD = """
# Which robots may land where

<!-- made by `python docs/robots_on_lines.py`; edit studies/robots_*.toml, scenarios and that script, not this page -->

Three lines of our own, each strung to 20 % of its strength at 15 °C, in calm air, and the four robots of the catalogue.
A robot comes down anywhere on the span, and what is not known of the landing is drawn at random: the place, the speed of
touch-down, the temperature of the line, friction, and damping of line and contact. Every landing is watched for 25 s by
the monolithic solver and judged by [the limits](concepts/limits.md).

*Safe* counts landings in which every limit held. The interval covers the true probability in 95 % of such studies
(Clopper and Pearson). The robots but the FPTLIR have masses and sizes that are assumed: their files say so.
"""

FURTHER = """
## What to make of it
* A landing here is a release: rotors stop at touch-down, and the line takes the weight at once. A robot that is set down
  by a falling thrust swings less ([Inputs over time](howto/inputs_over_time.md)).
* The line's damping in calm air is an assumption, 0.005 to 0.05 1/s besides the drag of the air. The paper's 1 1/s would
  make every landing of its robot safe: see [the paper, claim by claim](reproduction.md).
* The margins stand without their estimated error; the mass of each robot is that of its file.

Make it anew, or with another line: `python docs/robots_on_lines.py` (the studies alone: `orchestrator sweep
robots_220kv`).
"""


def section(line: Found) -> str:
    """Return what is said of one line."""
    rest = line["rest"]
    head = f"## {line['title'].partition(':')[0]}"
    about = (
        f"`{line['scenario']}`: {line['title'].partition(': ')[2]}. At rest it hangs {rest['sag']:.2f} m deep, with"
        f" {1e-3 * rest['horizontal_tension']:.2f} kN."
    )
    names = list(dict.fromkeys(row["robot"] for row in line["landings"]))
    columns = ["robot", "safe", "probability", *(f"safe {part}" for part in PARTS), "what is exceeded"]
    rows = [robot_row(line, name) for name in names]
    drawn = "Drawn: " + "; ".join(line["sample"]) + "."
    return "\n\n".join([head, wrapped(about), table(columns, rows), wrapped(drawn)])


def robot_row(line: Found, robot: str) -> list[str]:
    """Return the row of a robot on a line."""
    landings = [row for row in line["landings"] if row["robot"] == robot]
    parts = [counted([row for row in landings if within(row, line["span"], *bounds)]) for bounds in PARTS.values()]
    exceeded = sorted({row["binding"] for row in landings if not row["safe"] and row["binding"]})
    failed = sum(bool(row["failure"]) for row in landings)
    why = [*exceeded, *([f"{failed} failed"] if failed else [])]
    return [f"`{robot}`", counted(landings), interval(landings), *parts, ", ".join(why) or "nothing"]


def within(row: Found, span: float, low: float, high: float) -> bool:
    """Whether a landing is that far from the nearer tower, by the span."""
    share = min(row["position"], span - row["position"]) / span
    return low <= share < high or share == high == 0.5


def counted(landings: list[Found]) -> str:
    """Return how many landings are safe, of how many."""
    return f"{sum(row['safe'] for row in landings)} of {len(landings)}" if landings else "none"


def interval(landings: list[Found]) -> str:
    """Return the interval of the probability, in per cent."""
    from scipy.stats import binomtest

    found = binomtest(sum(row["safe"] for row in landings), len(landings)).proportion_ci(CONFIDENCE, "exact")
    return f"{100.0 * found.low:.0f} to {100.0 * found.high:.0f} %"


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows])


def wrapped(text: str, width: int = 118) -> str:
    """Return `text` in lines that are not too long."""
    from textwrap import fill

    return fill(text, width, break_long_words=False, break_on_hyphens=False)


def figure_text(found: Found) -> str:
    """Return the picture, and what it shows in words."""
    worst = min((row for line in found["lines"] for row in line["landings"]), key=lambda row: row["margin"])
    return "\n\n".join([
        "## Margins along the spans",
        "![Least margin over all limits against the distance from the nearer tower](figures/robots_on_lines.png)",
        wrapped(
            "Least margin over all limits, in per cent of the limit that binds: 0 and less is not safe. The least of all "
            f"is {100.0 * worst['margin']:.0f} %, of `{worst['robot']}` at {worst['position']:.0f} m, by {worst['binding']}."
        ),
    ])  # fmt: skip


# -- the picture --------------------------------------------------------------------------------------------------


def draw(found: Found) -> None:
    """Draw the margin of each landing over its distance from the nearer tower, a panel a line."""
    from orchestrator.report.style import COLOURS, MARKERS, saved

    with saved(PICTURE, (7.2, 2.8)) as figure:
        panels = figure.subplots(1, len(found["lines"]), sharey=True)
        for panel, line in zip(panels, found["lines"], strict=True):
            for k, (robot, x, y) in enumerate(series(line)):
                panel.plot(x, y, MARKERS[k], color=COLOURS[k], markersize=3.5, label=robot.replace("_", " "))
            panel.axhline(0.0, color="black", linewidth=0.8)
            panel.set_xlabel("from the nearer tower, m")
            panel.text(0.02, 1.02, line["scenario"].replace("_", " "), transform=panel.transAxes, fontsize=8)
        panels[0].set_ylabel("least margin, %")
        panels[0].legend(fontsize=6.5)


def series(line: Found) -> Iterator[tuple[str, list[float], list[float]]]:
    """Yield robot, distances from the nearer tower (m) and margins (%) of its landings."""
    for robot in dict.fromkeys(row["robot"] for row in line["landings"]):
        rows = [row for row in line["landings"] if row["robot"] == robot]
        yield (
            robot,
            [min(r["position"], line["span"] - r["position"]) for r in rows],
            [100.0 * r["margin"] for r in rows],
        )


def main() -> None:
    """Run what is not there yet, unless only filling is asked for, and write page and picture."""
    given = [word for word in sys.argv[1:] if word != "--fill"]
    if "--fill" not in sys.argv:
        found = measured(Path(given[0] if given else "robots_on_lines"))
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    found = json.loads(FILE.read_text(encoding="utf-8"))
    PAGE.write_text(page(found), encoding="utf-8")
    draw(found)


if __name__ == "__main__":
    main()
