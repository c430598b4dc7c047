"""The page in a real browser: it shows the run that it was made from, at any time, on any screen, and asks for nothing."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.coupling.run.results import read_json
from orchestrator.report.page import write, write_sweep
from orchestrator.report.page.template import DIST, is_built
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.files import write_comparison, write_run
from orchestrator.runs.result import Run
from tests.browser import Opened, launched, opened, wanting
from tests.made_up import TIME, compared_to, made_up, on_a_line, swept

VIEWS = ("landing", "side", "wheel", "span")
MOST_CALLS = 60
"""Draw calls of a frame: what a slow computer draws fluently."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if not is_built(DIST):
        wanting("the page was not built: make page")
    yield from launched()


@pytest.fixture(scope="module")
def run() -> Run:
    return on_a_line(2)


def page_of(folder: Path, run: Run) -> Path:
    write_run(RunDirectory(folder), run)
    return write(folder, read_json(folder / "manifest.json"))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, run: Run) -> Path:
    return page_of(tmp_path_factory.mktemp("page") / "run", run)


@pytest.fixture(scope="module")
def shown(browser: Any, file: Path) -> Iterator[Opened]:
    """The page of a run, which tests leave as they have found it but for time and view."""
    found = opened(browser, file)
    yield found
    assert found.complaints == [], "no test has made the page complain"
    assert found.asked == [f"{file.as_uri()}#paused"] or found.asked == [file.as_uri()], "it has asked for nothing else"


# -- a run --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", VIEWS)
def test_every_camera_draws_with_few_calls(shown: Opened, view: str):
    shown.js(f"__page.view({view!r})")
    shown.seek(1.0)
    calls = shown.js("__page.info().calls")
    assert 0 < calls <= MOST_CALLS and shown.js("__page.state().view") == view


def test_wheels_stand_where_the_table_has_them(shown: Opened, run: Run):
    shown.js("__page.view('landing')")
    for t in (0.0, 0.73, 1.3, 2.0):
        shown.seek(t)
        row = int(np.argmin(np.abs(run.time - t)))
        wheel = [run.table[f"robot.wheel[1].position.{axis}"][row] for axis in "xyz"]
        assert shown.js("__page.time") == pytest.approx(t)
        assert shown.js("__page.state().wheel") == pytest.approx(wheel, abs=20.0 * 2**-23), "as far as float32 goes"


def test_numbers_beside_the_picture_are_those_of_the_table(shown: Opened, run: Run):
    shown.seek(1.0)
    text = shown.page.locator(".hud").inner_text().replace("−", "-")
    row = int(np.argmin(np.abs(run.time - 1.0)))
    z, tension = run.table["robot.body.position.z"], run.table["cable.tension_mid"]
    assert f"{z[row] - z[0]:.3f} m" in text and f"{tension[row] / 1e3:.2f} kN" in text


def test_time_and_pixels_move(shown: Opened):
    shown.js("__page.view('landing')")
    shown.seek(0.0)
    before, frames = shown.pixels(), shown.js("__page.frames")
    shown.js("__page.play(true)")
    shown.until("__page.time > 0.3", "the replay has come to 0.3 s")
    shown.js("__page.play(false)")
    assert shown.js("__page.frames") > frames + 1 and shown.pixels() != before


def test_a_peak_is_shown_at_its_time(shown: Opened, run: Run):
    shown.seek(0.0)
    force = run.table["contact2.normal_force"]
    shown.page.locator("#peaks tr", has_text="contact force, wheel 2").locator("button").click()
    shown.drawn()
    assert shown.js("__page.time") == pytest.approx(run.time[np.argmax(force)], abs=1e-9)


def test_the_keyboard_does_all(shown: Opened):
    shown.seek(1.0)
    shown.js("document.activeElement.blur()")
    press = shown.page.keyboard.press
    press("ArrowRight")
    assert shown.js("__page.app.t") > 1.0
    press("End")
    assert shown.js("__page.app.t") == TIME[-1]
    press("Home")
    assert shown.js("__page.app.t") == 0.0
    press("3")
    assert shown.js("__page.state().view") == "wheel"
    press(" ")
    assert shown.js("__page.playing") is True
    press(" ")
    assert shown.js("__page.playing") is False
    press("1")


def test_what_is_drawn_is_told_in_words(shown: Opened):
    labels = shown.js("[...document.querySelectorAll('canvas[role=img]')].map(c => c.getAttribute('aria-label'))")
    assert len(labels) >= 2 and all(labels), labels
    controls = "[...document.querySelectorAll('button, input, select')]"
    named = "e => e.textContent.trim() || e.labels?.length || e.getAttribute('aria-label')"
    assert shown.js(f"{controls}.filter({named}).length") == shown.js(f"{controls}.length")


def brightness(shown: Opened) -> float:
    """Return how bright the background is, 0 to 1."""
    colour = shown.js("getComputedStyle(document.body).backgroundColor.match(/[\\d.]+/g).map(Number)")
    return sum(colour[:3]) / 765.0


def test_light_and_dark_by_the_system_and_by_choice(browser: Any, file: Path):
    dark = opened(browser, file, color_scheme="dark")
    assert brightness(dark) < 0.2
    dark.page.locator("#theme").click()
    dark.drawn()
    assert brightness(dark) > 0.8 and dark.complaints == []
    dark.page.context.close()


