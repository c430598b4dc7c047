"""The benchmark pack: references, the norm, our rows, what is written for others, the page."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from scipy.integrate import solve_ivp

import orchestrator
from benchmarks.pack import __main__ as program
from benchmarks.pack import contest, figures, package, results, table
from benchmarks.pack.bumper.module import Bumper
from benchmarks.pack.case import Reference
from benchmarks.pack.cases import CASES
from benchmarks.pack.engines import others, ours
from benchmarks.pack.engines.run import Run
from benchmarks.pack.norm import errors
from benchmarks.pack.solutions import linear_system
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.compare import observed_order
from orchestrator.scenario.ssp.schema import SCHEMAS

SMALL = ("oscillator_soft", "oscillator_stiff", "oscillator_impact", "chain")
SOFT = CASES["oscillator_soft"]


# -- references ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SMALL, *(pytest.param(n, marks=pytest.mark.slow) for n in CASES if n not in SMALL)])
def test_a_reference_is_made_again(name):
    """Within twice its own error: that of the kept one, and of the new one."""
    case = CASES[name]
    kept, again = case.reference(), case.solved()
    assert kept.method == again.method
    for signal in case.signals:
        assert np.max(np.abs(kept.table[signal] - again.table[signal])) <= 2.0 * kept.error[signal]


@pytest.mark.parametrize("name", CASES)
def test_a_reference_is_better_than_the_best_row_wants(name):
    """A thousandth of a signal's range would hide errors; all are below 1e-7, and have the points of their case."""
    case = CASES[name]
    reference = case.reference()
    np.testing.assert_allclose(reference.table["time"], case.times, atol=1e-12)
    assert set(reference.table) == {"time", *case.signals}
    assert all(0.0 < error < 1e-7 for error in reference.relative_error().values())


def test_the_closed_form_is_that_of_the_equations_written_by_hand():
    """m x'' = -k x - d x' -+ k_c (x1 - x2) -+ d_c (v1 - v2), integrated."""
    _, A, start = linear_system(SOFT)

    def rate(_, y):
        spring = 10.0 * (y[1] - y[0]) + 0.1 * (y[3] - y[2])
        own = -10.0 * y[:2] - 0.1 * y[2:]
        return [y[2], y[3], own[0] + spring, 0.5 * (own[1] - spring)]

    found = solve_ivp(rate, (0.0, 2.0), [1.0, 0.0, 0.0, 0.0], "DOP853", t_eval=SOFT.times, rtol=1e-12, atol=1e-14)
    reference = SOFT.reference().table
    assert start.tolist() == [1.0, 0.0, 0.0, 0.0] and A.shape == (4, 4)
    for row, signal in zip(found.y, SOFT.signals, strict=False):
        np.testing.assert_allclose(row, reference[signal], atol=1e-10)


def test_the_impact_is_that_of_another_method_that_knows_no_events():
    """Radau, written by hand, steps over touch and parting; its error is taken from a wider tolerance."""

    def rate(_, y):
        depth = max(y[0] - y[1], 0.0)
        force = max(1e6 * depth**1.5 * (1.0 + 0.2 * (y[2] - y[3])), 0.0)
        return [y[2], y[3], -10.0 * y[0] - force, 0.5 * (-200.0 * y[1] + force)]

    case = CASES["oscillator_impact"]
    start = [-0.1, 0.0, 1.0, 0.0]
    wide, fine = (
        solve_ivp(rate, (0.0, 1.0), start, "Radau", t_eval=case.times, rtol=tol, atol=tol, max_step=4e-3).y[:2]
        for tol in (1e-6, 1e-8)
    )
    kept = np.array([case.reference().table[s] for s in case.signals])
    assert np.min(kept[1] - kept[0]) < 0.0  # they meet
    error = np.max(np.abs(wide - fine))
    assert error < 1e-5
    assert np.max(np.abs(kept - fine)) < error


# -- the bumper ---------------------------------------------------------------------------------------------------


def bumper(exchange: str, **inputs: float) -> Bumper:
    one = Bumper()
    one.table.assign(one.values, {"stiffness": 1e4, "exponent": 1.5, "damping": 0.0, "exchange": exchange, **inputs})
    one.initialize(0.0)
    return one


