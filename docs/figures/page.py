"""The pictures of the page in the docs: ``python docs/figures/page.py RUN`` of a finished run of ``landing_200m_point9``.

Draws ``docs/images/page.png`` (light) and ``page_wheel.png`` (dark, from the wheel) with headless Chromium.
"""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from orchestrator.coupling.run.results import read_json
from orchestrator.report.page import write

OUT = Path(__file__).parents[1] / "images"
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PICTURES = (("page.png", "light", "landing", 0.6), ("page_wheel.png", "dark", "wheel", 6.0))
"""File, colours, camera, time (s)."""
PATIENCE = 300.0
"""s, on a machine that has much else to do."""


def main() -> None:
    """Write the page of a run anew and take its pictures."""
    directory = Path(sys.argv[1]).resolve()
    page = write(directory, read_json(directory / "manifest.json"))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        for name, colours, view, at in PICTURES:
            place = browser.new_context(viewport={"width": 1440, "height": 985}, color_scheme=colours)
            place.set_default_timeout(1e3 * PATIENCE)
            _take(place.new_page(), page, view, at, OUT / name)
        browser.close()


def _take(tab: Any, page: Path, view: str, at: float, picture: Path) -> None:
    tab.goto(f"{page.as_uri()}#paused")
    while not tab.evaluate("window.__page && __page.ready"):
        time.sleep(0.1)
    tab.evaluate(f"__page.view({view!r}); __page.seek({at})")
    time.sleep(2.0)
    tab.screenshot(path=picture)
    print(picture)


if __name__ == "__main__":
    main()
