"""Pictures and tables: what is drawn and printed of a run that is made up here, and known."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.legend import Legend

from orchestrator.cli.printing import print_table
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.compare import signal_errors
from orchestrator.coupling.run.results import read_json
from orchestrator.report import accuracy, plots, style
from orchestrator.report.drawing import draw, legend
from orchestrator.report.page import report, write
from orchestrator.report.signals import extremes, flight, in_the_air, panels_for, shown, words
from orchestrator.runs.compare import Comparison, Reference, RunErrors
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.files import write_comparison, write_run, write_unfinished
from orchestrator.runs.result import Run
from tests.made_up import TIME, S, Z, kinked_shape, landing, made_up

NOT_BUILT = Path(__file__).parent / "nothing"
"""Where no interactive page was built: the pictures stand in the page."""


def held_together(masters: list[str], macro_steps: list[float]) -> Comparison:
    """Runs whose errors fall with the fourth power of the macro step, a factor of ten from master to master."""
    reference = Reference("made up", landing(), 1.0, {"robot.body.position.z": 1e-12, "robot.roll": 1e-12})
    results, runs = [], []
    for i, master in enumerate(masters):
        for step in macro_steps:
            table = landing(shift=10.0 ** (i - 6) * (step / 0.01) ** 4)
            results.append(made_up(table, master, step))
            errors = signal_errors(table, reference.table)
            runs.append(RunErrors(master, step, 200, 3.0, 0, int(1 / step), 1.0 + i + step, errors))
    return Comparison(reference, runs, {"robot.body.position.z": 1e-4}, results)


def lines(figure: Figure, axis: int = 0) -> list[np.ndarray]:
    """The points of the lines of one of the figure's axes that are not legends' or markers'."""
    return [np.asarray(line.get_ydata(), float) for line in figure.axes[axis].lines]


def legends(figure: Figure) -> list[Legend]:
    """All legends of a figure."""
    return [*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend() is not None)]


def require_inside(figure: Figure) -> None:
    """Every legend must be within the picture; one that is not above or beside the axes within those."""
    for found in legends(figure):
        box = found.get_window_extent()
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, [text.get_text() for text in found.get_texts()]
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1


# -- signals over time ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_wheels", [1, 2, 3, 4])
def test_the_overview_shows_all_wheels_and_angles(tmp_path: Path, n_wheels: int):
    table = landing(n_wheels)
    figure = plots.overview(tmp_path / "a.png", table, None, panels_for(table), flight(table))
    assert [len(lines(figure, k)) for k in range(4)] == [1, 3, n_wheels, 1]
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "Z displacement [m]", "Angle [°]", "Sum of wall forces [N]", "Cable tension [kN]",
    ]  # fmt: skip
    assert lines(figure)[0] == pytest.approx(Z - Z[0], abs=1e-15)
    assert lines(figure, 2)[-1].max() == 400.0 + n_wheels
    names = [text.get_text() for text in figure.axes[2].get_legend().get_texts()]
    assert names == [f"wheel {k + 1}" for k in range(n_wheels if n_wheels > 1 else 0)] + ["in the air, 0.29 s"]
    require_inside(figure)
    assert imread(tmp_path / "a.png").shape[2] == 4 and not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("n_wheels", [1, 3, 4, 8])
def test_a_legend_in_the_axes_hides_no_curve(tmp_path: Path, n_wheels: int):
    table = landing(n_wheels)
    figure = plots.overview(tmp_path / "a.png", table, None, panels_for(table), flight(table))
    figure.draw_without_rendering()  # at the figure's own resolution, as the places of the axes are
    for axis in (figure.axes[1], figure.axes[2]):
        box = axis.get_legend().get_window_extent()
        assert axis.bbox.x0 <= box.x0 and box.x1 <= axis.bbox.x1 and box.y1 <= axis.bbox.y1
        tops = [axis.transData.transform((0.0, np.max(line.get_ydata())))[1] for line in axis.lines]
        assert max(tops) < box.y0


def test_reference_and_difference_stand_in_one_figure(tmp_path: Path):
    run, reference = landing(2, shift=1e-3), landing(2)
    figure = plots.overview(tmp_path / "a.png", run, reference, panels_for(run))
    assert len(figure.axes) == 8 and len(lines(figure, 0)) == 2
    difference = lines(figure, 1)[0]
    assert difference == pytest.approx(np.full(difference.size, 1e-3), rel=1e-9)
    assert np.all(np.isnan(lines(figure, 3)[0])), "equal angles have no difference to be drawn"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["Reference", "Coupled"]
    require_inside(figure)


