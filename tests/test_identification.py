"""Identification: files that are wrong, where parameters go, and a mass found again from a landing of known mass."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from orchestrator.cli.commands import app
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import write_table
from orchestrator.runs.batch import run_batch
from orchestrator.runs.job import Job
from orchestrator.studies.identification.data import experiment
from orchestrator.studies.identification.study import load_study, path_of

STUDY = """
title = "A mass found again"
scenario = "drop_5cm"
seed = 1
set = { "simulation.stop_time" = 0.4 }
search = { population = 3, generations = 3, intervals = false }

[parameters."robot.parameters.mass"]
from = 20.0
to = 60.0
unit = "kg"
reason = "robots of this kind"

[[measurement]]
file = "measured.csv"
signals.z = { signal = "robot.body.position.z", unit = "mm", uncertainty = 1.0, relative = true }
signals.force = { signal = "contact1.radial_force", uncertainty = 20.0, used = false }
"""
MASS = 33.0


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a table made by the monolithic solver with a known mass: time, z in mm, force in N."""
    folder = tmp_path_factory.mktemp("measured")
    settings = {"robot.parameters.mass": MASS, "simulation.stop_time": 0.4}
    signals = ("robot.body.position.z", "contact1.radial_force")
    job = Job("drop_5cm", settings, interval=0.01, estimate=False, signals=signals)
    (done,) = run_batch([job], folder / "store", workers=1)
    table = done.table
    path = folder / "measured.csv"
    write_table(path, {"time": table["time"], "z": 1e3 * table[signals[0]], "force": table[signals[1]]})
    return path


@pytest.fixture
def folder(tmp_path: Path, measured: Path) -> Path:
    (tmp_path / "measured.csv").write_bytes(measured.read_bytes())
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_a_known_mass_is_found_again_and_the_force_foretold(folder: Path):
    """Where data come from: the same solver with 33 kg. 1 mm of uncertainty in 41 values: the mass to better than 1 kg."""
    arguments = ["identify", str(folder / "study.toml"), "--out", str(folder / "out"), "--workers", "1", "--quiet"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((folder / "out/identification.json").read_text())
    (mass,) = found["parameters"]
    assert mass["value"] == pytest.approx(MASS, abs=0.5)
    assert 0.0 < mass["standard_deviation"] < 1.0
    assert mass["determined"] and not mass["at_bound"]
    assert [one["id"] for one in found["used"]] == ["measured:z"]
    assert [one["id"] for one in found["predicted"]] == ["measured:force"]
    assert found["predicted"][0]["met"]
    assert (folder / "out/measured_z.png").is_file()
    again = CliRunner().invoke(app, arguments)
    assert again.exit_code == 0  # of finished landings alone, and with the same answer
    assert json.loads((folder / "out/identification.json").read_text())["parameters"] == found["parameters"]


def test_a_folder_of_something_else_is_refused(folder: Path):
    (folder / "out").mkdir()
    (folder / "out/letters.txt").write_text("mine")
    result = CliRunner().invoke(app, ["identify", str(folder / "study.toml"), "--out", str(folder / "out")])
    assert result.exit_code == 2
    assert (folder / "out/letters.txt").read_text() == "mine"


def _problem(folder: Path, old: str, new: str) -> str:
    text = STUDY.replace(old, new)
    assert text != STUDY
    (folder / "study.toml").write_text(text)
    with pytest.raises(InputError) as error:
        experiment(load_study(folder / "study.toml"))
    return str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("from = 20.0", "from = 70.0", "parameters.robot.parameters.mass: from 70 must lie below to 60"),
        ('reason = "robots of this kind"', "", "reason: missing"),
        ("seed = 1", "sed = 1", "sed: unknown key; did you mean seed?"),
        ('file = "measured.csv"', 'file = "nothing.csv"', "nothing.csv"),
        ("signals.z =", "signals.height =", "no column 'height'"),
        ("robot.body.position.z", "robot.body.position.zz", "zz'; did you mean body.position.z?"),
        ('unit = "mm"', 'unit = "kg"', "unit 'kg' does not fit"),
        ("uncertainty = 1.0", "uncertainty = 0.0", "greater than 0"),
        ('scenario = "drop_5cm"', 'scenario = "drop_6cm"', "drop_6cm"),
        ('scenario = "drop_5cm"', "", "add scenario"),
        ("relative = true }", "relative = true, used = false }", "has no data to fit"),
        ("relative = true }", 'relative = true }\ntime_unit = "m"', "unit 'm' does not fit"),
    ],
)  # fmt: skip
def test_wrong_studies_are_said_with_place_cause_and_cure(folder: Path, old: str, new: str, words: str):
    problem = _problem(folder, old, new)
    assert words in problem
    assert "study.toml" in problem or ".csv" in problem or "drop_6cm" in problem


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t["time"].__setitem__(3, t["time"][2]), "times must rise"),
        (lambda t: t["z"].__setitem__(5, np.nan), "column 'z', row 7: nan is no number"),
    ],
)
def test_wrong_tables_are_said(folder: Path, change, words: str):
    time = np.linspace(0.0, 0.4, 41)
    table = {"time": time, "z": np.zeros(41), "force": np.zeros(41)}
    change(table)
    write_table(folder / "measured.csv", table)
    with pytest.raises(InputError, match=words):
        experiment(load_study(folder / "study.toml"))


