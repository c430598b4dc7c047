"""The tension: the part of the cross-section's force along the tangent, from equilibrium, bending included."""

import numpy as np
import pytest

from fmus.cable.assembly import add_load, curvature, interpolate
from fmus.cable.module import N_SHAPE, Cable
from fmus.cable.statics import equilibrium

pytestmark = pytest.mark.portable

FINE = {"n_elements": 30, "grading": 30.0}
LINES = {
    "table1": {"grading_position": 20.0} | FINE,
    "table1, equal elements": {},
    "physical": {"axial_stiffness": 2.03e7, "bending_stiffness": 411.25} | FINE,
    "clamped": {"clamped": True} | FINE,
    "slack": {"unstretched_length": 210.0, "n_elements": 60, "grading": 10.0},
    "steep": {"span": 100.0, "level_difference": 60.0, "unstretched_length": 120.0, "n_elements": 60},
    "rig": {"span": 10.0, "unstretched_length": 10.0, "linear_density": 0.707, "axial_stiffness": 2.111e7}
    | {"bending_stiffness": 337.8}
    | FINE,
}


def line(**settings):
    cable = Cable()
    cable.table.assign(cable.values, settings)
    cable.initialize(0.0)
    return cable


def tensions(cable):
    return np.array([cable[f"shape[{i + 1}].tension"] for i in range(N_SHAPE)])


def field(cable, s):
    """dr/ds and d²r/ds² at arc length s."""
    q, out, bend = cable.state[: cable.model.weight.size], np.zeros(6), np.zeros(3)
    interpolate(cable.model, q, s, np.zeros(8), out)
    curvature(cable.model, q, s, np.zeros(8), bend)
    return out[3:], bend


def reaction(cable, side):
    return np.array([cable[f"reaction_{side}.{axis}"] for axis in "xyz"])


@pytest.mark.parametrize("name", LINES)
def test_at_rest_it_is_nowhere_below_its_horizontal_component(name):
    """Nothing loads a cable at rest horizontally: H is that of the supports everywhere, and the part of the force along
    a tangent at the slope α is H / cos α but for the shear force. Round-off of the equilibrium: 1e-9."""
    cable = line(**LINES[name])
    horizontal = reaction(cable, "right")[1]
    assert reaction(cable, "left")[1] == pytest.approx(-horizontal, rel=1e-9)
    assert np.all(tensions(cable) >= horizontal * (1.0 - 1e-9))
    if name not in ("steep",):  # the lowest point is in the middle: there it is H
        assert cable["tension_mid"] == pytest.approx(horizontal, rel=1e-8)


@pytest.mark.parametrize("name", LINES)
def test_at_the_supports_it_is_the_reaction_along_the_tangent(name):
    """The support's force is the whole force of the section there; what is across the tangent is shear. Pinned, that is
    H / w' times the bending layer squared, small: the magnitudes agree to 1e-3."""
    cable = line(**LINES[name])
    for side, s, shown in (("left", 0.0, tensions(cable)[0]), ("right", cable.model.s[-1], tensions(cable)[-1])):
        tangent, force = field(cable, s)[0], reaction(cable, side)
        outward = tangent if side == "right" else -tangent
        assert shown == pytest.approx(force @ outward / np.linalg.norm(tangent), rel=1e-12)
        assert shown == pytest.approx(cable[f"tension_{side}"], rel=1e-3)
        assert shown <= cable[f"tension_{side}"]


def loaded(n_elements):
    """`table1` at rest under 38 kg at 20 m."""
    cable = line(n_elements=n_elements, grading=30.0, grading_position=20.0)
    q, weight = cable.state[: cable.model.weight.size], np.array([0.0, 0.0, -38.0 * 9.8])
    load = np.zeros(q.size)
    add_load(cable.model, q, 20.0, weight, np.zeros(3), np.zeros(8), load)
    q[:] = equilibrium(cable.model, 200.0, 0.0, load)
    first = cable.table.index["port[1].s"]
    cable.values[first] = 20.0
    cable.values[first + 1 : first + 4] = weight
    cable.show()
    return cable


def test_it_is_that_of_stretch_and_bending():
    """T = EA λ ε + 2 EI λ³ θ'² of P_g - P_h' in a plane, |g × h| = λ² θ', where the mesh resolves the bending.

    At single points the strain of a cubic element swings about the true one: halving the elements shows it.
    """
    errors = []
    for n in (120, 240):
        cable, worst = loaded(n), 0.0
        for i in range(1, N_SHAPE - 1):
            s = cable.model.s[-1] * i / (N_SHAPE - 1)
            g, h = field(cable, s)
            stretch = np.linalg.norm(g)
            strain = 0.5 * (stretch**2 - 1.0)
            bend = np.linalg.norm(np.cross(g, h)) / stretch**2
            expected = 8.12e7 * stretch * strain + 2.0 * 6580.0 * stretch**3 * bend**2
            if abs(s - 20.0) > 1.0:  # at the wheel the section's force jumps
                worst = max(worst, abs(tensions(cable)[i] - expected))
        errors.append(worst / cable["tension_mid"])
    assert errors[1] < 0.5 * errors[0]
    assert errors[1] < 1e-5


def test_a_load_makes_it_jump_by_its_part_along_the_tangent():
    """Between supports and wheel the section's force is that of the support less the weight between."""
    cable = loaded(60)
    weight = 0.91 * 9.8
    for i in (2, 20, 38):
        s = cable.model.s[-1] * i / (N_SHAPE - 1)
        tangent = field(cable, s)[0]
        force = -reaction(cable, "left") + np.array([0.0, 0.0, weight * s + (38.0 * 9.8 if s > 20.0 else 0.0)])
        assert tensions(cable)[i] == pytest.approx(force @ tangent / np.linalg.norm(tangent), rel=1e-9)
