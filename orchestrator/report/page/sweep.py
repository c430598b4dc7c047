"""What stands in the page of a sweep: the map, how probable it is that limits hold, the runs, and recorded landings."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import Table, read_fields, read_json, read_table
from orchestrator.report.page.content import Content
from orchestrator.report.page.curves import hud_of, plots_of
from orchestrator.report.page.data import Packed, Source, pack_within
from orchestrator.report.page.head import Axis, Head, Landing, Map, Measure, Verdict
from orchestrator.report.page.html import Cell, Html, card, folded, pairs, table, tag
from orchestrator.report.page.line import line_of
from orchestrator.report.page.scene import place_of
from orchestrator.report.page.template import Body
from orchestrator.report.page.tiles import header, tile, verdict_of
from orchestrator.report.page.whatif import WhatIf, whatif_of_cells
from orchestrator.report.signals import LABELS

STUDY, TABLE, MAP = "study.json", "table.csv", "map.json"
MOST_ROWS = 500
"""Of the table of runs; ``table.csv`` has all."""
FEWEST = 100
"""Points of a recorded landing; rather than fewer, fewer landings are kept."""
NO_MAP: dict[str, Any] = {"axes": [], "maps": []}
Rows = list[dict[str, str]]


@dataclass(frozen=True)
class Recorded:
    """A landing whose signals were recorded: what it is called in the page, and what stands in its folder."""

    name: str
    title: str
    table: Table
    summary: Mapping[str, Any]
    folder: Path

    @property
    def prefix(self) -> str:
        """Of its arrays."""
        return f"{self.name}/"


def is_sweep(directory: Path) -> bool:
    """Whether a sweep has left this directory."""
    return (directory / STUDY).is_file() and (directory / TABLE).is_file()


def of_sweep(directory: Path, web: Path, most: int) -> Content:
    """Return the content of the page of the sweep in `directory`; its arrays take at most `most` characters."""
    study, rows = read_json(directory / STUDY), _rows(directory / TABLE)
    atlas = read_json(directory / MAP) if (directory / MAP).is_file() else NO_MAP
    cells = atlas["maps"][0]["cells"] if atlas["axes"] else []
    whatif = whatif_of_cells(
        {_name(c): directory / c["folder"] for c in cells if c["folder"] and not c["recorded"]}, web
    )
    recorded = [_recorded(directory, atlas, cell) for cell in cells if cell["recorded"] and cell["folder"]]
    kept, data = _packed(recorded, whatif, most)
    head = Head(
        kind="sweep",
        title=study["title"],
        complete=study["complete"],
        error=None if study["complete"] else "the sweep has not come to its end; the same command goes on",
        arrays=data.blob.places,
        verdict=_verdict(study),
        map=_map(study, atlas, cells) if cells else None,
        landings={one.name: Landing(one.prefix, _head_of(one)) for one in kept},
        whatif=whatif.about,
        thinned=_note(data, kept, recorded),
    )
    return Content(head, data, Body(_top(study, head), _lower(study, rows)), whatif.module)


# -- the landings -------------------------------------------------------------------------------------------------


def _name(cell: Mapping[str, Any]) -> str:
    return f"run-{cell['run']}"


def _recorded(directory: Path, atlas: Mapping[str, Any], cell: Mapping[str, Any]) -> Recorded:
    folder = directory / cell["folder"]
    title = f"Run {cell['run']}: {_at(atlas['axes'], cell)}"
    return Recorded(_name(cell), title, read_table(folder / "results.csv"), read_json(folder / "summary.json"), folder)


def _at(axes: Sequence[Mapping[str, Any]], cell: Mapping[str, Any]) -> str:
    places = zip(axes, cell["at"], strict=True)
    return ", ".join(f"{axis['label'].lower()} {_value(value, axis['unit'])}" for axis, value in places)


def _value(value: Any, unit: str) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}".rstrip()


def _packed(recorded: Sequence[Recorded], whatif: WhatIf, most: int) -> tuple[list[Recorded], Packed]:
    """Return the landings that are kept, and their arrays: those nearest to a limit first, where not all have room."""
    kept = sorted(recorded, key=_least_margin)
    while True:
        data = pack_within([_source(one) for one in kept], most, whatif.arrays)
        if data.stride == 1 or data.points / data.stride >= FEWEST or len(kept) < 2:
            return kept, data
        kept = kept[: len(kept) // 2]


def _least_margin(one: Recorded) -> float:
    shares = [judged["share"] for judged in one.summary.get("limits", {}).values() if judged["share"] is not None]
    return abs(1.0 - max(shares, default=0.0))


def _source(one: Recorded) -> Source:
    plots = plots_of(one.table, one.summary.get("limits", {}))
    names = dict.fromkeys(signal.name for plot in plots for signal in plot.signals)
    return Source(one.prefix, one.table, read_fields(one.folder / "fields.h5"), tuple(names))


def _head_of(one: Recorded) -> dict[str, Any]:
    """Return what the head of a page says of a landing."""
    summary, geometry = one.summary, one.summary.get("geometry")
    fields = read_fields(one.folder / "fields.h5")
    line = line_of(fields)
    found = {
        "title": one.title,
        "verdict": verdict_of(summary),
        "safety": summary.get("safety", ""),
        "limits": summary.get("limits", {}),
        "plots": plots_of(one.table, summary.get("limits", {})),
        "hud": hud_of(one.table, with_clearance=line is not None and geometry is not None),
        "line": None if line is None or geometry is None else {"prefix": "", "exact": line.exact},
    }
    return found | (place_of(geometry, one.table) if geometry is not None else {"robot": None})


def _note(data: Packed, kept: Sequence[Recorded], recorded: Sequence[Recorded]) -> str:
    if not recorded:
        return ""
    some = f"{len(kept)} of {len(recorded)} recorded landings are in this page. " if len(kept) < len(recorded) else ""
    return some + data.note


# -- the map ------------------------------------------------------------------------------------------------------


def _map(study: Mapping[str, Any], atlas: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> Map:
    axes = [_axis(axis) for axis in atlas["axes"]]
    limits = atlas["limits"]
    return Map(
        title="Where it is safe to land",
        text=lines[0] if len(lines := study.get("safe_ranges", [])) == 1 else "",
        x=axes[0],
        y=axes[1] if len(axes) > 1 else None,
        measures=[*_measures(limits)],
        limits=sorted({cell["binding"] for cell in cells if cell["binding"]}),
        limit_names={name: LABELS[name].replace("\n", " ").lower() for name in limits},
        cells=[one for cell in cells for one in _cells(cell, axes, atlas)],
    )


def _axis(axis: Mapping[str, Any]) -> Axis:
    labels = None if axis["numeric"] else [_value(value, "") for value in axis["values"]]
    return Axis(axis["label"], axis["unit"], axis["values"], labels)


def _measures(limits: Sequence[str]) -> Iterator[Measure]:
    yield Measure("margin", "Least margin of all limits", "%", 100.0, 0, "margin")
    yield Measure("probability", "Probability that all limits hold", "%", 100.0, 0, "probability")
    for name in limits:
        yield Measure(
            f"margin.{name}", f"Margin: {LABELS[name].replace(chr(10), ' ').lower()}", "%", 100.0, 0, "margin"
        )


def _cells(cell: Mapping[str, Any], axes: Sequence[Axis], atlas: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a cell for each rectangle that a place stands for: one, where the outline was not refined."""
    place = {name: axis.values.index(value) for name, axis, value in zip("xy", axes, cell["at"], strict=False)}
    chance = cell["probability"]
    facts = {
        "margin": cell["margin"],
        "limit": cell["binding"] or None,
        "verdict": cell["verdict"],
        "probability": None if chance is None else chance["all"]["estimate"][0],
        "run": cell["run"],
        "open": _name(cell),
        "text": _said(cell, atlas["axes"]),
        **{f"margin.{name}": margin for name, margin in cell["margins"].items()},
    }
    for area in cell["areas"] if atlas["refined"] is not None else [None]:
        yield {**place, **facts, **({"box": [edge for side in area for edge in side]} if area is not None else {})}


