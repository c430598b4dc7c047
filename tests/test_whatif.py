"""What if: a landing packed into a block, and changed in its wishes; what a run leaves to be solved anew."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.landing.monolithic.block import KINDS, Parts, kernels_hash, leaves, pack, unpack_source
from orchestrator.landing.monolithic.entry import (
    DAMPING,
    FRICTION,
    MASS,
    NO_BODY,
    SPEED,
    advance_interval,
    begin,
    grant,
)
from orchestrator.landing.monolithic.solve import Integrator, shown_of
from orchestrator.landing.monolithic.starts import packed, start_of
from orchestrator.report.page.whatif import whatif_of
from orchestrator.runs.job import Job, make
from orchestrator.runs.systems import LandingSystem
from orchestrator.runs.whatif import step_of
from orchestrator.scenario.inertia import goes_with_mass
from tests.scenarios import ROOT, SCENARIOS
from tests.what_if import (
    FLAGSHIP,
    HELD,
    IMPACT,
    MIDSPAN,
    THRUST,
    WISHES,
    integrator_of,
    left,
    system_of,
    times_of,
    wished,
)

PLACES = {"mass": MASS, "damping": DAMPING, "friction": FRICTION, "speed": SPEED}
ROUND_OFF = 1e-13
"""Relative; parameters found from others, by one way of reckoning or another."""


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


def granted(system: LandingSystem, wishes: Mapping[str, float]) -> Integrator:
    """The start of a landing with other wishes, begun by the kernels that a page runs."""
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


def test_a_run_of_a_sweep_leaves_its_start(tmp_path: Path):
    job = Job(
        str(SCENARIOS / f"{FLAGSHIP}.toml"), {"simulation.stop_time": 0.04, "landing.position": 50.0}, estimate=False
    )
    make(job, tmp_path)
    about = json.loads((tmp_path / job.key / "start.json").read_text(encoding="utf-8"))
    assert [start["position"] for start in about["starts"]] == [50.0] and about["end"] == 0.04


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
