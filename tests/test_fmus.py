"""The FMUs of cable, contact and robot: what FMI asks of every one of them."""

from __future__ import annotations

import fmpy
import pytest
from fmpy.validation import validate_fmu

from fmus.face.build import build_fmu
from fmus.module import registry
from tests.fmi import Instance

pytestmark = pytest.mark.portable

STARTS = {
    "cable": {"port[1].force.z": -50.0, "port[1].s": 80.0},
    "contact": {"wheel.position.z": 0.06},  # in touch
    "robot": {"thrust": 100.0, "wheel[1].force.x": 5.0},
    "setdown": {"contact[1].normal_force": 100.0, "sample_time": 6e-3},  # all steps below divide it
    "oscillator": {"coupling_stiffness": 2.0, "coupling_damping": 0.1, "force": 1.0, "neighbour.position": 0.1},
}
"""Inputs that bring every mechanism of the module into play."""


@pytest.fixture(scope="module", params=registry.OURS)
def path(request, tmp_path_factory):
    return build_fmu(registry.find(request.param).recipe(), tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module")
def folder(path):
    return fmpy.extract(str(path), str(path.parent / "unzipped"))


def bits(rows):
    """Return `rows` so that equal means bit-identical."""
    return [{name: value.hex() if isinstance(value, float) else value for name, value in r.items()} for r in rows]


def moved(one, name):
    """Return the outputs that change when the input `name` does."""
    start = one.get(name)
    before = one.outputs()
    one.set(**{name: start + 1e-3})
    after = one.outputs()
    one.set(**{name: start})
    return {output for output in after if after[output] != before[output]}


def test_fmpy_finds_no_problem(path):
    assert validate_fmu(str(path)) == []


def test_runs_alone(path):
    result = fmpy.simulate_fmu(str(path), stop_time=0.05)
    assert len(result) == 11


def test_dependencies_cover_what_is_observed(path, folder):
    with Instance(folder, **STARTS[path.stem]) as one:
        description = one.description
        direct = {u.variable.name: {v.name for v in u.dependencies} for u in description.outputs}
        initial = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
        one.fmu.enterInitializationMode()
        for name in one.names("input"):
            assert all(name in initial[output] for output in moved(one, name)), f"{name}, initially"
        one.fmu.exitInitializationMode()
        one.run(0.0, 1e-3, 2)
        for name in one.names("input"):
            assert all(name in direct[output] for output in moved(one, name)), name


def test_replay_is_bit_identical(path, folder):
    with Instance(folder, **STARTS[path.stem]) as one, Instance(folder) as other:
        one.initialize().run(0.0, 2e-3, 3)
        data = one.fmu.serializeFMUstate(one.fmu.getFMUstate())
        state = one.fmu.getFMUstate()
        first = bits(one.run(6e-3, 3e-3, 5))
        one.fmu.setFMUstate(state)
        assert bits(one.run(6e-3, 3e-3, 5)) == first
        other.initialize().fmu.setFMUstate(other.fmu.deSerializeFMUstate(data))
        assert bits(other.run(6e-3, 3e-3, 5)) == first


def test_outputs_after_a_restore_do_not_depend_on_what_came_before(path, folder):
    start = STARTS[path.stem]
    with Instance(folder, **start) as one, Instance(folder, **start) as other:
        inputs = [name for name in start if one.variables[name].causality == "input"]
        load = {name: start[name] * 1.001 for name in inputs}
        one.initialize()
        other.initialize()
        at_start = one.fmu.getFMUstate()
        one.run(0.0, 2e-3, 3)
        later = one.fmu.serializeFMUstate(one.fmu.getFMUstate())
        one.set(**load)
        loaded = one.outputs()
        one.fmu.setFMUstate(at_start)
        other.set(**load)
        one.set(**load)
        assert bits([one.outputs()]) == bits([other.outputs()])
        other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(later))
        other.set(**load)
        assert bits([other.outputs()]) == bits([loaded])
