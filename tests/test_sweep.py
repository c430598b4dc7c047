"""A sweep: every run once, none lost, a row each; studies that cannot be are refused before anything is touched."""

import csv
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator.cli.commands import main
from orchestrator.coupling.errors import InputError
from orchestrator.runs import batch
from orchestrator.runs.job import Job, make
from orchestrator.runs.job import found as find
from orchestrator.studies.sweep import design, solve, write
from orchestrator.studies.sweep.distributions import Distribution
from orchestrator.studies.sweep.study import Study, load_study, path_of, study_of

OSCILLATOR = """
scenario = "oscillator"
[set]
simulation.stop_time = {stop}
[vary]
components.left.parameters.mass = {{ from = 1.0, to = 2.0, count = {count} }}
"""
LANDING = """
scenario = "landing_200m_point9_physical"
solver = "monolithic"
record = [2]
[set]
simulation.stop_time = 0.2
[vary]
landing.position = [20.0, 60.0]
"""


def written(folder: Path, text: str, name: str = "study.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def oscillator(folder: Path, stop: float = 0.1, count: int = 3) -> Path:
    return written(folder, OSCILLATOR.format(stop=stop, count=count))


def command(*arguments: object) -> int:
    """Return the exit status of the command line."""
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


def rows(folder: Path) -> list[dict[str, str]]:
    with open(folder / "table.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def run(study: Study, folder: Path, **options) -> solve.Swept:
    return solve.sweep(study, folder / write.STORE, lambda found: write.save(folder, found), workers=2, **options)


# -- what is run --------------------------------------------------------------------------------------------------


def test_every_combination_is_run_with_the_same_sample():
    points = {"from": 20.0, "to": 40.0, "count": 3, "unit": "m"}
    friction = {"contact.parameters.friction_coefficient": {"uniform": [0.5, 0.7]}}
    document = {
        "scenario": "landing_200m_point9",
        "vary": {"landing.position": points, "robot": ["fptlir", "x.fmu"]},
        "sample": {"count": 20, "method": "latin_hypercube", **friction},
    }
    study = study_of(document, Path("study.toml"))
    found = design.rows(study, 0, 10)
    assert [row.number for row in found] == list(range(1, 121)), "six combinations, ten scrambles of two"
    assert [row.varied["robot"] for row in found[:3]] == ["fptlir", "x.fmu", "fptlir"]
    assert found[0].sampled == found[5].sampled != found[6].sampled and found[12].block == 1
    assert design.rows(study, 3, 4) == found[36:48], "a later look has the runs that an earlier one would have had"
    job = design.job(study, found[2])
    assert job.set["landing.position"] == {"value": 30.0, "unit": "m"} and job.robot == "fptlir" and not job.keep


@pytest.mark.parametrize(
    ("given", "quantiles"),
    [
        ({"uniform": [2.0, 4.0]}, [2.5, 3.0, 3.5]),
        ({"normal": [1.0, 0.5]}, [1.0 - 0.5 * 0.6744897501960817, 1.0, 1.0 + 0.5 * 0.6744897501960817]),
        ({"lognormal": [3.0, 0.5]}, [3.0 * np.exp(-0.33724487509804085), 3.0, 3.0 * np.exp(0.33724487509804085)]),
        ({"triangular": [0.0, 1.0, 2.0]}, [np.sqrt(0.5), 1.0, 2.0 - np.sqrt(0.5)]),
        ({"uniform": [0.0, 10.0], "from": 4.0, "to": 8.0}, [5.0, 6.0, 7.0]),
    ],
)
def test_a_quarter_a_half_and_three_quarters_of_a_distribution(given: dict, quantiles: list[float]):
    found = Distribution.model_validate(given).values(np.array([0.25, 0.5, 0.75]))
    assert found == pytest.approx(quantiles, rel=1e-12)


def test_ends_of_the_unit_interval_are_finite():
    assert np.all(np.isfinite(Distribution(normal=[0.0, 1.0]).values(np.array([0.0, 1.0]))))


# -- what is left ---------------------------------------------------------------------------------------------------


def test_a_row_a_run_and_only_the_signals_asked_for(tmp_path: Path):
    folder = tmp_path / "out"
    assert command("sweep", written(tmp_path, LANDING), "--out", folder, "--quiet") == 0
    first, second = rows(folder)
    assert [float(row["landing.position"]) for row in (first, second)] == [20.0, 60.0]
    for row in (first, second):
        summary = json.loads((folder / "runs" / row["folder"] / "summary.json").read_text(encoding="utf-8"))
        margins = {name: 1.0 - judged["share"] for name, judged in summary["limits"].items()}
        assert row["safe"] == "1" and summary["safe"] and row["verdict"].startswith("SAFE until 0.2 s")
        assert row["binding"] == min(margins, key=margins.__getitem__)
        assert float(row["least_margin"]) == min(margins.values()) == float(row[f"margin.{row['binding']}"])
        assert float(row["robot.roll.max"]) == summary["extremes"]["robot.roll"]["max"] >= float(row["robot.roll.min"])
        assert float(row["robot.roll.error"]) < 1e-4
        assert (folder / "runs" / row["folder"] / "results.csv").exists() == (row is second), "record = [2]"
    result = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    assert result["complete"] and result["counts"] == {
        "runs": 2,
        "safe": 2,
        "not_safe": 0,
        "not_judged": 0,
        "failed": 0,
    }


def test_a_monolithic_run_is_judged_as_a_coupled_one(tmp_path: Path):
    values = {"simulation.stop_time": 0.3, "robot.parameters.mass": 38.0}
    found = {}
    for solver in ("monolithic", "coupled"):
        job = Job("landing_200m_point9_physical", values, solver=solver, interval=0.005, keep=False)
        make(job, tmp_path)
        done = find(job, tmp_path)
        assert done is not None and done.failure is None and not (tmp_path / job.key / "results.csv").exists()
        found[solver] = done.summary["limits"]
    assert found["monolithic"].keys() == found["coupled"].keys()
    for name in ("roll", "z", "tension"):
        mono, coupled = (found[solver][name]["share"] for solver in ("monolithic", "coupled"))
        assert mono == pytest.approx(coupled, rel=5e-3), (
            f"{name}: tolerances of the scenario are 1e-2 and 1e-3 of a range"
        )


def test_the_table_as_parquet_is_the_csv(tmp_path: Path):
    pyarrow = pytest.importorskip(
        "pyarrow.parquet", reason="pyarrow is not installed: pip install 'line-landing[frames]'"
    )
    rows = [
        {"run": 1, "safe": True, "least_margin": 0.25, "binding": "z", "failure": ""},
        {"run": 2, "safe": None, "least_margin": None, "binding": "", "failure": "it hung"},
    ]
    write.write_rows(tmp_path / "table.csv", rows)
    write.write_parquet(tmp_path / "table.parquet", tmp_path / "table.csv")
    found = pyarrow.read_table(tmp_path / "table.parquet").to_pydict()
    assert found["run"] == [1.0, 2.0] and found["safe"] == [1.0, None] and found["least_margin"] == [0.25, None]
    assert found["binding"] == ["z", ""] and found["failure"] == ["", "it hung"]


# -- what goes wrong ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Crash(Job):
    """Ends the worker's process without a word."""

    def loaded(self):
        if parent_process() is not None:
            os._exit(7)
        return super().loaded()


@dataclass(frozen=True)
class Hang(Job):
    """Does not come back."""

    def loaded(self):
        if parent_process() is not None:
            time.sleep(60.0)
        return super().loaded()


def test_faulty_runs_fail_alone_and_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    study, kinds = load_study(oscillator(tmp_path, count=6)), {2: Crash, 5: Hang}
    monkeypatch.setattr(solve, "job", lambda study, row: kinds.get(row.number, Job)(**vars(design.job(study, row))))
    seen: list[tuple[int, int, int]] = []
    found = run(study, tmp_path / "out", timeout=8.0, told=lambda *counts: seen.append(counts))
    assert [outcome.row.number for outcome in found.failed] == [2, 5] and seen[-1] == (6, 6, 2)
    table = rows(tmp_path / "out")
    assert "died (exit code 7)" in table[1]["failure"] and "longer than it may" in table[4]["failure"]
    assert [bool(row["failure"]) for row in table] == [False, True, False, False, True, False]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_sweep_that_was_ended_goes_on_and_leaves_the_same_table(tmp_path: Path, number: int):
    study, folder = oscillator(tmp_path, stop=0.5, count=24), tmp_path / "out"
    line = [
        sys.executable,
        "-m",
        "orchestrator",
        "sweep",
        str(study),
        "--out",
        str(folder),
        "--quiet",
        "--workers",
        "2",
    ]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as first:
        while len(list(folder.glob("runs/[!.]*/manifest.json"))) < 3 and first.poll() is None:
            time.sleep(0.02)
        first.send_signal(number)
    made = {path: path.stat().st_mtime_ns for path in folder.glob("runs/[!.]*/manifest.json")}
    assert 3 <= len(made) < 24
    if number == signal.SIGINT:
        assert not json.loads((folder / "study.json").read_text(encoding="utf-8"))["complete"]
    assert subprocess.run(line, check=False).returncode == 0
    assert {path: path.stat().st_mtime_ns for path in made} == made, "none is made twice"
    undisturbed = tmp_path / "undisturbed"
    assert command("sweep", study, "--out", undisturbed, "--quiet") == 0
    assert (folder / "table.csv").read_bytes() == (undisturbed / "table.csv").read_bytes()


WRONG = {
    'scenario = "oscillator"': "nothing that varies",
    '[vary]\n"landing.position" = [1.0]': "has no scenario",
    'scenario = "osilator"\n[vary]\n"simulation.stop_time" = [1.0]': "oscillator",
    'scenario = "oscillator"\nsolver = "monolitic"\n[vary]\n"simulation.stop_time" = [1.0]': "solver",
    'scenario = "oscillator"\n[vary]\n"simulation.stop_tim" = [1.0]': "stop_time",
    'scenario = "oscillator"\n[vary]\n"simulation.stop_time" = []': "vary.simulation.stop_time",
    'scenario = "oscillator"\n[vary]\n"simulation.stop_time" = { from = 2.0, to = 1.0, count = 3 }': "must lie below",
    'scenario = "oscillator"\n[vary]\n"simulation.stop_time" = { from = 1.0, to = 2.0 }': "count",
    'scenario = "oscillator"\n[set]\n"a.b" = 1\n[vary]\n"a.b" = [1.0]': "leave one of them out",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { uniform = [2.0, 1.0] }': "lower one first",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { normal = [2.0, 0.0] }': "must be above 0",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { normal = [2.0] }': "mean, standard deviation",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { lognormal = [-1.0, 0.1] }': "median",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { triangular = [1.0, 3.0, 2.0] }': "in that order",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { uniform = [0.0, 1.0], from = 2.0 }': "nothing between",
    'scenario = "oscillator"\n[sample]\ncount = 9\n"a.b" = { normal = [0.0, 1.0], uniform = [0.0, 1.0] }': "give one of",
    'scenario = "oscillator"\n[sample]\ncount = 25\nmethod = "latin_hypercube"\n"a.b" = { normal = [0.0, 1.0] }': "take 20",
    'scenario = "oscillator"\n[sample]\ncount = 600\nmethod = "sobol"\n"a.b" = { normal = [0.0, 1.0] }': "320 or 640",
    'scenario = "oscillator"\n[sample]\ncount = 9\nscrambles = 5\n"a.b" = { normal = [0.0, 1.0] }': "scrambles",
    'scenario = "oscillator"\n[sample]\ncount = 9\n': "sample",
    'scenario = "drop_5cm"\nsolver = "monolithic"\nextremes = ["robot.rol"]\n[vary]\nrobot = ["fptler"]': "fptlir",
    "scenario = ": "study.toml",
}  # fmt: skip


@pytest.mark.parametrize("text", WRONG, ids=list(WRONG.values()))
def test_a_bad_study_is_refused_with_place_cause_and_cure(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
):
    path = written(tmp_path, text)
    assert command("sweep", path, "--out", tmp_path / "out", "--quiet") == 2
    said = capsys.readouterr().err
    assert "study.toml" in said and WRONG[text] in said and "Traceback" not in said
    assert not (tmp_path / "out").exists(), "nothing is touched"


def test_a_folder_is_known_before_its_first_run_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    study, out = load_study(oscillator(tmp_path)), tmp_path / "out"

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch.Batches, "_made", killed)
    with pytest.raises(KeyboardInterrupt):
        run(study, out)
    assert not json.loads((out / "study.json").read_text(encoding="utf-8"))["complete"] and rows(out) == []
    assert write.place_of(out, study) == out


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path):
    study, out = load_study(oscillator(tmp_path)), tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="something else than a sweep"):
        write.place_of(out, study)
    (out / "study.json").write_text('{"study": "other", "hash": "0"}', encoding="utf-8")
    with pytest.raises(InputError, match="of another study, other"):
        write.place_of(out, study)
    (out / "study.json").write_text('{"study": "study", "hash": "0"}', encoding="utf-8")
    with pytest.raises(InputError, match="has changed since"):
        write.place_of(out, study)
    with pytest.raises(InputError, match="is no folder"):
        write.place_of(out / "mine.txt", study)
    assert (out / "mine.txt").read_text(encoding="utf-8") == "mine"