def test_signals_of_a_general_graph_have_their_own_units(tmp_path: Path):
    names = ("left.x", "right.x", "motor.current", "motor.mode", "left.x_mean")
    table = {"time": TIME, **{name: np.sin(TIME + k) for k, name in enumerate(names)}}
    units = {"left.x": "m", "right.x": "m", "motor.current": "A", "motor.mode": "1"}
    panels = panels_for(table, ["motor.current"], units)
    assert [panel.axis for panel in panels] == ["motor.current [A]", "x [m]", "motor.mode [–]"]
    assert dict(panels[1].lines) == {"left.x": "left", "right.x": "right"}
    figure = plots.overview(tmp_path / "a.png", table, None, panels)
    assert [len(lines(figure, k)) for k in range(3)] == [1, 2, 1]


def test_of_many_signals_the_chosen_come_first():
    table = {"time": TIME, **{f"a.x{k}": TIME for k in range(20)}}
    panels = panels_for(table, ["a.x17"])
    assert len(panels) == 6 and list(panels[0].lines) == ["a.x17"]


def test_a_signal_that_does_not_move_has_an_axis_that_says_so(tmp_path: Path):
    table = landing() | {"cable.tension_mid": 22000.0 + 1e-9 * TIME, "robot.roll": np.full(201, 1e-30)}
    figure = plots.overview(tmp_path / "a.png", table, None, panels_for(table))
    low, high = figure.axes[3].get_ylim()
    assert 0.5 * (low + high) == pytest.approx(22.0) and high - low == pytest.approx(22e-4)
    assert not np.any(lines(figure, 1)[0])


# -- several runs ---------------------------------------------------------------------------------------------


def test_24_lines_are_told_apart():
    styles = [style.line_style(i, 24) for i in range(24)]
    assert len({(s["color"], str(s["linestyle"]), s["marker"]) for s in styles}) == 24
    assert len({(s["color"], str(s["linestyle"])) for s in styles}) == 24, "by lines alone as well"


@pytest.mark.parametrize("n", [1, 8, 27])
def test_errors_of_all_runs_with_all_their_names(tmp_path: Path, n: int):
    runs = {f"interface_jacobian, {k + 1} ms": landing(shift=10.0 ** (-k % 9)) for k in range(n)}
    figure = plots.errors(tmp_path / "a.png", runs, landing(), panels_for(landing()))
    assert [len(axis.lines) for axis in figure.axes] == [n] * 4
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(runs)
    require_inside(figure)
    for line, shift in zip(lines(figure), runs, strict=True):
        expected = runs[shift]["robot.body.position.z"][0] - 3.0
        assert line == pytest.approx(np.full(line.size, expected), rel=1e-6)


def test_a_signal_without_an_error_is_drawn_as_nothing(tmp_path: Path):
    reference = landing()
    runs = {"exact": landing(), "exact too": landing()}
    plots.errors(tmp_path / "errors.png", runs, reference, panels_for(reference))
    assert (tmp_path / "errors.png").is_file()


def test_iterations_of_all_runs(tmp_path: Path):
    tables = {f"iqn_ils, {k} ms": made_up(landing()).iterations for k in range(8)}
    figure = plots.iterations(tmp_path / "a.png", tables)
    assert len(figure.axes[0].lines) == 16, "a curve and the crosses of the unconverged steps each"
    assert np.asarray(figure.axes[0].lines[1].get_xdata()) == pytest.approx([TIME[8]])
    require_inside(figure)


def test_convergence_and_work_precision(tmp_path: Path):
    masters = [f"master_{k}" for k in range(8)]
    comparison = held_together(masters, [0.02, 0.01, 0.005])
    figure = accuracy.convergence(tmp_path / "a.png", comparison)
    assert len(figure.axes[0].lines) == 8 + 1 and "Z displacement" in figure.axes[0].get_ylabel()
    slopes, names = (found.get_texts() for found in (figure.axes[0].get_legend(), figure.legends[0]))
    assert [text.get_text() for text in slopes] == ["4.0"] * 8
    assert [text.get_text() for text in names] == masters
    require_inside(figure)
    figure = accuracy.work_precision(tmp_path / "b.png", comparison)
    assert [len(axis.lines) for axis in figure.axes] == [8, 8]
    require_inside(figure)


# -- shapes ---------------------------------------------------------------------------------------------------


