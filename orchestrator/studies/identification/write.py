"""What an identification leaves: ``identification.json``, a page, and pictures of data beside the landings found."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import replacing, write_json
from orchestrator.report.drawn import drawn
from orchestrator.report.style import BLACK, BLUE, GREY, VERMILION, saved, steady
from orchestrator.runs.directory import circumstances
from orchestrator.studies.fit import Estimate
from orchestrator.studies.identification.solve import Identified, Outcome

STORE = "landings"
"""Folder of the landings that were calculated."""
RESULT = "identification.json"


def place_of(out: Path | None, name: str) -> Path:
    """Return the folder of an identification; one that holds something else is refused."""
    folder = out or Path("runs") / f"identify-{name}"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is no folder; choose another with --out")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / STORE).is_dir():
        raise InputError(f"{folder}: holds something else than an identification; choose another with --out")
    try:
        (folder / STORE).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}; choose another with --out") from None
    return folder


def write(folder: Path, found: Identified) -> list[Path]:
    """Write result, page and pictures to `folder`; return their paths."""
    write_json(folder / RESULT, content(found))
    pictures = [*drawn(lambda: _series(folder, found)), *drawn(lambda: _claims(folder, found))]
    page = folder / "identification.md"
    with replacing(page) as temporary:
        temporary.write_text("\n".join(_page(found, pictures)) + "\n", encoding="utf-8")
    return [folder / RESULT, page, *pictures]


def content(found: Identified) -> dict[str, Any]:
    """Return what ``identification.json`` says."""
    study, fit = found.study, found.fit
    outcomes = {True: list[dict[str, Any]](), False: list[dict[str, Any]]()}
    for one in found.outcomes:
        outcomes[one.datum.used].append(_outcome(one))
    return {
        "study": study.name,
        "title": study.title,
        "seed": study.seed,
        "set": study.set,
        "parameter_set": study.claims.parameter_set if study.claims is not None else None,
        "parameters": [_parameter(found, one) for one in fit.estimates],
        "correlation": fit.correlation,
        "chi2": fit.chi2,
        "data": int(fit.residual.size),
        "variance_scale": fit.scale,
        "used": outcomes[True],
        "predicted": outcomes[False],
        "evaluations": fit.evaluations,
        "failures": found.failures,
        "doubts": found.doubts,
        **circumstances(),
    }


def _parameter(found: Identified, one: Estimate) -> dict[str, Any]:
    sought = found.study.parameters[one.name]
    return {
        "name": one.name,
        "unit": sought.unit,
        "value": one.value,
        "standard_deviation": one.deviation,
        "interval": one.interval,
        "determined": one.determined,
        "at_bound": one.at_bound,
        "from": sought.low,
        "to": sought.high,
        "reason": sought.reason,
        "applies": [target.model_dump() for target in found.study.targets(one.name)],
    }


def _outcome(one: Outcome) -> dict[str, Any]:
    common = {"id": one.datum.name, "unit": one.datum.unit, "met": one.met, "rms_residual": one.rms}
    if one.datum.time is not None:
        return {**common, "values": int(one.ours.size), "uncertainty": float(one.datum.uncertainty[0])}
    return {**common, "data": one.datum.value, "ours": one.ours, "uncertainty": one.datum.uncertainty}


# -- rows, for the terminal and the page ------------------------------------------------------------------------


PARAMETERS = ("parameter", "unit", "found", "deviation", "interval", "from", "to", "")
DATA = ("data", "unit", "given", "ours", "uncertainty", "", "met")


def parameter_rows(found: Identified) -> Iterator[tuple[str, ...]]:
    """Yield a row for each parameter, under `PARAMETERS`."""
    for one in found.fit.estimates:
        sought = found.study.parameters[one.name]
        interval = "" if one.interval is None else f"{one.interval[0]:.4g} to {one.interval[1]:.4g}"
        deviation = f"{one.deviation:.2g}" if np.isfinite(one.deviation) else "open"
        said = "not determined" if not one.determined else f"at its {one.at_bound} bound" if one.at_bound else ""
        numbers = (f"{one.value:.5g}", deviation, interval, f"{sought.low:g}", f"{sought.high:g}")
        yield one.name, sought.unit or "1", *numbers, said


def data_rows(found: Identified) -> Iterator[tuple[str, ...]]:
    """Yield a row for each datum, under `DATA`."""
    for one in found.outcomes:
        use = "fitted" if one.datum.used else "foretold"
        yield one.datum.name, one.datum.unit, *_cells(one), use, "yes" if one.met else "no"


def _cells(one: Outcome) -> tuple[str, str, str]:
    if one.datum.time is not None:
        return f"{one.ours.size} values", f"rms {one.rms:.3g} uncertainties", f"{one.datum.uncertainty[0]:.3g}"
    given, ours, uncertainty = (
        ", ".join(f"{x:.4g}" for x in values) for values in (one.datum.value, one.ours, one.datum.uncertainty)
    )
    return given, ours, uncertainty


# -- the page -------------------------------------------------------------------------------------------------


def _page(found: Identified, pictures: list[Path]) -> Iterator[str]:
    fit = found.fit
    yield f"# {found.study.title}"
    yield ""
    failed = f", {found.failures} of them could not be" if found.failures else ""
    yield f"{fit.evaluations} sets of parameters were calculated (seed {found.study.seed}){failed}."
    yield ""
    yield from _table(PARAMETERS, parameter_rows(found))
    yield from (f"- {name}: {one.reason}" for name, one in found.study.parameters.items())
    yield ""
    yield from _said(found)
    yield "## Correlation"
    yield ""
    names = [one.name for one in fit.estimates]
    rows = ([name, *map(_correlation, row)] for name, row in zip(names, fit.correlation, strict=True))
    yield from _table(("", *names), rows)
    yield "## Data"
    yield ""
    yield from _table(DATA, data_rows(found))
    yield from (f"![{picture.stem}]({picture.name})\n" for picture in pictures)


def _correlation(value: float) -> str:
    return "open" if np.isnan(value) else f"{value:.2f}"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    names = list(head)
    yield f"| {' | '.join(names)} |"
    yield f"|{'---|' * len(names)}"
    yield from (f"| {' | '.join(row)} |" for row in rows)
    yield ""


def _said(found: Identified) -> Iterator[str]:
    """Yield what the numbers above mean, and how far they can be trusted."""
    yield f"Sum of squares {found.fit.chi2:.4g} of {found.fit.residual.size} values."
    yield "Deviation: one standard deviation, linearised. Interval: where the sum of squares has risen by as much."
    yield from found.doubts
    yield ""


# -- pictures -------------------------------------------------------------------------------------------------


def _series(folder: Path, found: Identified) -> Iterator[Path]:
    """Draw each measurement beside the landing found."""
    for one in (outcome for outcome in found.outcomes if outcome.datum.time is not None):
        datum = one.datum
        path = folder / f"{datum.name.replace(':', '_').replace(os.sep, '_')}.png"
        with saved(path, (6.0, 3.0)) as figure:
            upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
            upper.plot(datum.time, datum.value, color=GREY, label="measured")
            label = "found" if datum.used else "foretold"
            upper.plot(datum.time, one.ours, color=VERMILION, linestyle=(0, (5, 1.5)), label=label)
            upper.set_ylabel(f"{datum.name.partition(':')[2]} [{datum.unit}]")
            upper.legend()
            lower.plot(datum.time, one.residual, color=BLUE)
            lower.set_ylabel("Difference\n[uncertainties]")
            lower.set_xlabel("Time [s]")
            steady(upper)
        yield path


def _claims(folder: Path, found: Identified) -> list[Path]:
    """Draw the residual of every value of a claim, fitted and foretold."""
    chosen = [one for one in found.outcomes if one.datum.time is None]
    rows = [(f"{one.datum.name}", r, one.datum.used) for one in chosen for r in one.residual]
    if not rows:
        return []
    path = folder / "residuals.png"
    with saved(path, (6.0, 0.22 * len(rows) + 1.0)) as figure:
        axis = figure.subplots()
        at = np.arange(len(rows))[::-1]
        values = np.array([value for _, value, _ in rows])
        used = np.array([flag for *_, flag in rows])
        axis.axvspan(-1.0, 1.0, color="0.92", zorder=0)
        for flag, colour, label in ((True, BLACK, "fitted"), (False, VERMILION, "foretold")):
            if np.any(used == flag):
                axis.plot(values[used == flag], at[used == flag], "o" if flag else "s", color=colour, label=label)
        axis.set_yticks(at, [name for name, *_ in rows])
        axis.set_xscale("symlog", linthresh=2.0)
        axis.set_xlabel("Ours less the paper's [uncertainties]; grey: within")
        axis.legend()
    return [path]