def test_the_waveform_of_the_bumper_is_exact_for_a_touch_inside_the_step():
    """delta = v (t - h/2): the force grows as the 3/2th power from the middle on; mean and slope in closed form."""
    h, v, k = 0.01, 2.0, 1e4
    one = bumper("waveform", **{"left.position": -0.5 * v * h})
    one.table.assign(one.values, {"left.position": 0.5 * v * h, "left.position_mean": 0.0, "left.velocity": v})
    one.step(0.0, h)
    half = 0.5 * h
    mean = k * v**1.5 * half**2.5 / 2.5 / h
    moment = k * v**1.5 * half**3.5 / 3.5  # of the force about the middle, integrated over time
    assert one["right.force"] == pytest.approx(mean, rel=2e-5)  # eight Gauss points on a 3/2th power
    assert one["right.force_rate"] == pytest.approx(12.0 / h**3 * moment, rel=2e-5)
    assert one["left.force"] == -one["right.force"]


def test_the_bumper_pushes_only_and_only_where_it_touches():
    assert bumper("point", **{"left.position": -1e-3})["right.force"] == 0.0
    assert bumper("point", **{"left.position": 1e-2})["right.force"] == pytest.approx(10.0)
    parting = bumper("point", **{"left.position": 1e-2, "left.velocity": -100.0, "damping": 0.5})
    assert parting["right.force"] == 0.0


# -- the norm -----------------------------------------------------------------------------------------------------