def test_shapes_are_smooth_and_exact_at_the_points(tmp_path: Path):
    fields = kinked_shape()
    figure = plots.shapes(tmp_path / "a.png", fields, landing())
    curves = [line for line in figure.axes[0].lines if line.get_marker() == "None"]
    changes = lines(figure, 1)
    assert len(curves) == len(changes) >= 4
    for curve in curves:
        z = np.asarray(curve.get_ydata(), float)
        assert z.size == 12 * 40 + 1 and np.all(np.isfinite(z))
        off = np.abs(fields["position"][:, :, 2] - z[::12]).max(axis=1)
        assert np.min(off) <= 1e-14, "exact at the points, but for the rounding of a parabola 2 m high"
    for change in changes:  # no swing beside the kink: what lies between points lies between their values, but for 3 %
        at, scale = change[::12], np.ptp(change)
        low, high = np.minimum(at[1:], at[:-1]), np.maximum(at[1:], at[:-1])
        inner = change[:-1].reshape(40, 12)
        assert np.all(inner >= low[:, None] - 0.03 * scale) and np.all(inner <= high[:, None] + 0.03 * scale)
    require_inside(figure)


def test_a_smooth_curve_has_a_continuous_slope():
    """Of a parabola the curve is the parabola; the slope jumps by no more than the chords of a circle of its curvature."""
    (curve,) = plots.smooth(S, [S**2])
    fine = np.linspace(0.0, 200.0, curve.size)
    assert curve == pytest.approx(fine**2, rel=1e-12)
    (wave,) = plots.smooth(S, [np.sin(S / 20.0)])
    slope = np.diff(wave) / np.diff(fine)
    assert np.max(np.abs(np.diff(slope))) < 3.0 * np.max(np.diff(fine)) / 20.0**2


# -- tables ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "unit", "expected"),
    [
        ([1e-30, -1.6e-30], "rad", [0.0, 0.0]),
        ([1e-30, 2e-30], "A", [1e-30, 2e-30]),  # of a foreign unit nobody knows what is small
        ([1e-13, 5.0], "A", [0.0, 5.0]),
        ([1e-13, np.inf], "A", [1e-13, np.inf]),
        ([4e-10, 1e-3], "N", [0.0, 1e-3]),
        ([2e-9, 1e-3], "N", [2e-9, 1e-3]),
        ([2e-6, -0.4], "m", [2e-6, -0.4]),
    ],
)
def test_noise_is_shown_as_zero(values: list[float], unit: str, expected: list[float]):
    assert shown(np.array(values), unit).tolist() == expected


def test_extremes_of_all_wheels_without_noise():
    table = landing(2) | {"robot.roll": np.full(201, -1.6e-30)}
    rows = {row[0]: row[1:] for row in extremes(table)}
    assert rows["robot.roll"] == ("deg", "0", "0", "0", "0")
    assert {"robot.pitch", "robot.yaw", "contact1.normal_force", "contact2.normal_force"} <= set(rows)
    assert rows["contact2.normal_force"] == ("N", "0", "0", "402", "402")
    assert rows["cable.tension_mid"][:2] == ("kN", "22")


def test_no_line_of_a_table_ends_in_blanks(capsys: pytest.CaptureFixture[str]):
    print_table(("signal", "unit", "note"), [("a", "m", ""), ("longer", "", "x"), ("b", "kN", "pass ")])
    assert capsys.readouterr().out.splitlines() == [
        "signal  unit  note",
        "a       m",
        "longer        x",
        "b       kN    pass",
    ]


def test_time_in_the_air():
    """In the air from 1.2 to 1.5 s after the first touch at 0.5 s: the middle of the macro steps in which it changes."""
    table = landing(2)
    table["contact2.status"] = np.where(TIME > 1.0, table["contact2.status"], 0.0)  # touches later than the first
    found = flight(table)
    assert found is not None and found.total == pytest.approx(0.29, abs=0.011)
    assert found.of_wheels["contact1"] == found.of_wheels["contact2"] == pytest.approx(found.total)
    ((start, end),) = found.spans
    assert (start, end) == pytest.approx((1.205, 1.495)) and end - start == pytest.approx(found.total)
    assert list(in_the_air(table)) == ["0.29 s since the first touch (contact1 open 0.29 s, contact2 open 0.29 s)"]


def test_a_robot_that_never_touches_is_not_said_to_fly():
    table = landing()
    assert flight(table | {"contact1.status": np.zeros(201)}) is None and flight({"time": TIME}) is None


