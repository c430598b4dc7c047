"""The page of the flagship's 25 s: its size, how long it takes to write, its first frame in software GL, draw calls, a replay.

``python -m benchmarks.page [RUN]``; without the directory of a run it makes one. Needs Chromium and Playwright (docs/howto/
report_page.md); the first frame is to come within a second, the file to stay below 4 MB, a frame to need at most 60 draw calls.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import orchestrator
from orchestrator.coupling.run.results import read_json
from orchestrator.report.page import write

SCENARIO = "landing_200m_point9"
PROGRAM = shutil.which("chromium") or "chromium"
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
VIEWS = ("landing", "side", "wheel", "span")
LOADS = 5
"""Times that the page is loaded; the median counts."""


def main() -> int:
    """Measure, print a row each, and return 0."""
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(sys.argv[1]) if len(sys.argv) > 1 else _made(Path(folder) / "run")
        start = time.perf_counter()
        page = write(directory, read_json(directory / "manifest.json"))
        print(f"written in            {time.perf_counter() - start:8.2f} s")
        print(f"size                  {page.stat().st_size / 1e6:8.2f} MB (at most 4)")
        _look(page)
    return 0


def _made(directory: Path) -> Path:
    orchestrator.run(SCENARIO, out=directory, estimate="none", pictures=False)
    return directory


def _look(page: Path) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=ARGUMENTS)
        times = [_times(browser, page) for _ in range(LOADS)]
        for i, words in enumerate(("first frame after", "of which scripts")):
            print(f"{words:<21} {sorted(row[i] for row in times)[LOADS // 2] / 1e3:8.2f} s (at most 1)")
        tab = _loaded(browser, page)
        print(f"draw calls            {max(_calls(tab, view) for view in VIEWS):8d} (at most 60)")
        print(f"frames a second       {_frames(tab):8.1f}")
        browser.close()


def _loaded(browser: Any, page: Path) -> Any:
    tab = browser.new_page(viewport={"width": 1440, "height": 1000})
    tab.goto(f"{page.as_uri()}#paused")
    while not tab.evaluate("window.__page && __page.ready"):
        time.sleep(0.01)
    return tab


def _times(browser: Any, page: Path) -> tuple[float, float]:
    """Return the milliseconds until the first frame was drawn, since the navigation and since scripts run."""
    tab = _loaded(browser, page)
    found = tab.evaluate("[__page.since_navigation_ms, __page.load_ms]")
    tab.close()
    return found[0], found[1]


def _calls(tab: Any, view: str) -> int:
    tab.evaluate(f"__page.view({view!r}); __page.seek(6.0)")
    time.sleep(0.5)
    return int(tab.evaluate("__page.info().calls"))


def _frames(tab: Any, seconds: float = 3.0) -> float:
    tab.evaluate("__page.view('landing'); __page.seek(0); __page.play(true)")
    first = tab.evaluate("__page.frames")
    time.sleep(seconds)
    return (tab.evaluate("__page.frames") - first) / seconds


if __name__ == "__main__":
    sys.exit(main())
