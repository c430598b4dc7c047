"""What margins hang on: indices of Sobol' that are known, from a function and from a landing law; failures are said."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.runs.job import Done
from orchestrator.studies.sweep import bars, design, write
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.sensitivity import indices, sensitivities
from orchestrator.studies.sweep.solve import Swept
from orchestrator.studies.sweep.study import Study, study_of

MASS, FRICTION, DAMPING = (
    "robot.parameters.mass",
    "contact.parameters.friction_coefficient",
    "cable.parameters.mass_damping",
)
WEIGHTS = {MASS: 0.03, FRICTION: 1.0, DAMPING: 0.2}
DEVIATIONS = {MASS: 2.0, FRICTION: 0.1 / np.sqrt(12.0), DAMPING: 0.1}
LAWS = {MASS: {"normal": [38.0, 2.0]}, FRICTION: {"uniform": [0.6, 0.7]}, DAMPING: {"normal": [1.0, 0.1]}}


def test_the_function_of_ishigami_and_homma():
    """Ishigami and Homma 1990, with a = 7, b = 0.1: known in closed form, with a parameter that acts through another alone."""
    names, (a, b) = ["x1", "x2", "x3"], (7.0, 0.1)
    parts = design.saltelli(3, 2048, 1, names)
    x = {name: np.pi * (2.0 * shares.T - 1.0) for name, shares in parts.items()}
    values = {
        name: np.sin(one[0]) + a * np.sin(one[1]) ** 2 + b * one[2] ** 4 * np.sin(one[0]) for name, one in x.items()
    }
    found = indices({"y": values}, names)["y"]
    one, two, both = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2, a**2 / 8.0, 8.0 * b**2 * np.pi**8 / 225.0
    variance = one + two + both
    first, total = (one, two, 0.0), (one + both, two, both)
    for name, s, t in zip(names, first, total, strict=True):
        for index, truth in ((found[name].first, s / variance), (found[name].total, t / variance)):
            assert index.interval[0] <= index.estimate <= index.interval[1]
            assert index.interval[0] - 0.01 <= truth <= index.interval[1] + 0.01
            assert index.estimate == pytest.approx(truth, abs=0.03), "2048 points; Monte Carlo would leave 0.02"


def study(count: int = 64, **more: object) -> Study:
    document = {
        "scenario": "landing_200m_point9",
        "sample": {"count": 10, **LAWS},
        "sensitivity": {"count": count},
        **more,
    }
    return study_of(document, Path("study.toml"))


def outcome(study: Study, row: design.Row, fails: bool = False) -> Outcome:
    """Return a landing whose margin of roll is linear in what is drawn; that of yaw is always the same."""
    done = Done(design.job(study, row), None, "crashed" if fails else None)
    share = 0.1 + sum(weight * row.inputs[name] for name, weight in WEIGHTS.items()) / 4.0
    limits = {"roll": {"share": share, "verdict": "kept"}, "yaw": {"share": 0.5, "verdict": "kept"}}
    vars(done)["summary"] = {"safe": True, "limits": limits}
    return Outcome(row, done)


def test_a_linear_landing_law():
    """Indices are the shares of the variance; first and total are equal, as nothing acts together."""
    read = study(256)
    (found,) = sensitivities(read, [outcome(read, row) for row in design.sensitivity_rows(read)])
    parts = {name: (WEIGHTS[name] * DEVIATIONS[name]) ** 2 for name in WEIGHTS}
    for name, part in parts.items():
        truth = part / sum(parts.values())
        both = found.of["margin.roll"][name]
        for index in (both.first, both.total):
            assert index.interval[0] - 0.01 <= truth <= index.interval[1] + 0.01
        assert both.total.estimate == pytest.approx(truth, abs=0.02)
    assert found.unknown == {"margin.yaw": "does not vary"}
    again = sensitivities(read, [outcome(read, row) for row in design.sensitivity_rows(read)])
    assert again == [found], "the same runs give the same intervals"


def test_its_runs_come_after_the_sample_and_say_nothing_of_the_probability():
    read = study(8, vary={"landing.position": [20.0, 60.0]})
    rows = design.sensitivity_rows(read)
    assert len(rows) == 2 * 8 * (3 + 2) and [row.number for row in rows] == list(range(21, 101))
    assert [row.part for row in rows[::16]] == ["A", "B", MASS, FRICTION, DAMPING]
    assert (
        rows[0].sampled == rows[1].sampled and rows[32].sampled[MASS] == rows[16].sampled[MASS] != rows[0].sampled[MASS]
    )
    assert rows[32].sampled[FRICTION] == rows[0].sampled[FRICTION]
    found = Swept(read, 1, [outcome(read, row) for row in (*design.rows(read, 0, 10), *rows)])
    assert [one.of["all"].count for one in found.chances] == [10, 10]
    assert [one.where for one in found.sensitivities] == [{"landing.position": 20.0}, {"landing.position": 60.0}]


def test_runs_that_fail_are_said_and_what_is_not_complete_has_no_indices():
    read = study(8)
    rows = design.sensitivity_rows(read)
    (found,) = sensitivities(read, [outcome(read, row, row.number == 12) for row in rows])
    assert found.of == {} and found.unknown["margin.roll"] == "not known in 1 of 40 runs"
    assert sensitivities(read, [outcome(read, row) for row in rows[:-1]]) == []


def test_what_is_written_and_drawn(tmp_path: Path):
    read = study(16)
    every = [*design.rows(read, 0, 10), *design.sensitivity_rows(read)]
    found = Swept(read, 1, [outcome(read, row) for row in every], complete=True)
    write.save(tmp_path, found)
    (said,) = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))["sensitivity"]
    assert (
        set(said["of"]["margin.roll"]) == set(LAWS) and len(said["of"]["margin.roll"][MASS]["first"]["interval"]) == 2
    )
    assert write.read_columns(tmp_path / "table.csv")["part"][0] == ""
    assert [row[1:3] for row in write.index_rows(found)][:3] == [("least_margin", name) for name in LAWS]
    assert [path.name for path in bars.write(tmp_path, found.sensitivities)] == ["sensitivity.png", "sensitivity.pdf"]
    assert bars.write(tmp_path, []) == []


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"sensitivity": {"count": 100}}, "take 64 or 128"),
        ({"sample": None}, "without"),
        ({"sensitivity": {}}, "count"),
    ],
)
def test_what_cannot_be(document: dict, said: str):
    with pytest.raises(InputError, match=said):
        study(**{"vary": {"landing.position": [20.0]}, **document})