def test_inputs_that_vary_have_a_panel():
    """One that keeps its value says nothing: its panel would be a line."""
    ramp, held = np.linspace(300.0, 0.0, TIME.size), np.full(TIME.size, 2.0)
    added = {"robot.thrust": ramp, "robot.torque.x": held, "robot.wheel[2].drive_torque": 0.1 * ramp}
    shown = panels_for(landing(2) | added)[4:]
    assert [(p.axis, list(p.lines)) for p in shown] == [
        ("Thrust [N]", ["robot.thrust"]),
        ("Drive torque [N m]", ["robot.wheel[2].drive_torque"]),
    ]
    assert words("robot.thrust") == "Thrust" and words("robot.torque.x") == "Torque"


def test_signals_by_words():
    assert words("robot.roll") == "Roll" and words("cable.tension_mid") == "Cable tension" and words("a.b") == "a.b"


# -- from a directory alone -----------------------------------------------------------------------------------


def written(path: Path, run: Run) -> Path:
    write_run(RunDirectory(path), run)
    return path


def page_of(folder: Path) -> str:
    """The page with the pictures that are there; `report` would draw them once more."""
    return write(folder, read_json(folder / "manifest.json"), NOT_BUILT).read_text(encoding="utf-8")


def test_a_run_is_drawn_from_its_directory(tmp_path: Path):
    run = replace(made_up(landing(2)), fields=kinked_shape())
    folder = written(tmp_path / "run", run)
    pictures = draw(folder)
    assert [path.name for path in pictures] == ["overview.png", "iterations.png", "shapes.png"]
    assert all(path.is_file() and path.parent == folder / "plots" for path in pictures)
    page = report(folder, NOT_BUILT).read_text(encoding="utf-8")
    assert "Made up &lt;here&gt;" in page and page.count("<img") == 3 and "contact2.normal_force" in page


@pytest.mark.usefixtures("coarse_pictures")
def test_a_comparison_is_drawn_with_its_runs(tmp_path: Path):
    comparison = held_together(["jacobi", "iqn_ils"], [0.02, 0.01])
    write_comparison(RunDirectory(tmp_path / "all"), comparison)
    folders = {path.parent.relative_to(tmp_path / "all").as_posix() for path in draw(tmp_path / "all")}
    assert folders == {"plots", *(f"{run.label}/plots" for run in comparison.results)}
    page = page_of(tmp_path / "all")
    assert page.count("<img") == 4 * 2 + 5 and "iqn_ils_0.01s/plots/overview" in page


@pytest.mark.usefixtures("coarse_pictures")
def test_runs_of_a_comparison_that_was_not_finished_are_drawn(tmp_path: Path):
    write_unfinished(RunDirectory(tmp_path / "all"), [made_up(landing(), name) for name in ("a", "b")], "no reference")
    assert {path.parent.parent.name for path in draw(tmp_path / "all")} == {"a_0.01s", "b_0.01s"}
    assert "no reference" in page_of(tmp_path / "all")


def test_a_run_of_one_point_has_a_page_without_pictures(tmp_path: Path):
    table = {name: values[:1] for name, values in landing().items()}
    folder = written(tmp_path / "run", made_up(table))
    assert draw(folder) == [] and report(folder).is_file()


@pytest.mark.usefixtures("coarse_pictures")
def test_a_run_of_two_points_and_one_that_diverged_are_drawn(tmp_path: Path):
    short = {name: values[:2] for name, values in landing().items()}
    wild = landing() | {"robot.body.position.z": 10.0 ** np.linspace(0.0, 300.0, 201)}
    for name, table in {"short": short, "wild": wild}.items():
        assert len(draw(written(tmp_path / name, made_up(table)))) == 2


def spoil(folder: Path, kind: str) -> None:
    if kind == "no summary":
        (folder / "summary.json").unlink()
    elif kind == "half a table":
        path = folder / "results.csv"
        path.write_text(path.read_text()[:5000])
    elif kind == "no key":
        (folder / "summary.json").write_text(json.dumps({"scenario": "a"}))
    elif kind == "no HDF5":
        (folder / "fields.h5").write_text("text")
    elif kind == "no manifest":
        (folder / "manifest.json").unlink()
    else:
        shutil.rmtree(folder)


@pytest.mark.parametrize("kind", ["no summary", "half a table", "no key", "no HDF5", "no manifest", "no folder"])
def test_a_damaged_directory_ends_in_a_message(tmp_path: Path, kind: str):
    folder = written(tmp_path / "run", replace(made_up(landing()), fields=kinked_shape()))
    spoil(folder, kind)
    with pytest.raises(InputError, match="run"):
        report(folder)


def test_runs_are_named_for_people():
    assert legend(made_up(landing(), "iqn_ils", 0.0025)) == "iqn_ils, 2.5 ms"
