"""Sweeps without a run: outcomes whose margins a function says."""

from collections.abc import Callable
from pathlib import Path

from orchestrator.runs.job import Done
from orchestrator.studies.sweep import design
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.study import Study, study_of

ALONG = {"landing.position": {"from": 20.0, "to": 80.0, "count": 7, "unit": "m"}}
MASSES = {"robot.parameters.mass": [10.0, 38.0]}
Margins = Callable[[float, float], dict[str, float] | None]


def swept(vary: dict, margins: Margins, **more: object) -> tuple[Study, list[Outcome]]:
    """Return a study, and outcomes with margins (share of the limit) of position and mass; None: the run failed."""
    study = study_of({"scenario": "landing_200m_point9", "vary": vary, **more}, Path("study.toml"))
    return study, [outcome_of(study, row, margins) for row in design.rows(study)]


def outcome_of(study: Study, row: design.Row, margins: Margins) -> Outcome:
    """Return what becomes of a run."""
    inputs = row.inputs
    found = margins(float(inputs.get("landing.position", 0.0)), float(inputs.get("robot.parameters.mass", 10.0)))
    done = Done(design.job(study, row), None, "crashed" if found is None else None)
    limits = {
        name: {"share": 1.0 - value, "verdict": "kept" if value > 0.0 else "exceeded"}
        for name, value in (found or {}).items()
    }
    vars(done)["summary"] = {"safe": all(value > 0.0 for value in (found or {}).values()), "limits": limits}
    return Outcome(row, done)


def hump(position: float, mass: float) -> dict[str, float]:
    """Exceeds `z` in the middle, `roll` with a mass of 38 kg near the tower."""
    return {"z": abs(position - 50.0) / 25.0 - 0.5, "roll": 0.5 if mass < 20.0 else (position - 25.0) / 40.0}
