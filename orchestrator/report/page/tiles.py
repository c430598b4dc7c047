"""The top of a page: the verdict, and a tile with a bar for each limit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing.safety import readable
from orchestrator.report.page.gap import Gap
from orchestrator.report.page.head import Verdict
from orchestrator.report.page.html import Html, tag
from orchestrator.report.page.scene import Geometry
from orchestrator.report.signals import LABELS

KILO = 1e4
"""N or J, from which on thousands are counted."""
CENTI = 0.1
"""m or m/s, below which thousandths are counted."""
SIGNS = {"deg": "°", "1": ""}


def verdict_of(said: Mapping[str, Any]) -> Verdict:
    """Return the verdict on the safety of a landing from what ``summary.json`` says of it."""
    if said.get("safe") is True:
        return Verdict("Safe to land", "safe")
    if said.get("safe") is None:
        return Verdict("Safety not judged", "none")
    if "NOT CLEARLY SAFE" in said.get("safety", ""):
        return Verdict("Not clearly safe", "unclear")
    return Verdict("Not safe to land", "unsafe")


def header(title: str, verdict: Verdict, subtitle: str, said: str = "") -> Html:
    """Return title and verdict, with what the verdict covers."""
    sign = {"safe": "✓ ", "unsafe": "✗ ", "unclear": "? ", "none": ""}[verdict.class_]
    badge = tag("div", sign + verdict.word, class_=f"verdict {verdict.class_}", id="verdict", role="status")
    lines = [tag("h1", title), tag("p", subtitle, class_="subtitle")]
    lines += [tag("p", said, class_="covers", id="covers")] if said else []
    return tag("header", (badge, tag("div", lines)))


def tiles(said: Mapping[str, Any], table: Table, geometry: Geometry | None, gap: Gap | None) -> Html:
    """Return the tiles of a landing: a limit each, then the largest force and the least gap."""
    found = [_limit_tile(name, judged) for name, judged in said.get("limits", {}).items()]
    found += [*_force_tile(table, geometry), *_gap_tile(geometry, gap)]
    return tag("section", found, class_="tiles", aria_label="Margins") if found else Html()


def tile(name: str, value: str, note: str, used: float | None, over: bool = False, **data: str) -> Html:
    """Return a tile; `used`, the share of a limit, is drawn as a bar; scripts find it by its `data`."""
    parts = [tag("span", name), tag("b", value), tag("small", note)]
    if used is not None:
        width = f"width:{100.0 * min(max(used, 0.0), 1.0):.1f}%"
        words = f"{100.0 * used:.0f} % of the limit used" if np.isfinite(used) else "beyond any limit"
        parts.append(tag("div", tag("i", style=width), class_="bar", role="img", aria_label=words))
    return tag("div", parts, class_="tile over" if over else "tile", **data)


def measured(value: float | None, unit: str, digits: int = 3) -> str:
    """Return a value as people read it; shares in per cent."""
    if value is None:
        return "–"
    number, unit = readable(value, unit)
    if unit == "1":
        return f"{100.0 * number:.{digits}g} %"
    if unit in ("N", "J") and abs(number) >= KILO:
        number, unit = number / 1e3, f"k{unit}"
    if unit in ("m", "m/s") and abs(number) < CENTI:
        number, unit = 1e3 * number, f"m{unit}"
    sign = SIGNS.get(unit, f" {unit}")
    return f"{number + 0.0:.{digits}g}{sign}"


def _limit_tile(name: str, judged: Mapping[str, Any]) -> Html:
    unit, share = judged["unit"], judged["share"]
    at = f" at {judged['time']:.2f} s" + (f", wheel {judged['wheel']}" if judged["wheel"] is not None else "")
    beyond = {"kept": "margin", "unclear": "margin, not clear,", "exceeded": "exceeded by"}[judged["verdict"]]
    margin = None if judged["margin"] is None else abs(judged["margin"])
    note = f"limit {measured(judged['limit'], unit)}: {beyond} {measured(margin, unit)}{at}"
    used = float("inf") if share is None else share
    worst = None if judged["worst"] is None else abs(judged["worst"])
    over = judged["verdict"] == "exceeded"
    return tile(LABELS[name].replace("\n", " "), measured(worst, unit), note, used, over, data_limit=name)


def _force_tile(table: Table, geometry: Geometry | None) -> Iterator[Html]:
    names = [n for n in table if re.fullmatch(r"contact\d+\.normal_force", n)]
    tops = {name: table.get(f"{name}_max", table[name]) for name in names}
    if not tops:
        return
    name = max(tops, key=lambda n: float(np.max(tops[n])))
    row = int(np.argmax(tops[name]))
    wheel = f", wheel {name[7:-13]}" if len(tops) > 1 else ""
    weight = _weight(geometry)
    note = f"at {table['time'][row]:.2f} s{wheel}" + (f"; {tops[name][row] / weight:.1f} × weight" if weight else "")
    yield tile("Largest contact force", measured(float(tops[name][row]), "N"), note, None, data_tile="force")


def _weight(geometry: Geometry | None) -> float | None:
    return geometry["robot"].get("weight") if geometry else None


def _gap_tile(geometry: Geometry | None, gap: Gap | None) -> Iterator[Html]:
    if gap is None or geometry is None:
        return
    row, level = int(np.argmin(gap.size)), abs(geometry["robot"]["line_above_rotors"])
    note = f"of {1e3 * level:.0f} mm over a straight line; at {gap.time[row]:.2f} s"
    used = 1.0 - float(gap.size[row]) / level
    yield tile("Least rotor–line gap", f"{1e3 * gap.size[row]:.0f} mm", note, used, data_tile="clearance")
