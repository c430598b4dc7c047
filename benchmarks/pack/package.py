"""The pack written out for other groups: FMUs, system structures, reference and page of each case; and their results scored."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.pack.case import Case, Reference
from benchmarks.pack.norm import errors
from orchestrator.coupling.errors import InputError, digits
from orchestrator.coupling.run.results import read_table, write_json
from orchestrator.export.package import TOOL
from orchestrator.export.write import Exported, export

ABOUT, REFERENCE = "case.json", "reference"
EXCHANGES = {"explicit": "point", "iterative": "waveform"}
"""Folder → exchange: for engines that step each FMU once, and for those that iterate a step until it is consistent."""


def written(case: Case, folder: Path) -> Path:
    """Write a case into a new folder within `folder`; `InputError` if it is there already and has something in it."""
    place = folder / case.name
    if place.exists() and any(place.iterdir()):
        raise InputError(f"{place}: is there already; choose another folder, or empty it")
    place.mkdir(parents=True, exist_ok=True)
    packages = {kind: _exported(case, place, kind) for kind in EXCHANGES}
    case.reference().write(place, REFERENCE)
    write_json(place / ABOUT, _about(case, packages))
    (place / "README.md").write_text(_page(case, packages), encoding="utf-8")
    return place


def _exported(case: Case, place: Path, kind: str) -> Exported:
    # inner steps are made for this macro step: the longest means one inner step each, the shortest is good for all
    step = max(case.others) if kind == "explicit" else min(case.implicit)
    scenario = case.scenario(master="jacobi", macro_step=step, exchange=EXCHANGES[kind])
    return export(scenario, ssp_file=place / f"{kind}.ssp", osp_folder=place / kind)


def _about(case: Case, packages: dict[str, Exported]) -> dict[str, Any]:
    """Return what a program has to know of a case."""
    return {
        "name": case.name,
        "title": case.title,
        "signals": list(case.signals),
        "expensive": case.expensive,
        "stop_time": case.stop,
        "grid": case.grid,
        "macro_steps": {"explicit": list(case.others), "iterative": list(case.implicit)},
        "values": {
            kind: {part.name: dict(part.values) for part in one.package.parts} for kind, one in packages.items()
        },
    }


def _page(case: Case, packages: dict[str, Exported]) -> str:
    """Return the README of a case."""
    about, reference = f"Case `{case.name}` of the benchmark pack of {TOOL}.", case.reference()
    ranges = [float(values.max() - values.min()) for name, values in reference.table.items() if name != "time"]
    rows = zip(case.signals, ranges, reference.relative_error().values(), strict=True)
    signals = "\n".join(f"| `{name}` | {span:.6g} | {error:.1e} |" for name, span, error in rows)
    steps = {kind: ", ".join(f"{1e3 * step:g}" for step in values) for kind, values in _steps(case).items()}
    notes = "\n".join(f"- {note}." for note in packages["explicit"].package.notes)
    return f"""# {case.title[0].upper()}{case.title[1:]}

{about} {case.stresses}

Run the system from 0 s to {digits(case.stop)} s. Write a CSV file: a quoted header with `time` and the signals below,
a row at least every {digits(case.grid)} s, the start included.

| signal | range of the reference | its own error, as a share of that |
|---|---|---|
{signals}

The reference, `reference.csv`: {reference.method}.

The error of a result is the largest difference from the reference at the reference's points, as a share of the
reference's range, for each signal:

    python -m benchmarks.pack score FOLDER_OF_THIS_CASE result.csv

Say with it how many steps `{case.expensive}` was asked to make, those that were taken back included.

| | for engines that | macro steps that we ran, ms |
|---|---|---|
| `explicit.ssp`, `explicit/` | step each FMU once | {steps["explicit"]} |
| `iterative.ssp`, `iterative/` | take steps back until all values agree | {steps["iterative"]} |

In `iterative` loads come with their slopes over the step, and motions with their means.

`case.json` has all parameter values. The FMUs are Python and need line-landing installed from its repository
(`pip install -e .`).

## What an engine has to know
{notes}
"""


def _steps(case: Case) -> dict[str, tuple[float, ...]]:
    return {"explicit": case.others, "iterative": case.implicit}


def scored(place: Path, result: Path) -> Iterator[tuple[str, float, float]]:
    """Yield signal, error of a result and error of the reference of a case that was written out."""
    if not (place / f"{REFERENCE}.csv").exists():
        raise InputError(f"{place}: has no {REFERENCE}.csv; give the folder of a case that `export` has written")
    reference = Reference.read(place, REFERENCE)
    known = reference.relative_error()
    for name, error in errors(read_table(result), reference.table).items():
        yield name, error, known[name]
