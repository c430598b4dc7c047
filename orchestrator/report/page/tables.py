"""The tables of a page: peaks, errors by part, energy and numerics, parameters with their sources, manifest."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing.safety import VERDICTS, why_not_judged
from orchestrator.report.page.html import Cell, Html, card, folded, pairs, seek, table, tag
from orchestrator.report.page.tiles import measured
from orchestrator.report.signals import LABELS, in_the_air
from orchestrator.runs.errors import NAMES, RIGHT, Parts, range_of, verdict_on
from orchestrator.runs.result import Run

PEAKS = (
    (r"robot\.body\.position\.z", "sunk since the start", "m"),
    (r"robot\.(roll|pitch|yaw)", "{}", "rad"),
    (r"contact(\d+)\.normal_force", "contact force{}", "N"),
    (r"contact(\d+)\.penetration", "penetration{}", "m"),
    (r"contact(\d+)\.slip_velocity", "slip velocity{}", "m/s"),
    (r"cable\.tension_(left|mid|right)", "tension, {}", "N"),
)
"""Signal → what its largest magnitude is called; the group of a wheel is told where there are several."""


# -- limits and peaks -----------------------------------------------------------------------------------------------


def limits(said: Mapping[str, Any], whose: str = "") -> Html:
    """Return what a landing is held against, how near it came, and where each limit comes from.

    Parameters
    ----------
    said : as in ``summary.json``
    whose : what it is said of, where there are several
    """
    if not said.get("limits"):
        return Html()
    lines = [_limit_row(name, judged) for name, judged in said["limits"].items()]
    head = ("limit", "worst", "allowed", "margin", "at", "verdict", "from", "")
    title = "Limits and safety" + (f", {whose}" if whose else "")
    return card(f"limits{whose and '-'}{whose}", title, (tag("p", said["safety"]), table(head, lines)), wide=True)


def _limit_row(name: str, judged: Mapping[str, Any]) -> tuple[Cell, ...]:
    what = LABELS[name].replace("\n", " ")
    shown = (measured(judged[key], judged["unit"], 4) for key in ("worst", "limit", "margin"))
    at = f"{judged['time']:.2f} s" + (f", wheel {judged['wheel']}" if judged["wheel"] is not None else "")
    return what, *shown, at, VERDICTS[judged["verdict"]], _from(judged), seek(judged["time"], what)


def _from(judged: Mapping[str, Any]) -> Html:
    formula = f"{judged['formula']}; " if judged["formula"] else ""
    return tag("small", f"{formula}{judged['source']}")


def peaks(run: Table, graph: Iterable[str] = (), units: Mapping[str, str] | None = None) -> Html:
    """Return the largest magnitudes over the whole run, with a button that shows each.

    Parameters
    ----------
    graph, units : signals of a general graph, and units by signal
    """
    found = [*_signal_peaks(run), *_graph_peaks(run, graph, units or {})]
    return card("peaks", "Peaks", table(("what", "largest", "at", ""), found)) if found else Html()


def _signal_peaks(run: Table) -> Iterator[tuple[Cell, ...]]:
    several = sum(1 for name in run if re.fullmatch(r"contact\d+\.status", name)) > 1
    for pattern, words, unit in PEAKS:
        for name in run:
            if (match := re.fullmatch(pattern, name)) is not None:
                yield _peak(run, name, _called(words, match, several), unit)


def _called(words: str, match: re.Match[str], several: bool) -> str:
    if not match.re.groups:
        return words
    group = match[1]
    return words.format((f", wheel {group}" if several else "") if group.isdigit() else group)


def _peak(run: Table, name: str, what: str, unit: str) -> tuple[Cell, ...]:
    values = run.get(f"{name}_max", run[name])
    values = values[0] - values if name.endswith("position.z") else values
    row = int(np.argmax(np.abs(values)))
    time = float(run["time"][row])
    return tag("span", what, title=name), measured(float(values[row]), unit, 4), f"{time:.2f} s", seek(time, what)


def _graph_peaks(run: Table, names: Iterable[str], units: Mapping[str, str]) -> Iterator[tuple[Cell, ...]]:
    for name in names:
        row = int(np.argmax(np.abs(run[name])))
        unit, time = units.get(name, ""), float(run["time"][row])
        shown = f"{run[name][row]:.5g}" if unit in ("", "1") else measured(float(run[name][row]), unit, 5)
        yield name, shown, f"{time:.4g} s", seek(time, name)


# -- how wrong, and how it was computed -----------------------------------------------------------------------------


def errors(run: Run, reference: Mapping[str, Parts] | None = None) -> Html:
    """Return the estimated error of each signal by its parts, as shares of the signal's range."""
    parts = dict(reference if reference is not None else run.error_parts)
    if not parts:
        return Html()
    lines = [_error_row(name, one, range_of(run.table[name]), run) for name, one in parts.items() if name in run.table]
    head = ("signal", *NAMES.values(), "sum", "allowed", "verdict")
    said = tag(
        "p", f"As shares of the signal's range, largest over the run{_how_often(run, reference)}.", class_="muted"
    )
    why = tag("p", f"not known: {run.estimate_failure}") if run.estimate_failure else Html()
    return card("errors", "Errors by part", (said, table(head, lines), why))


def _how_often(run: Run, reference: Mapping[str, Parts] | None) -> str:
    """Return how often such an estimate is right; nothing of errors that were measured."""
    often = RIGHT.get(run.summary.get("estimate", ""), "")
    return f"; estimated, within a factor 3 in {often}" if reference is None and often else ""