def _said(cell: Mapping[str, Any], axes: Sequence[Mapping[str, Any]]) -> str:
    """Say where a cell is and what became of its landings, in a line."""
    place = _at(axes, cell)
    place = place[:1].upper() + place[1:]
    if cell["margin"] is None:
        return f"{place}: {'failed' if cell['failed'] else 'not judged'}"
    chance = cell["probability"]
    likely = f", safe with probability {100.0 * chance['all']['estimate'][0]:.0f} %" if chance is not None else ""
    what = {"safe": "safe", "unsafe": "not safe", "unclear": "not clearly safe", "none": "not judged"}[cell["verdict"]]
    limit = LABELS[cell["binding"]].replace("\n", " ").lower()
    return f"{place}: {what}{likely}; least margin {100.0 * cell['margin']:.0f} % ({limit})"


# -- body ---------------------------------------------------------------------------------------------------------


def _verdict(study: Mapping[str, Any]) -> Verdict:
    counts = study["counts"]
    word = f"{counts['safe']} of {counts['runs']} landings are safe"
    return Verdict(word, "safe" if counts["safe"] == counts["runs"] and counts["runs"] else "none")


def _top(study: Mapping[str, Any], head: Head) -> Html:
    content = study["content"]
    subtitle = " · ".join(str(x) for x in (content.get("scenario"), content.get("solver"), study["study"]) if x)
    parts = [header(head.title, head.verdict, subtitle)]
    parts += [tag("p", (tag("b", "Incomplete: "), str(head.error)), class_="notice")] if head.error else []
    parts += [tag("p", head.thinned, class_="muted")] if head.thinned else []
    return Html("".join([*parts, tag("section", _tiles(study), class_="tiles", aria_label="Counts")]))


