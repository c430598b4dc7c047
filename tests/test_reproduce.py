"""The paper's claims: data, verdicts, proofs, and the command."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.runs.job import Done, Job
from orchestrator.studies.book import Book, jobs_of, jobs_of_sensitivity, jobs_of_series
from orchestrator.studies.documents import Claim, Claims, Documents, Landing, Landings, ParameterSet
from orchestrator.studies.page import text
from orchestrator.studies.pictures import draw
from orchestrator.studies.proofs import PROOFS
from orchestrator.studies.reading import load_study, shipped
from orchestrator.studies.referee import still_air, windy
from orchestrator.studies.reproduce import reproduce
from orchestrator.studies.verdicts import rows_of
from tests.command import orchestrate

IDS = {
    "F12-z0", "F12-zpeak", "F12-zend", "F12-roll", "F12-yaw", "F12-pitch", "F13-pitch", "F14", "F15-z", "F15-roll", "F15-yaw",
    "F19-z", "F19-roll", "F19-tz", "F19-troll", "F20-z", "F20-roll", "F20-tz", "F20-troll", "F11-ancf", "F11-fem", "F17",
    "F18", "T3",
}  # fmt: skip
"""The claims of the paper's text."""
TIME = np.linspace(0.0, 20.0, 1001)


@pytest.fixture(scope="module")
def paper() -> Documents:
    return load_study(shipped())


# -- the data -------------------------------------------------------------------------------------------------


def test_every_claim_of_the_paper_has_a_row(paper):
    ids = [claim.id for claim in paper.claims.claim]
    assert set(ids) >= IDS and len(ids) == len(set(ids))


def test_every_job_can_be_read_and_no_two_landings_are_alike(paper):
    landings = [job.key for job in jobs_of(paper, paper.claims.claim).values()]
    assert len(set(landings)) == len(landings)
    varied = [*jobs_of_series(paper).values(), *jobs_of_sensitivity(paper, "point9").values()]
    assert all(job.key for job in varied)


def test_each_set_runs_at_each_point_and_mass(paper):
    keys = jobs_of(paper, paper.claims.claim)
    for parameter_set in paper.landings.sets:
        for landing in (
            *(f"point{k}" for k in range(1, 11)),
            "midspan_100kg",
            "point9_10kg",
            "rig_level",
            "rig_inclined",
        ):
            assert (landing, parameter_set) in keys


def test_what_cannot_hold_has_its_proof_and_what_is_measured_its_reason(paper):
    for claim in paper.claims.claim:
        assert claim.cannot_hold is None or claim.cannot_hold.proof in PROOFS
        assert claim.parts or claim.undecidable or claim.reason


WRONG = {
    "measure": ('measure = "start"', 'measure = "strat"', "claim[3] (F4-slope).measure: no measure 'strat'; did you mean"),
    "landing": ('landings = ["point1"]', 'landings = ["point0"]', "no landing 'point0'; did you mean"),
    "proof": ('proof = "overshoot"', 'proof = "overshot"', "no proof 'overshot'; did you mean overshoot?"),
    "set": ('judged_by = "physical"', 'judged_by = "fysical"', "judged_by: no set 'fysical'; did you mean physical?"),
    "twice": ('id = "F12-zend"', 'id = "F12-z0"', "there is a claim of that id above; give it another id"),
    "part": ('parts = ["F14-order"', 'parts = ["F14-odrer"', "no claim 'F14-odrer'; did you mean F14-order?"),
    "key": ('what = "band of pitch over all points"', 'whta = "band"', "unknown key; did you mean what?"),
    "finding": ("{F18-peak}", "{F18-peek}", "findings: no claim 'F18-peek'; did you mean F18-peak?"),
    "number": ("paper = -1.45", "paper = nan", "must be a finite number"),
    "two ways": ('id = "F12-z0"', 'id = "F12-z0"\nformula = "wheels"', "give one of measure, formula, parts or undecidable"),
    "no reason": ('reason = "yes or no"', "", "a tolerance needs its reason"),
}  # fmt: skip


