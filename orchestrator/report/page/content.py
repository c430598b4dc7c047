"""What stands in the page of a run, of several without a reference, or of a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from orchestrator.coupling.run.compare import matching_rows
from orchestrator.coupling.run.results import Table
from orchestrator.report.drawing import legend
from orchestrator.report.page import tables
from orchestrator.report.page.curves import hud_of, plots_of
from orchestrator.report.page.data import Packed, Source, pack_within
from orchestrator.report.page.gap import Gap, gap_of
from orchestrator.report.page.head import Head, Kind, LinePlace, Plot, Shown, Verdict
from orchestrator.report.page.html import Html, card, table, tag
from orchestrator.report.page.line import line_of
from orchestrator.report.page.scene import place_of
from orchestrator.report.page.template import Body
from orchestrator.report.page.tiles import header, tiles, verdict_of
from orchestrator.report.page.whatif import WhatIf, whatif_of
from orchestrator.runs.compare import Comparison
from orchestrator.runs.result import Run, verdict_word

REFERENCE, DIFFERENCE = "reference/", "difference/"
THROUGH_POINTS = "The line is a smooth curve through {n} points: the nodes of its mesh were not recorded."
Manifest = Mapping[str, Any]


@dataclass(frozen=True)
class Content:
    """Head, arrays and body of a page, and the WebAssembly of its what-if."""

    head: Head
    data: Packed
    body: Body
    module: str = ""


def of_results(results: Comparison | list[Run], manifest: Manifest, web: Path, most: int) -> Content:
    """Return the content of a page from what was read from its directory.

    Parameters
    ----------
    web : folder of what was built of the page
    most : characters that its arrays may take
    """
    first, *others = results.results if isinstance(results, Comparison) else results
    folder = results.directory if isinstance(results, Comparison) else first.directory
    whatif = whatif_of(folder, web) if folder is not None else WhatIf()
    if isinstance(results, Comparison):
        found = _of_comparison(results, manifest, whatif, most)
    else:
        found = _of_runs(first, others, manifest, whatif, most)
    return replace(found, head=replace(found.head, whatif=whatif.about), module=whatif.module)


def _of_runs(first: Run, others: Sequence[Run], manifest: Manifest, whatif: WhatIf, most: int) -> Content:
    plots = _plots(first)
    sources = [_source(first, plots), *(_source(run, plots, f"{run.label}/") for run in others)]
    data = pack_within(sources, most, whatif.arrays)
    head = _head(_kind(first), first, manifest, data, plots)
    shown = [_shown(first, ""), *(_shown(run, f"{run.label}/") for run in others)] if others else []
    lower = [_runs_card([first, *others]) if others else Html(), *_lower(first, manifest), *_of_each(others)]
    lower.append(tables.parameters(manifest, first.summary))
    return Content(replace(head, runs=shown), data, Body(_top(first, manifest, data), _more(lower)))


def _of_comparison(found: Comparison, manifest: Manifest, whatif: WhatIf, most: int) -> Content:
    first, *others = found.results
    reference, plots = found.reference, _plots(first)
    names = _names(plots)
    sources = [_source(first, plots), Source(REFERENCE, reference.table, reference.fields, names)]
    sources.append(_difference(first.table, reference.table, names))
    sources += [_source(run, plots, f"{run.label}/") for run in others]
    data = pack_within(sources, most, whatif.arrays)
    head = _head("comparison" if _kind(first) == "run" else "graph", first, manifest, data, plots)
    head = replace(
        head, runs=[_shown(first, ""), *(_shown(run, f"{run.label}/") for run in others)], reference=reference.kind
    )
    lower = [_comparison_card(found), _runs_card(found.results)]
    lower += [*_lower(first, manifest), tables.limits(reference.safety, "reference"), *_of_each(others)]
    lower.append(tables.parameters(manifest, first.summary))
    return Content(head, data, Body(_comparison_top(found, first, manifest, data), _more(lower)))


def _difference(run: Table, reference: Table, names: tuple[str, ...]) -> Source:
    """Return run minus reference, taken before both are rounded: that would leave steps where they agree well."""
    rows = matching_rows(reference["time"], run["time"])
    both = {name: run[name] - reference[name][rows] for name in names if name in run and name in reference}
    return Source(DIFFERENCE, {"time": run["time"]} | both, {}, names, full=False)


# -- head ---------------------------------------------------------------------------------------------------------


def _kind(run: Run) -> Kind:
    return "run" if "robot.body.position.z" in run.table else "graph"


def _plots(run: Run) -> list[Plot]:
    return plots_of(run.table, run.summary.get("limits", {}), run.tolerances, run.summary["units"])


def _names(plots: Sequence[Plot]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(signal.name for plot in plots for signal in plot.signals))


def _source(run: Run, plots: Sequence[Plot], prefix: str = "") -> Source:
    return Source(prefix, run.table, run.fields, _names(plots), full=not prefix)


def _shown(run: Run, prefix: str) -> Shown:
    return Shown(legend(run), prefix, not prefix, verdict_of(run.summary), run.safety)


def _head(kind: Kind, run: Run, manifest: Manifest, data: Packed, plots: list[Plot]) -> Head:
    geometry = run.summary.get("geometry")
    head = Head(
        kind=kind,
        title=manifest["resolved"]["title"],
        complete=manifest["complete"],
        error=manifest["error"],
        arrays=data.blob.places,
        verdict=verdict_of(run.summary),
        safety=run.safety,
        line=_line(run),
        plots=plots,
        hud=hud_of(run.table, with_clearance=_gap(run) is not None) if kind != "graph" else [],
        limits=run.summary.get("limits", {}),
        thinned=data.note,
    )
    return head if geometry is None else replace(head, **place_of(geometry, run.table))


def _gap(run: Run) -> Gap | None:
    return gap_of(run.summary.get("geometry"), run.table, line_of(run.fields))


def _line(run: Run) -> LinePlace | None:
    if not run.summary.get("geometry") or "position" not in run.fields:
        return None
    exact = "node_position" in run.fields
    return LinePlace("", exact, "" if exact else THROUGH_POINTS.format(n=run.fields["position"].shape[1]))


def _more(cards: Iterable[Html]) -> Html:
    """Return the cards below the picture."""
    return tag("section", cards, class_="more", aria_label="Numbers")


# -- body ---------------------------------------------------------------------------------------------------------


def _top(run: Run, manifest: Manifest, data: Packed) -> Html:
    verdict, landing = verdict_of(run.summary), _kind(run) == "run"
    if not landing:
        verdict = _of_the_run(run)
    parts = [header(manifest["resolved"]["title"], verdict, _subtitle(run), run.safety), *_notices(run, manifest, data)]
    return Html("".join([*parts, tiles(run.summary, run.table, run.summary.get("geometry"), _gap(run))]))


def _of_the_run(run: Run) -> Verdict:
    """Return the verdict on the numbers of a general graph, which no limit judges."""
    words = {
        "within": "Within tolerance",
        "missed": "Tolerance missed",
        "failed": "Failed",
        "interrupted": "Interrupted",
    }
    return Verdict(words[run.verdict], "safe" if run.verdict == "within" else "unsafe")


def _subtitle(run: Run) -> str:
    summary = run.summary
    parts = [str(summary["robot"])] if summary.get("robot") else []
    parts += [f"{run.time[-1] - run.time[0]:g} s", f"{run.master} at {1e3 * run.macro_step:g} ms"]
    parts += [f"stiffness {summary['stiffness_set']}"] if summary.get("stiffness_set") else []
    return " · ".join(parts)


def _notices(run: Run, manifest: Manifest, data: Packed) -> Iterator[Html]:
    """Yield what must not be overlooked: a run that did not come to its end, points left out, a line through points."""
    if not manifest["complete"]:
        yield tag(
            "p",
            (tag("b", "Incomplete: "), str(manifest["error"]), f". Shown is all up to {run.time[-1]:g} s."),
            class_="notice",
        )
    line = _line(run)
    for note in (data.note, line.note if line is not None else ""):
        if note:
            yield tag("p", note, class_="muted")


def _lower(run: Run, manifest: Manifest) -> Iterator[Html]:
    summary, graph = run.summary, () if _kind(run) == "run" else _names(_plots(run))
    yield tables.limits(summary)
    yield tables.peaks(run.table, graph, summary["units"])
    yield tables.errors(run)
    yield tables.numerics(summary)
    yield tables.said_of(run, summary)
    yield tables.provenance(manifest)


def _of_each(runs: Sequence[Run]) -> Iterator[Html]:
    for run in runs:
        yield tables.limits(run.summary, legend(run))


def _comparison_top(found: Comparison, first: Run, manifest: Manifest, data: Packed) -> Html:
    title = manifest["resolved"]["title"]
    said = first.safety if _kind(first) == "run" else ""
    verdict = verdict_of({"safe": found.safe, "safety": first.safety}) if said else _of_the_run(first)
    kept = "every tolerance is kept" if found.passed else "a tolerance is missed"
    subtitle = f"{_subtitle(first)} · against {found.reference.kind}: {kept}"
    parts = [header(title, verdict, subtitle, said), *_notices(first, manifest, data)]
    return Html("".join([*parts, tiles(first.summary, first.table, first.summary.get("geometry"), _gap(first))]))


def _comparison_card(found: Comparison) -> Html:
    head = ("master", "macro step", "signal", "coupling", "mesh", "whole error", "allowed", "verdict")
    rows = [
        (
            check.master,
            f"{1e3 * check.macro_step:g} ms",
            check.signal,
            *(
                "–" if share is None else tables.exponent(share, 2)
                for share in (check.coupling, check.mesh, check.error)
            ),
            f"{check.tolerance:g}",
            verdict_word(check.passed, check.note),
        )
        for check in found.checks
    ]
    said = tag("p", f"Shares of each signal's range, against the reference: {found.reference.kind}.", class_="muted")
    return card("comparison", "Errors against the reference", (said, table(head, rows)), wide=True)


def _runs_card(runs: Sequence[Run]) -> Html:
    head = ("run", "verdict", "safety", "iterations a step", "unconverged", "wall time")
    rows = [
        (
            legend(r),
            r.verdict,
            r.safety,
            f"{r.summary['iterations_per_step']:.3g}",
            str(r.summary["unconverged_steps"]),
            f"{r.summary['wall_s']:.3g} s",
        )
        for r in runs
    ]
    return card("runs", "Runs", table(head, rows), wide=True)