def _tiles(study: Mapping[str, Any]) -> Iterator[Html]:
    counts, names = (
        study["counts"],
        {"safe": "Safe", "not_safe": "Not safe", "not_judged": "Not judged", "failed": "Failed"},
    )
    for key, name in names.items():
        if counts[key] or key in ("safe", "not_safe"):
            yield tile(
                name, str(counts[key]), f"of {counts['runs']} landings", None, over=key == "failed" and counts[key] > 0
            )
    for one in study.get("probability", [])[:3]:
        chance, where = one["all"], _where(one["where"])
        note = f"{where}{100 * chance['interval'][0]:.1f} to {100 * chance['interval'][1]:.1f} %, {chance['count']} samples"
        yield tile("Probability of a safe landing", f"{100.0 * chance['estimate'][0]:.1f} %", note, None)


def _where(where: Mapping[str, Any]) -> str:
    return "".join(f"{key} {_value(value, '')}; " for key, value in where.items())


def _lower(study: Mapping[str, Any], rows: Rows) -> Html:
    cards = [_ranges(study), _chances(study), _failures(study), _runs(rows), _content(study)]
    return tag("section", cards, class_="more", aria_label="Numbers")


def _ranges(study: Mapping[str, Any]) -> Html:
    lines = study.get("safe_ranges", [])
    return (
        card("ranges", "Where it is safe", tag("ul", (tag("li", line) for line in lines)), wide=True)
        if lines
        else Html()
    )


def _chances(study: Mapping[str, Any]) -> Html:
    head = ("where", "limit", "samples", "safe", "probability", "interval", "not known", "method")
    rows = [
        (_where(one["where"]).rstrip("; "), name, *_chance(one[name]))
        for one in study.get("probability", [])
        for name in one
        if name != "where"
    ]
    return card("probability", "Probability that limits hold", table(head, rows), wide=True) if rows else Html()


def _chance(one: Mapping[str, Any]) -> tuple[str, ...]:
    least, most = one["estimate"]
    estimate = f"{100.0 * least:.2f} %" if least == most else f"{100.0 * least:.2f} to {100.0 * most:.2f} %"
    low, high = (100.0 * end for end in one["interval"])
    interval = f"{low:.2f} to {high:.2f} %, confidence {100.0 * one['confidence']:g} %"
    return str(one["count"]), str(one["safe"]), estimate, interval, str(one["unknown"]), one["method"]


def _failures(study: Mapping[str, Any]) -> Html:
    rows = [(str(one["run"]), str(one["reason"])) for one in study.get("failures", [])]
    return card("failures", "Runs that failed", table(("run", "reason"), rows), wide=True) if rows else Html()


def _runs(rows: Rows) -> Html:
    """Return a row a run: its inputs, margin, limit and verdict."""
    if not rows:
        return Html()
    names = list(rows[0])
    inputs = names[1 : names.index("safe")] if "safe" in names else []
    lines = [_run_row(row, inputs) for row in rows[:MOST_ROWS]]
    few = (
        f"The first {MOST_ROWS} of {len(rows)}; table.csv has all."
        if len(rows) > MOST_ROWS
        else "table.csv has all columns."
    )
    shown = table(("run", *inputs, "least margin", "limit", "verdict"), lines)
    return card("runs", "Runs", (tag("p", few, class_="muted"), shown), wide=True)


def _run_row(row: Mapping[str, str], inputs: Sequence[str]) -> tuple[Cell, ...]:
    margin = f"{100.0 * float(row['least_margin']):.1f} %" if row.get("least_margin") else "–"
    return (
        row["run"],
        *(_short(row[name]) for name in inputs),
        margin,
        row.get("binding", ""),
        row.get("failure") or row.get("verdict", ""),
    )


def _short(text: str) -> str:
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return text


def _content(study: Mapping[str, Any]) -> Html:
    rows = [(str(key), tag("code", str(value))) for key, value in study["content"].items()]
    versions = tag("pre", "\n".join(f"{name} {version}" for name, version in study.get("versions", {}).items()))
    return card("study", "The study", (pairs(rows), folded("versions", versions)), wide=True)


def _rows(path: Path) -> Rows:
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as the table of a sweep: {error}") from None