def changed(tmp_path: Path, old: str, new: str) -> Path:
    """A copy of the paper's study with one thing changed."""
    for name in ("claims.toml", "landings.toml"):
        text = (shipped() / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("old, new, message", WRONG.values(), ids=WRONG)
def test_a_wrong_row_is_refused_with_place_cause_and_cure(tmp_path: Path, old: str, new: str, message: str):
    with pytest.raises(InputError) as error:
        load_study(changed(tmp_path, old, new))
    assert message in str(error.value) and "claims.toml" in str(error.value)


def test_unknown_ids_and_files_end_with_status_2(tmp_path: Path):
    command = ["reproduce", "--quiet", "--out", tmp_path / "runs"]
    done = orchestrate(*command, "--only", "F19-rol,T2-z", folder=tmp_path)
    assert done.returncode == 2 and "no claim 'F19-rol'; did you mean F19-roll?" in done.stderr
    done = orchestrate(*command, "--study", tmp_path, folder=tmp_path)
    assert done.returncode == 2 and "claims.toml: cannot be read" in done.stderr.replace("landings", "claims")
    assert not list(tmp_path.iterdir())


# -- verdicts -------------------------------------------------------------------------------------------------


def book(tables: dict[str, dict[str, np.ndarray]], *claims: Claim) -> Book:
    """Signals by set as if they were those of runs of one landing."""
    sets = {name: ParameterSet(title=name) for name in tables}
    landings = Landings(sets=sets, landings={"here": Landing(title="here", scenario="landing_200m_point9")})
    documents = Documents(
        Path(), landings, Claims(title="t", judged_by=next(iter(tables)), reason="r", claim=list(claims))
    )
    runs = {}
    for name, table in tables.items():
        done = Done(Job("landing_200m_point9"), Path())
        done.__dict__["table"] = {"time": TIME, **table}
        done.__dict__["summary"] = {"estimated_error": {name: 1e-3 for name in table}}
        runs["here", name] = done
    return Book(documents, runs, {}, {})


def claim(name: str = "a", paper: float | list[float] = 1.0, **values) -> Claim:
    given = {"measure": "highest", "signal": "x", "landings": ["here"], "reason": "r", "tolerance": 0.1} | values
    return Claim(id=name, source="s", what="w", paper=paper, **{key: v for key, v in given.items() if v is not None})


BUMP = np.exp(-((TIME - 5.0) ** 2))


def verdict(one: Claim, *others: Claim, tables=None) -> tuple[str, str]:
    rows = rows_of(book(tables or {"base": {"x": BUMP}, "double": {"x": 2.0 * BUMP}}, *others, one), [*others, one])
    return rows[-1].verdict, rows[-1].why


def test_the_set_that_judges_decides_alone():
    assert verdict(claim(paper=1.05))[0] == "met"
    word, why = verdict(claim(paper=2.0))
    assert word == "not met" and "differs by -1" in why
    (row,) = rows_of(book({"base": {"x": BUMP}, "double": {"x": 2.0 * BUMP}}, claim(paper=2.0)), [claim(paper=2.0)])
    assert row.met_by == ["double"] and row.difference["double"] == pytest.approx(0.0, abs=1e-6)


def test_bands_ranges_units_and_senses():
    assert verdict(claim(paper=[0.0, 1.0], measure="band"))[0] == "met"
    assert verdict(claim(paper=57.3, unit="deg"))[0] == "met"
    assert verdict(claim(paper=0.5, sense="at least"))[0] == "met"
    assert verdict(claim(paper=0.5, sense="at most"))[0] == "not met"
    assert verdict(claim(paper=[1.0, 1.0], measure="band", landings=["here", "here"], take="range"))[0] == "not met"
    assert verdict(claim(paper=0.96, tolerance=0.0, relative=0.05))[0] == "met"
    assert verdict(claim(paper=1.0, landings=["here", "here"], take="where", tolerance=0.0))[0] == "met"


def test_parts_are_met_if_all_are():
    a, b = claim("a"), claim("b", paper=3.0)
    sum_of = claim("c", measure=None, signal=None, landings=[], parts=["a", "b"])
    assert verdict(sum_of, a, b) == ("not met", "a met, b not met")
    assert verdict(claim("c", measure=None, signal=None, landings=[], parts=["a"]), a)[0] == "met"


def test_what_is_undecidable_is_not_met_and_says_why():
    word, why = verdict(claim(measure=None, signal=None, landings=[], undecidable="no values are printed"))
    assert (word, why) == ("not met", "not decidable: no values are printed")


def test_a_run_that_failed_meets_nothing():
    found = book({"base": {"x": BUMP}}, claim())
    failed = Book(found.documents, {("here", "base"): Done(Job("landing_200m_point9"), None, "it crashed")}, {}, {})
    (row,) = rows_of(failed, [claim()])
    assert row.verdict == "not met" and "failed" in row.why and failed.failures() == ["here, base: it crashed"]


def test_a_symmetry_is_proved_by_the_runs_or_not_at_all():
    proof = {"proof": "symmetry", "because": "it is symmetric"}
    still = {"base": {"x": 1e-12 * BUMP}}
    assert verdict(claim(cannot_hold=proof), tables=still)[0] == "cannot hold"
    word, why = verdict(claim(cannot_hold=proof))
    assert word == "met" and "the proof fails" in why


def test_an_overshoot_beyond_twice_cannot_hold():
    start, end = claim("F12-z0", -1.45, measure="start"), claim("F12-zend", -1.8, measure="settled")
    proof = {"proof": "overshoot", "because": "a release at rest"}
    swing = {"base": {"x": -1.45 - 0.35 * (1.0 - np.exp(-0.3 * TIME) * np.cos(3.0 * TIME))}}
    word, why = verdict(claim("F12-zpeak", -3.3, cannot_hold=proof), start, end, tables=swing)
    assert word == "cannot hold" and "5.3 times" in why
    assert verdict(claim("F12-zpeak", -2.0, cannot_hold=proof), start, end, tables=swing)[0] == "not met"


def test_what_air_gives():
    assert still_air() == pytest.approx(0.0103, rel=0.01), "1 m/s, C_d 1, 18 mm, 0.91 kg/m"
    assert windy() == pytest.approx((0.121, 0.242), rel=0.01)


# -- page and pictures ----------------------------------------------------------------------------------------


def landed(job: Job, k: int) -> Done:
    """Signals that look like those of a landing, in the place of a run's."""
    fall = 1.0 - np.exp(-0.5 * TIME) * np.cos((3.0 + 0.1 * k) * TIME)
    table = {name: 0.0 * TIME for name in job.signals}
    table |= {
        "robot.body.position.z": -1.3 - 0.3 * fall,
        "robot.roll": 0.05 * (fall - 1.0),
        "contact1.radial_force": 370.0 * fall,
    }
    table |= {name: (1e4 + 10.0 * i) * (1.0 + 0.1 * fall) for i, name in enumerate(table) if "tension" in name}
    table |= {"cable.reaction_left.y": 0.0 * TIME - 1e4, "cable.reaction_left.z": 0.0 * TIME + 700.0}
    done = Done(job, Path())
    done.__dict__.update(table={"time": TIME, **table}, summary={"estimated_error": dict.fromkeys(table, 1e-5)})
    return done


@pytest.fixture(scope="module")
def whole(paper) -> Book:
    """The paper's study as if it had been run."""
    groups = jobs_of(paper, paper.claims.claim), jobs_of_series(paper), jobs_of_sensitivity(paper, "point9")
    return Book(paper, *({key: landed(job, k) for k, (key, job) in enumerate(jobs.items())} for jobs in groups))


def test_the_page_has_every_claim_figure_and_study(paper, whole, tmp_path: Path):
    pictures = draw(whole, tmp_path / "figures" / "reproduction")
    rows = rows_of(whole, paper.claims.claim)
    page = text(whole, rows, pictures, whole=True)
    assert {row.verdict for row in rows} == {"met", "not met", "cannot hold"}
    for claim in paper.claims.claim:
        assert f"| {claim.id} |" in page and f"- **{claim.id}**" in page
    named = set(re.findall(r"!\[[^]]*\]\(([^)]*)\)", page))
    assert named == {picture.path for picture in pictures} and len(named) >= 15
    assert all((tmp_path / name).stat().st_size < 100_000 for name in named)
    for title in ("Where the damping comes from", "Mesh and time step", "Set down or let go", "Sensitivity"):
        assert f"## {title}" in page
    assert "## In short" in page and "{F" not in page
    assert not re.search(r"\bnan\b", page) and "failed" not in page


def test_what_cannot_hold_by_symmetry_is_told_by_the_runs(paper, whole):
    rows = {row.claim.id: row for row in rows_of(whole, paper.claims.claim)}
    assert rows["F12-yaw"].verdict == rows["F13-pitch"].verdict == "cannot hold", "yaw and pitch are 0 in these tables"
    assert rows["F20-roll"].verdict == "not met", "roll is not, so that the proof fails"
    assert rows["F14"].verdict == "not met" and "F14-order met" in rows["F14"].why


# -- the command ----------------------------------------------------------------------------------------------

SMALL = """
signals = ["robot.body.position.z", "robot.roll"]
[sets.physical]
title = "physical"
set = { "cable.stiffness_set" = "physical" }
[sets.table1]
title = "table1"
set = { "cable.stiffness_set" = "table1" }
[landings.middle]
title = "midspan"
scenario = "landing_200m_midspan"
set = { "simulation.stop_time" = 0.2 }
"""
ROWS = """
title = "Two rows"
judged_by = "physical"
reason = "a test"
[[claim]]
id = "falls"
source = "gravity"
what = "it falls"
unit = "m"
paper = 0.0
sense = "at most"
measure = "peak"
signal = "robot.body.position.z"
landings = ["middle"]
reason = "a sign"
[[claim]]
id = "rolls"
source = "nobody"
what = "it rolls at midspan"
unit = "deg"
paper = 1.0
measure = "largest"
signal = "robot.roll"
landings = ["middle"]
tolerance = 0.1
reason = "none"
cannot_hold = { proof = "symmetry", because = "midspan is the middle" }
"""


def test_two_short_runs_from_files_to_page(tmp_path: Path):
    (tmp_path / "landings.toml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "claims.toml").write_text(ROWS, encoding="utf-8")
    ids = ["falls", "rolls"]
    done = reproduce(tmp_path, tmp_path / "runs", only=ids)
    assert done.exit_status == 0 and done.page == tmp_path / "runs" / "reproduction.md"
    rows = json.loads(done.page.with_suffix(".json").read_text(encoding="utf-8"))
    assert [(row["id"], row["verdict"]) for row in rows] == [("falls", "met"), ("rolls", "cannot hold")]
    assert rows[0]["ours"]["physical"] < rows[0]["ours"]["table1"] < 0.0, "the softer line gives more"
    assert rows[0]["used_for_fit"] is False and rows[0]["estimated_error"] < 1e-4
    page = done.page.read_text(encoding="utf-8")
    assert "**cannot hold**" in page and "midspan is the middle" in page
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("manifest.json")}
    reproduce(tmp_path, tmp_path / "runs", docs=tmp_path / "docs", only=ids)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("manifest.json")} == before and len(before) == 2
    assert (tmp_path / "docs" / "reproduction.json").is_file()
