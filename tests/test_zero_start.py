"""Engines that send zeros until each FMU has made its first step: the contact is open then, and begins with what comes."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest

from fmus.contact.module import Contact
from fmus.module.variables import ModuleError
from orchestrator.catalogue.library import module_fmu
from tests.contacts import SEAT
from tests.fmi import Instance

TABLE = Contact.table
INPUTS = TABLE.names("input")
H, S = 1e-3, 4.5
LOADS = [f"{body}.{load}.{axis}" for body in ("cable", "wheel") for load in ("force", "moment") for axis in "xyz"]


def motion(along: float = 0.0, depth: float = 2e-3) -> dict[str, float]:
    """A level cable along +Y, the wheel `depth` below first touch; the cable point is `along` before the wheel's foot."""
    middle = {"cable.position.y": S - along, "wheel.position.y": S, "wheel.position.z": SEAT - depth}
    means = {f"{name[:-2]}_mean{name[-2:]}": value for name, value in middle.items()}
    unit = {"cable.tangent.y": 1.0, "cable.tangent_mean.y": 1.0, "wheel.axle.x": 1.0, "wheel.axle_mean.x": 1.0}
    return dict.fromkeys(INPUTS, 0.0) | middle | means | unit


ZEROS = dict.fromkeys(INPUTS, 0.0)


def contact(inputs: dict[str, float], exchange: str = "point") -> Contact:
    one = Contact()
    TABLE.assign(one.values, {"initial.s": S, "exchange": exchange, **inputs})
    one.initialize(0.0)
    return one


def stepped(one: Contact, n: int, inputs: dict[str, float]) -> dict[str, float]:
    """The outputs after step `n` with these inputs."""
    TABLE.assign(one.values, inputs)
    one.step(n * H, H)
    return outputs(one)


def outputs(one: Contact) -> dict[str, float]:
    return {name: float(one.values[TABLE.index[name]]) for name in TABLE.names("output")}


def assert_open(found: dict[str, float]) -> None:
    assert [found[name] for name in (*LOADS, "normal_force", "status")] == [0.0] * (len(LOADS) + 2)
    assert found["cable.s"] == S and found["touch_time"] == -1.0


@pytest.mark.parametrize("zero", ["cable.tangent", "wheel.axle", ""])
def test_what_is_no_motion_is_open(zero):
    """No tangent, no axle, nothing at all: at the start, in a step, and in between."""
    sent = ZEROS if not zero else motion() | {f"{zero}.{axis}": 0.0 for axis in "xyz"}
    one = contact(sent)
    assert_open(outputs(one))
    assert_open(stepped(one, 0, sent))
    one.refresh()
    assert_open(outputs(one))


@pytest.mark.parametrize("exchange", ["point", "hermite", "waveform"])
def test_it_begins_with_the_first_motion(exchange):
    """After zeros, and a cable that shows its end, all is as if the run began where the motion comes."""
    late, fresh = contact(ZEROS, exchange), contact(motion(), exchange)
    assert_open(stepped(late, 0, ZEROS))
    assert_open(stepped(late, 1, motion(along=S)))
    first, begun = stepped(late, 2, motion()), outputs(fresh)
    assert first["normal_force"] > 0.0 and first["touch_time"] == pytest.approx(3 * H)
    assert [first[name] for name in (*LOADS, "strain_energy")] == [begun[name] for name in (*LOADS, "strain_energy")]
    there = motion(along=-1e-4, depth=2.1e-3)
    later, soon = stepped(late, 3, there), stepped(fresh, 0, there)
    clock = {"touch_time"}
    assert {n: x for n, x in later.items() if n not in clock} == {n: x for n, x in soon.items() if n not in clock}


def test_the_contact_point_goes_far_if_it_is_far_twice():
    """What only the first step after zeros shows is not believed; what stays is."""
    one = contact(ZEROS)
    stepped(one, 0, ZEROS)
    assert stepped(one, 1, motion(along=2.0))["cable.s"] == S
    assert stepped(one, 2, motion(along=2.0))["cable.s"] == pytest.approx(S + 2.0)


def test_zeros_within_a_run_open_the_contact_and_pass():
    one = contact(motion())
    assert stepped(one, 0, motion())["normal_force"] > 0.0
    assert stepped(one, 1, ZEROS)["normal_force"] == 0.0
    found = stepped(one, 2, motion())
    assert found["normal_force"] > 0.0 and found["cable.s"] == S


def test_what_is_not_finite_is_refused_as_before():
    one = contact(motion())
    with pytest.raises(ModuleError, match="not finite"):
        stepped(one, 0, motion() | {"wheel.position.z": np.nan})


def test_the_fmu_is_open_where_zeros_come(tmp_path):
    """The start-up of FMPy's runner of system structures: initialised without inputs, then a step with all inputs zero."""
    with Instance(fmpy.extract(str(module_fmu("contact")), str(tmp_path))) as fmu:
        fmu.set(**{"initial.s": S, "exchange": "point"})
        fmu.initialize()
        fmu.set(**ZEROS)
        assert_open({name: float(value) for name, value in fmu.run(0.0, H, 1)[0].items()})
        fmu.set(**motion(along=S))
        assert_open({name: float(value) for name, value in fmu.run(H, H, 1)[0].items()})
        fmu.set(**motion())
        assert fmu.run(2 * H, H, 1)[0]["normal_force"] > 0.0
        assert [text for status, text in fmu.messages if status > 0] == []