# -- in Python ------------------------------------------------------------------------------------------------------


def test_a_sweep_in_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    counts: list[tuple[int, int, int]] = []
    document = tomllib.loads(LANDING.replace("0.2", "0.1"))
    found = orchestrator.sweep(document, workers=1, progress=lambda *now: counts.append(now))
    assert found.directory.parent == Path("runs") and counts == [(0, 2, 0), (1, 2, 0), (2, 2, 0)]
    assert found.table["landing.position"].tolist() == [20.0, 60.0] and found.table["safe"].tolist() == [1.0, 1.0]
    assert found.table["binding"].dtype == object and found.probability == []
    assert found.safe_ranges == ["landing.position: safe from 20 to 60 m (2 values)"] and "2 safe" in repr(found)
    (axis,) = found.map("landing.position").axes
    assert axis.get_ylabel() == "Least margin [% of the limit]"
    with pytest.raises(InputError, match="does not vary"):
        found.map("landing.position", "robot.parameters.mass")
    if importlib.util.find_spec("pandas"):
        assert found.frame().shape == (2, len(found.table))
    again = orchestrator.sweep(document)
    assert again.directory == found.directory and again.counts == found.counts


# -- what is shipped --------------------------------------------------------------------------------------------------


def test_a_cut_of_the_papers_points_and_masses(tmp_path: Path):
    """Heavier is nearer to the limits; 100 kg at midspan goes beyond the clearance, which it nears by its weight alone."""
    shipped = load_study(path_of("points_masses"))
    assert shipped.name == "points_masses" and len(design.groups(shipped)) == 40
    vary = {"landing.position": [100.0], "robot.parameters.mass": [10.0, 55.0, 100.0]}
    cut = shipped.model_copy(update={"vary": vary, "set": {"simulation.stop_time": 2.0}})
    found = run(cut, tmp_path / "out")
    light, middle, heavy = found.outcomes
    for name in ("z", "tension"):
        assert light.margins[name] > middle.margins[name] > heavy.margins[name], name
    assert [outcome.safe for outcome in found.outcomes] == [True, True, False]
    assert heavy.binding == "z" and not found.failed
