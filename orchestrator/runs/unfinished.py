"""What is read of a run that has left no manifest: it is still going on, or its process was killed or has crashed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.run.columns import Rows
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.results import read_json
from orchestrator.coupling.run.simulate import SIGNALS, STEPS
from orchestrator.coupling.scratch import remove_parts
from orchestrator.runs.coupled import Coupled
from orchestrator.runs.going_on import ABOUT, FOLDER, goes_on
from orchestrator.runs.result import Run
from orchestrator.runs.summary import result
from orchestrator.runs.systems import resolve
from orchestrator.scenario.types import GraphScenario, LandingScenario, Provenance, Scenario

GOES_ON = "the run is still going on"
DIED = "its process was killed or has crashed, and what was written until then is here"


class Unfinished(FmuError):
    """A run has left no manifest."""

    def __init__(self, time: float, why: str):
        super().__init__("run", time, 0, why)

    def __str__(self) -> str:
        return f"unfinished, up to t = {self.time:g} s: {self.message}"


def unfinished_in(directory: Path) -> list[Path]:
    """Return the folders of unfinished runs: `directory` itself, or those of a comparison in it."""
    if (directory / "manifest.json").is_file():
        return []
    found = [*directory.glob(f"{FOLDER}/{ABOUT}"), *directory.glob(f"*/{FOLDER}/{ABOUT}")]
    return sorted(path.parent.parent for path in found)


def is_unfinished(directory: Path) -> bool:
    """Whether there are runs without a manifest, or a comparison that has runs and none itself."""
    manifest = directory / "manifest.json"
    return bool(unfinished_in(directory)) or (not manifest.is_file() and any(directory.glob("*/manifest.json")))


def load_unfinished(directory: Path | str) -> Run:
    """Return what an unfinished run has left so far; its `verdict` is ``failed``, and its `error` says why and up to when.

    Raises
    ------
    InputError : there is no unfinished run, or it has not come to its start
    """
    directory = Path(directory)
    if not (directory / FOLDER / ABOUT).is_file():
        raise InputError(f"{directory}: no folder {FOLDER}; there is no unfinished run")
    return result(_read(directory))


def clean(directory: Path) -> None:
    """Remove the files that a dead process has not completed."""
    for folder in (directory, directory / FOLDER, directory / "plots"):
        if folder.is_dir():
            remove_parts(folder)


def _read(directory: Path) -> Coupled:
    """Return the run as it would be, had it failed where its rows end."""
    folder = directory / FOLDER
    about = read_json(folder / ABOUT)
    try:
        rows, reports = Rows.read(folder / SIGNALS), Rows.read(folder / STEPS)
    except OSError as error:
        raise InputError(f"{directory}: the run has written no results yet ({error})") from None
    if not len(rows):
        raise InputError(f"{directory}: the run has not come to its start; there are no results")
    log = Log(
        about["master"], about["macro_step"], about["signals"], rows, reports, about["every"], units=about["units"]
    )
    log.error = Unfinished(float(log.time[-1]), GOES_ON if goes_on(directory) else DIED)
    log.wall = max((folder / SIGNALS).stat().st_mtime - about["started"], 0.0)
    log.wall_components = dict.fromkeys(about["fmus"], float("nan"))
    system = resolve(scenario_of(about))
    fields, table = system.split(log.table)
    return Coupled(system, about["exchange"], log, table, fields, about["fmus"], notes=about["notes"])


def scenario_of(about: Mapping[str, Any]) -> Scenario:
    """Return the scenario as it was resolved when the run began."""
    resolved = about["resolved"]
    kind = GraphScenario if "components" in resolved else LandingScenario
    found = kind.model_validate_json(json.dumps(resolved))
    provenance = {name: Provenance(**said) for name, said in about["provenance"].items()}
    return found.read_from(Path(about["scenario"]), provenance, about["scenario_notes"])