def _error_row(name: str, parts: Parts, scale: float, run: Run) -> tuple[str, ...]:
    shares = [None if part is None else part / scale for part in (*parts.by_part.values(), parts.total)]
    cells = ["–" if share is None else "?" if np.isnan(share) else exponent(share) for share in shares]
    tolerance = run.tolerances.get(name)
    if tolerance is None:
        return name, *cells, "", ""
    return name, *cells, f"{tolerance:g}", verdict_on(parts, tolerance * scale, bool(run.estimate_doubts))


def exponent(share: float, digits: int = 1) -> str:
    """Return a small number as 5.0e−05, with a minus at which no line is broken."""
    return f"{share:.{digits}e}".replace("-", "−")


NUMERICS = {
    "master": "master", "exchange": "exchange", "macro_step": "macro step", "simulated_s": "simulated",
    "wall_s": "wall time", "steps": "macro steps", "iterations_per_step": "iterations a step",
    "unconverged_steps": "unconverged steps", "left_the_groove": "left the groove",
}  # fmt: skip
IN_SECONDS = ("macro_step", "simulated_s", "wall_s")


def numerics(summary: Mapping[str, Any]) -> Html:
    """Return how a run was computed, what it cost, and whether its energy balances."""
    lines = [
        (words, _numeric(key, summary[key])) for key, words in NUMERICS.items() if summary.get(key) not in (None, [])
    ]
    energy = summary.get("energy") or {}
    if "drift_J" in energy:
        lines.append(("energy drift", f"{energy['drift_J']:.2g} J of {energy['exchanged_J']:.4g} J exchanged"))
        lines += [(f"drift of {name}", f"{drift:.2g} J") for name, drift in energy.get("sources_J", {}).items()]
    lines += [("energy audit", str(energy["verdict"]))] if energy.get("verdict") else []
    mesh = summary.get("mesh")
    if mesh:
        lengths = f"{mesh['shortest_m']:.3g} to {mesh['longest_m']:.3g} m long"
        lines.append(("mesh", f"{mesh['n_elements']} elements, {lengths}"))
    return card("numerics", "Energy and numerics", pairs(lines))


def _numeric(key: str, value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g} s" if key in IN_SECONDS else f"{value:.4g}"
    return ", ".join(value) if isinstance(value, list) else str(value)


# -- what it was made from --------------------------------------------------------------------------------------------


def parameters(manifest: Mapping[str, Any], summary: Mapping[str, Any]) -> Html:
    """Return every value with its source; what is assumed stands out, with the reason."""
    provenance, given = manifest.get("provenance", {}), dict(_leaves("", _sections(manifest["resolved"])))
    lines = [(_short(name), *_row(value, provenance.get(name, {}))) for name, value in given.items()]
    robot = ((summary.get("geometry") or {}).get("robot") or {}).get("quantities", {})
    lines += [(f"robot.{name}", *_row(one["value"], one)) for name, one in robot.items()]
    if not lines:
        return Html()
    assumed = sum('class="assumed"' in row[2] for row in lines)
    said = tag("p", f"{assumed} of {len(lines)} values are assumed; each says why.", class_="muted")
    return card("parameters", "Parameters", (said, table(("parameter", "value", "source"), lines)), wide=True)


def _short(name: str) -> str:
    """Return the path of a value as people read it: ``cable.span``."""
    return name.replace(".parameters.", ".")


def _sections(resolved: Mapping[str, Any]) -> dict[str, Any]:
    return {name: section for name, section in resolved.items() if isinstance(section, dict)}


def _leaves(place: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield the path of each value, and the value."""
    if not isinstance(content, dict):
        yield place, content
        return
    for key, value in content.items():
        yield from _leaves(f"{place}.{key}".lstrip("."), value)


def _row(value: Any, said: Mapping[str, Any]) -> tuple[str, Html]:
    return _shown(value, said.get("unit") or ""), _source(said)


def _shown(value: Any, unit: str) -> str:
    if isinstance(value, list | tuple):
        few = [f"{one:g}" if isinstance(one, float) else str(one) for one in value[:6]]
        return f"{', '.join(few)}{' …' if len(value) > 6 else ''} {unit}".rstrip()
    text = str(value).lower() if isinstance(value, bool) else f"{value:.8g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}".rstrip() if unit != "1" else text


def _source(said: Mapping[str, Any]) -> Html:
    source, reason = str(said.get("source") or ""), str(said.get("reason") or "")
    if source == "assumed":
        return Html(tag("span", "assumed", class_="assumed") + tag("span", f": {reason}"))
    return Html(tag("span", f"{source}: {reason}" if reason else source))


def said_of(run: Run, said: Mapping[str, Any]) -> Html:
    """Return what there is to know beside the numbers: time in the air, what is not judged, notes and warnings."""
    lines: list[tuple[str, str]] = [("in the air", line) for line in in_the_air(run.table)]
    lines += [("not judged", line) for line in why_not_judged(said)]
    lines += [("note", line) for line in (*run.summary.get("notes", []), *run.summary.get("wiring", []))]
    lines += [("warning", line) for line in run.summary.get("warnings", [])]
    return card("notes", "Beside the numbers", pairs(lines)) if lines else Html()


def provenance(manifest: Mapping[str, Any]) -> Html:
    """Return versions, FMUs and the rest of the manifest, folded."""
    rest = {key: value for key, value in manifest.items() if key not in ("resolved", "provenance")}
    listing = tag("pre", json.dumps(rest, indent=1, ensure_ascii=False))
    written = f"line-landing {manifest.get('versions', {}).get('line-landing')}, written {manifest.get('written')}"
    return card("provenance", "Provenance", (tag("p", written, class_="muted"), folded("manifest", listing)))