def made_up(error: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """A result twice as fine as the reference, which is wrong at one of the reference's points, and wildly between them."""
    t = np.arange(5) * 0.1
    fine = np.arange(9) * 0.05
    y = 3.0 * fine
    y[1::2] += 100.0
    y[4] += error
    return {"time": fine, "y": y}, {"time": t, "y": 3.0 * t}


def test_the_error_is_the_largest_at_the_points_of_the_reference_over_its_range():
    result, reference = made_up(-0.03)
    assert errors(result, reference) == {"y": pytest.approx(0.03 / 1.2)}


def test_a_result_without_a_point_or_a_signal_is_a_clear_error():
    result, reference = made_up(0.0)
    with pytest.raises(InputError, match=r"no row at t = 0.3 s; it needs one every 0.1 s until 0.4 s"):
        errors({name: values[:5] for name, values in result.items()}, reference)
    with pytest.raises(InputError, match="no column y; did you mean yy"):
        errors({"time": result["time"], "yy": result["y"]}, reference)
    with pytest.raises(InputError, match="no rows"):
        errors({"time": np.zeros(0), "y": np.zeros(0)}, reference)


# -- runs ---------------------------------------------------------------------------------------------------------


def test_our_rows_have_the_order_of_the_exchange():
    reference = SOFT.reference().until(SOFT.quick)
    rows = [contest.row(ours.run(SOFT, "iqn_ils", H, SOFT.quick), reference, SOFT.quick) for H in (0.04, 0.02)]
    for signal in SOFT.signals:
        order = observed_order((0.04, 0.02), [one["error"][signal] for one in rows])
        assert order == pytest.approx(4.0, abs=0.2)
    assert all(one["unconverged"] == 0 and 1.0 <= one["solves"] < 6.0 for one in rows)
    assert contest.orders(rows)["ours", "iqn_ils"] == {s: pytest.approx(4.0, abs=0.2) for s in SOFT.signals}


def test_a_run_that_is_all_wrong_is_a_reason_and_no_number():
    reference = SOFT.reference()
    wild = {"time": SOFT.times} | {s: reference.table[s] * np.nan for s in SOFT.signals}
    assert "unstable" in contest.row(Run("ours", "jacobi", 0.01, wild), reference, 2.0)["why"]
    assert contest.row(Run("fmpy", "explicit", 0.01, {}, why="crashed"), reference, 2.0)["why"] == "crashed"


def test_an_engine_that_is_not_installed_is_rows_with_the_reason(monkeypatch):
    monkeypatch.setattr(others, "unavailable", lambda library: f"{library} is not installed")
    rows = list(contest.contested(SOFT, ["libcosim", "ecos"], contest.Extent()))
    assert len(rows) == 2 * len(SOFT.others)
    assert {one["why"] for one in rows} == {"libcosimpy is not installed", "ecospy is not installed"}


def test_an_engine_that_dies_loses_the_run_it_died_in(monkeypatch):
    """The first comes to its end, the second kills the process, the third runs in a new one."""
    good = {"cpu": 1.0, "rows": [[0.0, 0.0]] * (len(SOFT.times) - 1)}
    ends = iter([([good], "Segmentation fault"), ([good], "")])
    monkeypatch.setattr(others, "_driven", lambda *_: next(ends))
    found = list(others.runs("ecos", Path(), SOFT, (0.01, 0.005, 0.0025), SOFT.stop))
    assert [one.why for one in found] == ["", "Segmentation fault", ""]
    assert [one.macro_step for one in found] == [0.01, 0.005, 0.0025]


def test_a_part_that_is_run_again_replaces_that_part_alone():
    old = [{"engine": name, "master": "m", "macro_step": 1.0} for name in ("ours", "ecos")]
    found = results.merged({}, SOFT, ["ours", "ecos"], old)
    again = results.merged(found, SOFT, ["ours"], [{"engine": "ours", "master": "n", "macro_step": 2.0}])
    assert [(one["engine"], one["master"]) for one in again[SOFT.name]["rows"]] == [("ours", "n"), ("ecos", "m")]


# -- what is written for others -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return package.written(SOFT, tmp_path_factory.mktemp("pack"))


def test_what_is_written_for_others_is_whole(folder):
    for kind in package.EXCHANGES:
        with zipfile.ZipFile(folder / f"{kind}.ssp") as archive:
            root = etree.fromstring(archive.read("SystemStructure.ssd"))
            fmus = {name for name in archive.namelist() if name.endswith(".fmu")}
        etree.XMLSchema(etree.parse(str(SCHEMAS / "SystemStructureDescription.xsd"))).assertValid(root)
        assert fmus == {"resources/left.fmu", "resources/right.fmu"}
        assert (folder / kind / "OspSystemStructure.xml").exists()
    about, page = json.loads((folder / package.ABOUT).read_text()), (folder / "README.md").read_text()
    assert about["values"]["iterative"]["right"]["exchange"] == "waveform"
    assert about["values"]["explicit"]["right"]["coupling_stiffness"] == 10.0
    assert all(f"`{signal}`" in page for signal in SOFT.signals)


def test_what_is_written_runs_elsewhere_and_is_scored(folder, tmp_path):
    """The iterative structure, run from its archive, has the error of the case's own row."""
    found = orchestrator.run(folder / "iterative.ssp", master="iqn_ils", macro_step=0.02, estimate="none")
    rows = np.array([found.time, *(found[s].values for s in SOFT.signals)]).T
    head = ",".join(f'"{name}"' for name in ("time", *SOFT.signals))
    np.savetxt(tmp_path / "result.csv", rows, delimiter=",", header=head, comments="", fmt="%.17g")
    own = errors(ours.run(SOFT, "iqn_ils", 0.02, SOFT.stop).table, SOFT.reference().table)
    for signal, error, reference in package.scored(folder, tmp_path / "result.csv"):
        assert error == pytest.approx(own[signal], rel=0.02)  # the tolerance of the iteration is another one
        assert reference < 1e-3 * error


def test_the_reference_that_is_written_scores_nothing(folder):
    assert [error for _, error, _ in package.scored(folder, folder / "reference.csv")] == [0.0, 0.0]
    assert Reference.read(folder, "reference").error == SOFT.reference().error


def test_nothing_is_written_over(folder):
    with pytest.raises(InputError, match="is there already"):
        package.written(SOFT, folder.parent)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--case", "oscilator_soft"], "no case 'oscilator_soft'; did you mean oscillator_soft?"),
        (["--engine", "libcosin"], "no engine 'libcosin'; did you mean libcosim?"),
        (["score", "nowhere", "result.csv"], "nowhere: has no reference.csv"),
    ],
)
def test_wrong_input_is_one_line(words, said, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["pack", *words])
    with pytest.raises(SystemExit) as end:
        program.main()
    assert end.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0]


# -- the page -----------------------------------------------------------------------------------------------------


def test_the_page_is_that_of_the_file():
    found, text = results.read(), table.PAGE.read_text(encoding="utf-8")
    assert table.filled(text, found) == text, "python -m benchmarks.pack fill"
    assert list(found) == [name for _, name, _ in table.BLOCK.findall(text)] == list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_every_case_has_all_engines_a_picture_and_its_reference(name):
    part, case = results.read()[name], CASES[name]
    assert {one["engine"] for one in part["rows"]} == set(contest.TITLES)
    assert part["reference"]["error"] == pytest.approx(case.reference().relative_error())
    assert (figures.FOLDER / f"{name}.png").exists()