CLAIMS = """
title = "Spacing of the points"
claims = { used = ["F19-z-point1", "F12-z0"] }

[parameters.spacing]
from = 8.5
to = 9.9
unit = "m"
reason = "10 m puts the last point on the tower"
applies = [{ landing = "point9", key = "landing.position", offset = 100.0, factor = -8.0 }]
"""


def test_a_parameter_goes_where_it_applies(tmp_path: Path):
    path = tmp_path / "spacing.toml"
    path.write_text(CLAIMS)
    what = experiment(load_study(path))
    by_landing = dict(zip(what.landings, what.jobs({"spacing": 9.0}), strict=True))
    assert by_landing["point9"].set["landing.position"] == {"value": 28.0, "unit": "m"}
    assert by_landing["point1"].set["landing.position"] == 100.0
    assert by_landing["point9"].loaded().landing.position == 28.0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"F12-z0"', '"F12-z1"', "no claim 'F12-z1'; did you mean F12-z0?"),
        ('"F12-z0"', '"T2-yaw"', "T2-yaw is not measured in a landing"),
        ('"F12-z0"', '"F14-rise"', "F14-rise is a bound"),
        ('"F12-z0"]', '"F12-z0"], predicted = ["F12-z0"]', "F12-z0 stands there twice"),
        ('landing = "point9"', 'landing = "point99"', "no landing 'point99' is run; did you mean point9?"),
        ("used =", 'parameter_set = "fysical", used =', "no set 'fysical'; did you mean physical?"),
    ],
)
def test_wrong_claims_are_said(tmp_path: Path, old: str, new: str, words: str):
    path = tmp_path / "spacing.toml"
    path.write_text(CLAIMS.replace(old, new))
    with pytest.raises(InputError) as error:
        experiment(load_study(path))
    assert words in str(error.value)
    assert "spacing.toml" in str(error.value)


@pytest.mark.parametrize("name", ["points", "masses", "both"])
def test_the_studies_of_the_paper_are_whole(name: str):
    study = load_study(path_of(name))
    what = experiment(study)
    assert sum(datum.value.size for datum in what.used) >= len(study.parameters)  # or anything meets them
    assert study.claims is not None
    assert not set(study.claims.used) & set(study.claims.predicted)


def test_an_unknown_study_is_said():
    with pytest.raises(InputError, match="did you mean points"):
        path_of("pionts")
