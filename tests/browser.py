"""A real browser for tests of pages: Debian's Chromium, headless, with WebGL in software, driven by Playwright."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

REQUIRED = "LINE_LANDING_BROWSER"
"""Environment variable; ``required`` makes tests fail that would be skipped for want of a browser."""
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_WEBGL = """const real = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return /webgl/.test(kind) ? null : real.call(this, kind, ...rest);
};"""
LIMIT = 120.0
"""s that a page may take for anything, on a machine that has much else to do."""


def wanting(why: str) -> None:
    """Skip for want of something, or fail where a browser is required."""
    if os.environ.get(REQUIRED) == "required":
        pytest.fail(f"{why}, and {REQUIRED}=required", pytrace=False)
    pytest.skip(why)


def launched() -> Iterator[Any]:
    """Give a browser; it is closed at the end."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        wanting("Playwright is not installed: pip install playwright")
    program = next((found for name in PROGRAMS if (found := shutil.which(name))), None)
    if program is None:
        wanting("there is no Chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(ARGUMENTS))
        yield browser
        browser.close()


@dataclass
class Opened:
    """A page in the browser; `said` is what it has written to the console, `asked` what it has asked the network for."""

    page: Any
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def js(self, expression: str) -> Any:
        """Return the value of an expression in the page."""
        return self.page.evaluate(expression)

    def until(self, expression: str, what: str = "") -> Any:
        """Wait until an expression is true: asked again and again, since the page's policy forbids to inject a wait."""
        end = time.monotonic() + LIMIT
        while not (value := self.js(expression)):
            assert time.monotonic() < end, f"{what or expression}: not within {LIMIT:g} s; {self.complaints}"
            time.sleep(0.02)
        return value

    def drawn(self) -> None:
        """Wait for the next frame."""
        self.js("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def seek(self, t: float) -> None:
        """Show the time `t` (s)."""
        self.js(f"__page.seek({t!r})")
        self.drawn()

    @property
    def complaints(self) -> list[str]:
        """Errors that the page has met."""
        return [*self.said, *self.js("window.__page?.errors ?? []")]

    def pixels(self) -> bytes:
        """Return a picture of the stage."""
        return self.page.locator("#stage").screenshot()


def opened(browser: Any, path: Path, webgl: bool = True, **context: Any) -> Opened:
    """Return a page that has drawn its first frame, at rest.

    Parameters
    ----------
    webgl : whether there is any
    context : options of the context, ``viewport``, ``color_scheme`` …
    """
    place = browser.new_context(**{"viewport": {"width": 1100, "height": 750}, **context})
    if not webgl:
        place.add_init_script(NO_WEBGL)
    place.set_default_timeout(1e3 * LIMIT)
    found = Opened(place.new_page())
    found.page.on("console", lambda said: found.said.append(f"{said.type}: {said.text}"))
    found.page.on("pageerror", lambda error: found.said.append(f"error: {error}"))
    found.page.on("request", lambda request: found.asked.append(request.url))
    found.page.goto(f"{path.as_uri()}#paused")
    found.until("window.__page && __page.ready", "the page is ready")
    return found