def test_it_fits_a_phone(browser: Any, file: Path):
    phone = opened(browser, file, viewport={"width": 390, "height": 844}, has_touch=True)
    assert phone.js("document.documentElement.scrollWidth") <= 390
    box = phone.page.locator("#stage").bounding_box()
    assert box is not None and box["width"] > 300 and phone.complaints == []
    phone.page.context.close()


def test_it_can_be_printed(browser: Any, file: Path):
    paper = opened(browser, file)
    paper.page.emulate_media(media="print")
    assert paper.page.locator("#parameters").is_visible() and not paper.page.locator("#theme").is_visible()
    document = paper.page.pdf(format="A4", print_background=True)
    assert document.startswith(b"%PDF") and len(document) > 50_000 and paper.complaints == []
    paper.page.context.close()


def test_without_webgl_the_rest_is_there(browser: Any, file: Path):
    flat = opened(browser, file, webgl=False)
    flat.seek(1.0)
    assert flat.js("__page.state()") is None and flat.page.locator(".no-gl").is_visible()
    before = flat.page.locator(".inset").screenshot()
    flat.seek(1.1)
    assert flat.page.locator(".inset").screenshot() != before, "the span from the side follows the time"
    assert flat.page.locator("#plots canvas").count() >= 4 and flat.complaints == []
    flat.page.context.close()


def test_without_scripts_all_numbers_are_there(browser: Any, file: Path):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.locator("#verdict").inner_text().endswith("Safe to land") and page.locator("#parameters").is_visible()
    assert page.locator(".tile").count() == 4 and page.locator("noscript").count() == 1
    context.close()


# -- other kinds ----------------------------------------------------------------------------------------------------


def shown_once(browser: Any, path: Path) -> Opened:
    """The page, held against what must be so of any: nothing complained of, nothing asked for."""
    found = opened(browser, path)
    assert found.complaints == [] and len(found.asked) == 1
    return found


def test_a_comparison_shows_the_difference_from_the_reference(browser: Any, tmp_path: Path, run: Run):
    folder = tmp_path / "all"
    write_comparison(RunDirectory(folder), compared_to(run, ["jacobi", "iqn_ils"]))
    found = shown_once(browser, write(folder, read_json(folder / "manifest.json")))
    found.page.get_by_role("button", name="Difference from the reference").click()
    found.seek(1.0)
    text = found.page.locator("#plots figcaption").first.inner_text()
    assert "1.00" in text and found.complaints == [], "a millimetre, by construction"
    found.page.context.close()


def test_a_graph_and_a_run_of_one_point(browser: Any, tmp_path: Path):
    graph = made_up({"time": TIME, "left.x": np.sin(TIME)}, tolerances={"left.x": 1e-3}, units={"left.x": "m"})
    for name, one, plots in (("graph", graph, True), ("point", cut(on_a_line(), 1), False)):
        found = shown_once(browser, page_of(tmp_path / name, one))
        assert found.page.locator("#plots").is_visible() is plots
        assert found.page.locator("#stage").is_visible() is (name == "point")
        found.page.context.close()


def cut(run: Run, n: int) -> Run:
    """A run that ended after `n` points, and says why."""
    fields = {name: values[:n] if len(values) == len(TIME) else values for name, values in run.fields.items()}
    manifest = {**run.manifest, "complete": False, "error": "the cable broke"}
    table = {name: values[:n] for name, values in run.table.items()}
    iterations = {name: values[: n - 1] for name, values in run.iterations.items()}
    return replace(run, table=table, iterations=iterations, fields=fields, manifest=manifest)


def test_a_run_that_ended_early_with_unequal_steps(browser: Any, tmp_path: Path):
    run = cut(on_a_line(3), 120)
    rows = np.unique(np.round(119 * (np.arange(50) / 49) ** 2).astype(int))
    table = {name: values[rows] for name, values in run.table.items()}
    found = shown_once(browser, page_of(tmp_path / "run", replace(run, table=table)))
    assert "the cable broke" in found.page.locator(".notice").first.inner_text()
    found.seek(0.5)
    row = int(np.searchsorted(table["time"], 0.5))
    assert found.js("__page.app.model.end") == table["time"][-1] and table["time"][row - 1] < 0.5
    z = np.interp(0.5, table["time"], table["robot.wheel[1].position.z"])
    assert found.js("__page.state().wheel[2]") == pytest.approx(z, abs=1e-4)
    found.page.context.close()


def test_a_click_on_the_map_opens_the_landing(browser: Any, tmp_path: Path):
    folder = swept(tmp_path / "sweep")
    found = shown_once(browser, write_sweep(folder))
    assert found.js("__page.map.cells.length") == 4 and not found.page.locator("#stage").is_visible()
    found.page.locator("#map .cell").nth(3).click()
    found.until("__page.app.model !== __page.app.original", "the landing is shown")
    found.seek(1.0)
    assert found.page.locator("#stage").is_visible() and "Not safe" in found.page.locator("#verdict").inner_text()
    summary = json.loads((folder / "runs" / "run4" / "summary.json").read_text())
    assert found.js("__page.app.model.head.limits.roll.share") == pytest.approx(summary["limits"]["roll"]["share"])
    assert found.js("__page.state().robot[1]") == pytest.approx(60.0, abs=1e-5)
    assert found.page.locator(".tile b").first.inner_text() == "3", "how many are safe stays as it is"
    found.page.locator("#map .cell").nth(2).click()
    found.until("document.querySelector('.map-said').textContent.includes('not kept')", "it says why nothing is shown")
    assert found.complaints == []
    found.page.context.close()
