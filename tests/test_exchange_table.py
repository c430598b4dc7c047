"""The table of exchanges, and what names say: held against the modules and the contract, which know nothing of it."""

from __future__ import annotations

from math import ceil
from typing import get_args

import pytest

from fmus.cable.module import Cable
from fmus.contact.module import Contact
from fmus.oscillator.module import Oscillator
from fmus.robot.module import robot_table
from orchestrator.coupling.exchange import (
    EXCHANGES,
    LOADS,
    MEAN,
    OTHER,
    PARAMETER,
    RATE,
    Choice,
    exchange_named,
    force_beside,
    is_companion,
    is_from_start,
    is_load,
    is_motion,
    is_of_step,
    is_rate_of_motion,
    is_slope_of_load,
    motion_of,
    only_couples,
    split,
    stems,
    suffixed,
    suited_to,
    vectors,
)
from orchestrator.landing.contract import CONTRACTS

ROBOT = robot_table(1)


def test_every_exchange_of_our_modules_has_a_row_and_every_row_a_module() -> None:
    offered = {*Contact.table[PARAMETER].choices, *Oscillator.table[PARAMETER].choices}
    assert offered == set(EXCHANGES)
    assert set(get_args(Choice)) == set(Contact.table[PARAMETER].choices)
    assert suited_to(implicit=True) == Contact.table[PARAMETER].choices[1] == "waveform"
    assert suited_to(implicit=False) == "point"


@pytest.mark.parametrize(
    ("wanted", "slopes", "means", "made"),
    [
        ("waveform", True, True, "waveform"),
        ("waveform", True, False, "hermite"),
        ("waveform", False, True, "point"),
        ("waveform", False, False, "point"),
        ("hermite", True, False, "hermite"),
        ("hermite", False, True, "point"),
        ("point", True, True, "point"),
        ("point", False, False, "point"),
        ("held", False, False, "held"),
    ],
)
def test_what_components_without_slopes_or_means_are_left_with(
    wanted: str, slopes: bool, means: bool, made: str
) -> None:
    assert EXCHANGES[wanted].possible(slopes=slopes, means=means).name == made


def test_rows_say_what_is_known_of_them() -> None:
    """Order 4 with slopes, 2 without; an estimate never reckons with more; what holds has no use for means."""
    for name, row in EXCHANGES.items():
        assert row is exchange_named(name) and row.name == name
        assert row.order == (4 if row.slopes else 2)
        assert row.order_of_estimates <= row.order
        assert row.slopes or not row.means
        assert (row.instead == "") == (not row.slopes)
    assert exchange_named("their own") is exchange_named("") is OTHER
    assert OTHER.slopes and not OTHER.holds


def test_names() -> None:
    assert split("port[1].force.x") == ("port[1].", "force", ".x")
    assert split("force") == ("", "force", "")
    assert split("u[1,2]") == ("", "u[1,2]", "")
    assert suffixed("port[1].force.x", RATE) == "port[1].force_rate.x"
    assert suffixed("force", MEAN) == "force_mean"
    assert stems(["a.force.x", "a.force.y", "b", "a.moment.x"]) == ["a.force", "b", "a.moment"]
    assert vectors(["a.force.x", "b", "a.force.y"]).tolist() == [0, 1, 0]
    assert force_beside("wheel[1].moment.x") == "wheel[1].force.x" and force_beside("torque") == "force"
    assert force_beside("wheel[1].moments") == "wheel[1].moments"
    assert motion_of("port[1].force.x") == ("port[1].position.x", False)
    assert motion_of("wheel[1].moment.z") == ("wheel[1].rotation.z", True)


def test_what_a_name_is() -> None:
    names = {"force.x", "force_rate.x", "tangent.x", "tangent_rate.x", "tangent_mean.x", "rotation.x", "roll", "speed"}
    assert {n for n in names if is_load(n, names)} == {"force.x"}
    assert {n for n in names if is_motion(n, names)} == {"tangent.x"}
    assert {n for n in names if is_companion(n)} == {"force_rate.x", "tangent_rate.x", "tangent_mean.x"}
    assert {n for n in names if is_rate_of_motion(n, names)} == {"tangent_rate.x"}
    assert {n for n in names if is_slope_of_load(n)} == {"force_rate.x"}
    assert {n for n in names if is_from_start(n)} == {"rotation.x"}
    assert {n for n in names if is_of_step(n)} == {"tangent_mean.x", "rotation.x"}
    assert {n for n in names if only_couples(n)} == {"force_rate.x", "tangent_rate.x", "tangent_mean.x", "rotation.x"}
    assert not only_couples("position_mean")  # of a scalar: it may be all there is to see
    assert not is_from_start("axle.rotation_angle") and not is_companion("rate")


def test_our_modules_name_their_variables_so() -> None:
    """Every load has a slope and a motion with a mean; every mean belongs to a motion, every slope to a load."""
    for table, place in ((Cable.table, "port[1]."), (ROBOT, "wheel[1].")):
        inputs, outputs = set(table.names("input")), set(table.names("output"))
        shown = [load for load in LOADS if motion_of(f"{place}{load}.x")[0] in outputs]
        assert "force" in shown
        for load in LOADS:
            assert is_load(f"{place}{load}.x", inputs)
        for load in shown:
            assert is_motion(motion_of(f"{place}{load}.x")[0], outputs)
    for table in (Cable.table, ROBOT, Contact.table, Oscillator.table):
        for side in (set(table.names("input")), set(table.names("output"))):
            for name in filter(is_companion, side):
                where, last, axis = split(name)
                base = where + last.removesuffix(RATE).removesuffix(MEAN) + axis
                assert is_load(base, side) or is_motion(base, side), name


def test_the_contract_names_them_so() -> None:
    for points in CONTRACTS.values():
        for causality in ("input", "output"):
            names = {name for p in points if p.causality == causality for name in p.names(1)}
            bases = {n for n in names if is_load(n, names) or is_motion(n, names)}
            companions = {suffixed(n, s) for n in bases for s in (RATE, MEAN)}
            assert {n for n in names if is_companion(n)} <= companions


def test_inner_steps_grow_as_the_exchange_allows():
    """Order 3 inside, order 4 outside: h ~ H^(4/3), between a quarter and a half of the macro step; order 2: one."""
    counts = {H: ceil((H / EXCHANGES["waveform"].inner_step(H)) - 1e-9) for H in (1e-3, 2.5e-3, 5e-3, 1e-2, 2e-2, 0.1)}
    assert counts == {1e-3: 4, 2.5e-3: 4, 5e-3: 4, 1e-2: 4, 2e-2: 3, 0.1: 2}
    steps = [EXCHANGES["hermite"].inner_step(H) for H in (8e-3, 16e-3)]
    assert steps[1] / steps[0] == pytest.approx(2 ** (4 / 3))
    assert EXCHANGES["point"].inner_step(0.01) == 0.01
