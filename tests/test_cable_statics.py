"""The cable at rest, held against independent solutions (`verification/cable`), and where there is none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.cable.mesh import nodes
from fmus.cable.module import Cable
from fmus.module.variables import ModuleError
from verification.cable import statics
from verification.cable.setups import PHYSICAL, RIG, TABLE1, cable, loaded_equilibrium, point, support_forces
from verification.cable.statics import CONVERGED, RECOMMENDED, Case

pytestmark = pytest.mark.portable

CASES = [
    Case("table1"),
    Case("table1", clamped=True, load_at=0.5),
    Case("table1", clamped=True, inclined=True, load_at=0.1),
    Case("physical", inclined=True, load_at=0.1),
    Case("physical", clamped=True),
    Case("rig", clamped=True, inclined=True, load_at=0.1),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.words)
def test_against_the_boundary_value_problem(case):
    for row in statics.rows(case, CONVERGED, 1e-5):
        assert row.passed, row


@pytest.mark.parametrize("case", [Case("table1"), Case("table1", clamped=True)], ids=lambda case: case.words)
def test_recommended_mesh(case):
    for row in statics.rows(case, RECOMMENDED, 1e-4):
        assert row.passed, row


@pytest.mark.parametrize(("name", "sag"), [("table1", 2.01951), ("physical", 3.2056), ("rig", 0.053489)])
def test_twenty_equal_elements_pinned(name, sag):
    """Hinged, without a point load, even long elements do: sag to five digits of the boundary-value problem's."""
    assert statics.expected(Case(name))[0] == pytest.approx(sag, rel=2e-5)
    assert statics.computed(Case(name), 20, 1.0)[0] == pytest.approx(statics.expected(Case(name))[0], rel=1e-6)


def test_strain_measure_catenary_and_order():
    for row in [*statics.strain_measure_rows(), *statics.catenary_rows(), statics.order_row()]:
        assert row.passed, row


@given(st.floats(0.05, 0.95), st.floats(-30.0, 30.0), st.booleans())
@settings(max_examples=8, deadline=None)
def test_supports_carry_the_weight(share, level, clamped):
    """Statics: the vertical forces of the supports add up to weight and load, the horizontal ones to nothing."""
    load = 38.0 * 9.8
    length = 1.001 * float(np.hypot(200.0, level))
    model, q = loaded_equilibrium(
        TABLE1 | {"unstretched_length": length},
        ((share * length, load),),
        n_elements=30,
        grading=30.0,
        clamped=clamped,
        level_difference=level,
    )
    total = support_forces(model, q).sum(axis=0)
    scale = np.abs(support_forces(model, q)).max()
    assert np.abs(total - [0.0, 0.0, 0.91 * 9.8 * length + load]).max() < 1e-9 * scale


def test_mirrored_spans():
    """A span that climbs is the mirror image of one that falls."""
    args = {"n_elements": 24, "grading": 10.0, "clamped": True}
    up, q_up = loaded_equilibrium(TABLE1, ((40.0, 300.0),), level_difference=5.0, **args)
    down, q_down = loaded_equilibrium(TABLE1, ((160.0, 300.0),), level_difference=-5.0, **args)
    for s in np.linspace(0.0, 200.0, 17):
        here, there = point(up, q_up, s), point(down, q_down, 200.0 - s)
        assert here[1] == pytest.approx(200.0 - there[1], abs=1e-9)
        assert here[2] == pytest.approx(5.0 + there[2], abs=1e-9)


def test_wanted_sag():
    made = cable(TABLE1, sag=4.5)
    assert -made["shape[21].position.z"] == pytest.approx(4.5, rel=1e-9)


@pytest.mark.parametrize(
    "more",
    [
        {"unstretched_length": 199.0},
        {"unstretched_length": 150.0},
        {"unstretched_length": 240.0},
        {"unstretched_length": 400.0},
        {"unstretched_length": 240.0, "clamped": True, "n_elements": 40, "grading": 30.0},
        {"span": 500.0, "unstretched_length": 500.0},
        {"n_elements": 500},
        {"n_elements": 500, "clamped": True},
        {"n_elements": 1},
        {"level_difference": 150.0, "unstretched_length": 252.0},
        {"bending_stiffness": 0.0, "unstretched_length": 260.0},
        {"gravity": 0.0, "unstretched_length": 199.99},
        {"gravity": 0.0},
    ],
    ids=str,
)
def test_equilibrium_is_found(more):
    """Taut, slack, long, fine and coarse: found, and the supports carry the weight."""
    made = cable(TABLE1, **more)
    weight = 0.91 * made["gravity"] * made["unstretched_length"]
    total = made["reaction_left.z"] + made["reaction_right.z"]
    assert total == pytest.approx(weight, abs=1e-9 * max(made["tension_left"], 1.0))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"unstretched_length": 240.0, "clamped": True, "n_elements": 20}, "set grading"),
        ({"gravity": 0.0, "unstretched_length": 205.0}, "slack cable without gravity"),
        ({"axial_stiffness": 0.0}, "axial_stiffness = 0 N must be greater than 0"),
        ({"bending_stiffness": float("nan")}, "bending_stiffness = nan"),
        ({"n_elements": -1}, "n_elements = -1 must be at least 0 and at most 5000"),
        ({"spectral_radius": 1.5}, "spectral_radius = 1.5 must be at least 0 and at most 1"),
        ({"grading": 0.5}, "grading = 0.5 must be at least 1"),
        ({"sag": 0.01}, "sag: 0.01 m cannot be reached"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_says_why_there_is_none(more, words):
    with pytest.raises(ModuleError, match=words):
        cable(TABLE1, **more)


@given(st.integers(2, 400), st.floats(1.0, 200.0), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_mesh(n_elements, grading, share):
    """Ends and number of elements are met, lengths positive, the ratio not above the one wanted."""
    s = nodes(200.0, n_elements, grading, 200.0 * share)
    l = np.diff(s)
    assert s.size == n_elements + 1 and s[0] == 0.0 and s[-1] == 200.0
    assert l.min() > 0.0
    assert l.max() / l.min() < grading * 1.05


def test_defaults_are_table1():
    made = Cable()
    assert {name: made[name] for name in TABLE1} == TABLE1
    assert PHYSICAL["axial_stiffness"] == 8.12e7 / 4 and RIG["span"] == 10.0
