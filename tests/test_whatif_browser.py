"""The what-if of a page in a real browser: a slider moved, a landing chosen, a failure said, and the way back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orchestrator
from orchestrator.report.page.template import DIST, is_built
from tests.browser import Opened, launched, opened, wanting
from tests.what_if import FLAGSHIP, exact, share, wished

STOP = 1.0
SIGNALS = ("robot.body.position.z", "robot.roll", "contact1.normal_force")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, module: Path, coarse_pictures: None) -> Path:
    """The page of a run; of 10 s by its steps, so that it has other starts, too."""
    assert module.is_file()
    if not is_built(DIST):
        wanting("the page was not built: make page")
    place = tmp_path_factory.mktemp("whatif") / "run"
    orchestrator.run(FLAGSHIP, stop=STOP, macro_step=0.001, estimate="none", out=place)
    return place / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    yield from launched()


@pytest.fixture
def shown(browser: Any, page: Path) -> Iterator[Opened]:
    """The page as it stands, in a context of its own."""
    found = opened(browser, page)
    yield found
    assert found.complaints == []
    assert all(url.startswith(("file:", "blob:")) for url in found.asked)
    found.page.context.close()


def solved(page: Opened) -> dict[str, Any]:
    """The what-if once it is solved."""
    page.until("!__page.whatif.state().said.startsWith('solving')", "the landing is solved")
    page.drawn()
    return page.js("__page.whatif.state()")


def signal(page: Opened, name: str) -> np.ndarray:
    return np.array(page.js(f"Array.from(__page.app.model.get({name!r}))"))


def text(page: Opened, place: str) -> str:
    return page.page.locator(place).first.inner_text()


def test_a_slider_equals_a_run(shown: Opened):
    """Moved by the keyboard; plots, tiles and verdict follow, and say what they are."""
    before = text(shown, '[data-tile="force"]')
    slider = shown.page.locator('#whatif input[aria-label^="Mass"]')
    slider.focus()
    for _ in range(3):
        slider.press("PageUp")
    state = solved(shown)
    mass = state["wishes"]["mass"]
    assert mass == pytest.approx(38.0 + 30 * 0.5)
    _, heavier = wished(FLAGSHIP, None, {"mass": ("robot.parameters.mass", mass)}, "simulation.macro_step=0.001")
    wanted = exact(heavier, signal(shown, "time"))
    for name in SIGNALS:
        assert share(signal(shown, name), wanted.signals[name]) <= 1e-9, name
    assert "monolithic solver" in state["said"] and "1e−6 m" in state["said"]
    assert f"--set robot.parameters.mass={mass:g}" in state["said"]
    assert text(shown, ".verdict").startswith("What if") and text(shown, '[data-tile="force"]') != before
    assert "not judged" in text(shown, "#covers") and "error is not estimated" in text(shown, "#covers")
    shown.page.get_by_role("button", name="Back to the landing").click()
    assert text(shown, '[data-tile="force"]') == before and not text(shown, ".verdict").startswith("What if")
    assert shown.js("__page.app.model === __page.app.original")


def test_another_robot_is_shown_with_all_its_wheels(shown: Opened):
    shown.page.locator("#whatif select").select_option(label="hybrid_robot_2 at 20 m")
    assert "--robot hybrid_robot_2" in solved(shown)["said"]
    assert np.max(signal(shown, "contact2.normal_force")) > 50.0
    assert shown.js("__page.app.model.head.robot.name") == "hybrid_robot_2"


def test_the_last_of_many_wishes_is_shown(shown: Opened):
    shown.js("[0.1, 0.2, 0.3, 0.4].forEach(v => __page.whatif.set('friction', v))")
    state = solved(shown)
    assert state["wishes"]["friction"] == 0.4 and "friction_coefficient=0.4" in state["said"]


def test_a_landing_that_fails_is_said(shown: Opened):
    """A wish that no body can have; what was shown before stays."""
    shown.js("__page.whatif.set('mass', -1)")
    assert "No such landing" in solved(shown)["said"]
    assert shown.js("__page.app.model === __page.app.original")
