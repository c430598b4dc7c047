"""The cable element: invariance, tangent, symmetry, patch tests, mass; expected values are exact properties."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fmus.cable import element
from verification.cable.free_beam import FreeBeam
from verification.cable.large_rotation import order_row, rolled_rows, rows

pytestmark = pytest.mark.portable

EA, EI, DAMPING, LENGTH = 2.0e6, 400.0, 0.004, 1.3
SEEDS = st.integers(0, 2**32 - 1)


def beam(n_elements: int = 2) -> FreeBeam:
    return FreeBeam(LENGTH, EA, EI, n_elements, DAMPING)


def bent(seed: int, n_elements: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Return random coordinates of some percent of strain, and random velocities."""
    random = np.random.default_rng(seed)
    made = beam(n_elements)
    return made.straight() + 0.05 * random.standard_normal(made.n), random.standard_normal(made.n)


def rotation(seed: int) -> np.ndarray:
    """Return a random rotation matrix."""
    return Rotation.random(random_state=np.random.default_rng(seed)).as_matrix()


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_rigid_motion_of_a_straight_beam_gives_no_force(seed):
    made, R = beam(3), rotation(seed)
    shift, spin = np.random.default_rng(seed).standard_normal((2, 3))
    q = (made.straight().reshape(-1, 2, 3) @ R.T).copy()
    v = np.cross(spin, q)
    q[:, 0] += shift
    v[:, 0] += shift
    force, energy, power = made.force(q.ravel(), v.ravel())
    # round-off of EA times coordinates of order 1
    assert np.abs(force).max() < 1e-14 * EA * 100
    assert energy < 1e-20 * EA and power < 1e-20 * EA


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_force_turns_with_the_beam(seed):
    made, R, (q, v) = beam(), rotation(seed), bent(seed)
    force, energy, power = made.force(q, v)
    found, found_energy, found_power = made.force((q.reshape(-1, 3) @ R.T).ravel(), (v.reshape(-1, 3) @ R.T).ravel())
    assert np.allclose(found.reshape(-1, 3), force.reshape(-1, 3) @ R.T, rtol=0, atol=1e-11 * np.abs(force).max())
    assert found_energy == pytest.approx(energy, rel=1e-11) and found_power == pytest.approx(power, rel=1e-11)


def test_spin_of_a_bent_beam():
    """The curvature is a vector in the inertial frame: spin across it is damped by c EI |ω × k|², about it by nothing.

    A beam without twist as a coordinate does not know how its material turns; see the README of the cable.
    """
    made, b = beam(3), 0.1
    x = made.l * np.arange(4)
    q = made.straight()
    q[2::6], q[5::6] = 0.5 * b * x**2, b * x
    for spin in np.eye(3):
        v = np.cross(spin, q.reshape(-1, 3)).ravel()
        k = np.array([b, 0.0, 0.0])  # g × h of the parabola, the same everywhere
        expected = DAMPING * EI * LENGTH * np.sum(np.cross(spin, k) ** 2)
        assert made.force(q, v)[2] == pytest.approx(expected, rel=1e-12, abs=1e-20)


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_internal_force_balances(seed):
    made, (q, v) = beam(), bent(seed)
    force, r = made.force(q, v)[0].reshape(-1, 2, 3), q.reshape(-1, 2, 3)
    assert np.abs(force[:, 0].sum(axis=0)).max() < 1e-12 * np.abs(force).max()
    # the moment of the generalised forces on r and r_x about the origin: none from elasticity
    elastic = made.force(q)[0].reshape(-1, 2, 3)
    assert np.abs(np.cross(r, elastic).sum(axis=(0, 1))).max() < 1e-12 * np.abs(elastic).max()


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_tangent_is_the_derivative_of_the_force(seed):
    """The force is a cubic polynomial: a central difference of order 4 is exact, but for round-off."""
    made, (q, v) = beam(), bent(seed)
    h, weights = 1e-2, ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0))
    K, C = made.tangent(q, v)
    for which, tangent in ((0, K), (1, C)):
        difference = np.zeros_like(tangent)
        for j in range(made.n):
            for k, w in weights:
                at = [q.copy(), v.copy()]
                at[which][j] += k * h
                difference[:, j] += w / (12.0 * h) * made.force(*at)[0]
        assert np.abs(difference - tangent).max() < 1e-10 * np.abs(tangent).max()


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_tangents_are_symmetric_and_damping_takes_energy(seed):
    made, (q, v) = beam(), bent(seed)
    K, C = made.tangent(q, np.zeros_like(v))
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()
    assert np.abs(C - C.T).max() < 1e-14 * np.abs(C).max()
    assert np.linalg.eigvalsh(C).min() > -1e-12 * np.abs(C).max()
    _, _, power = made.force(q, v)
    assert power == pytest.approx(v @ C @ v, rel=1e-12)


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_force_is_the_gradient_of_the_energy(seed):
    made, (q, _) = beam(), bent(seed)
    along = np.random.default_rng(seed).standard_normal(made.n)
    force, h = made.force(q)[0], 1e-2
    # the energy is a quartic polynomial: the difference of order 4 is exact
    energies = {k: made.force(q + k * h * along)[1] for k in (-2, -1, 1, 2)}
    difference = (8.0 * (energies[1] - energies[-1]) - (energies[2] - energies[-2])) / (12.0 * h)
    assert difference == pytest.approx(force @ along, rel=1e-9, abs=1e-10 * np.abs(force).max())


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_mirrored_beam_has_mirrored_force(seed):
    made, (q, v) = beam(3), bent(seed, 3)
    mirror = np.diag([-1.0, 1.0, 1.0])
    force, energy, _ = made.force(q, v)
    mirrored, same, _ = made.force((q.reshape(-1, 3) @ mirror).ravel(), (v.reshape(-1, 3) @ mirror).ravel())
    assert np.array_equal(mirrored.reshape(-1, 3), force.reshape(-1, 3) @ mirror) and same == energy


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_reversed_beam_has_reversed_force(seed):
    """Numbering the nodes from the other end changes nothing: slopes change sign."""
    made, (q, v) = beam(3), bent(seed, 3)

    def reverse(x: np.ndarray) -> np.ndarray:
        return (x.reshape(-1, 2, 3)[::-1] * np.array([1.0, -1.0])[:, None]).ravel()

    force = made.force(q, v)[0]
    assert np.allclose(made.force(reverse(q), reverse(v))[0], reverse(force), rtol=0, atol=1e-12 * np.abs(force).max())


@pytest.mark.parametrize("stretch", [0.9, 1.001, 1.1])
def test_patch_of_uniform_stretch(stretch):
    """N = EA λ (λ² - 1)/2 at the ends and nothing between, in elements of unequal length."""
    direction = np.array([0.6, 0.0, 0.8])
    nodes = np.array([0.0, 0.3, 0.4, 1.1])
    q = np.concatenate([np.concatenate([stretch * s * direction, stretch * direction]) for s in nodes])
    force, out = np.zeros(q.size), np.zeros(2)
    for e in range(3):
        element.internal_force(q, np.zeros(q.size), 6 * e, nodes[e + 1] - nodes[e], EA, EI, DAMPING, force, out)
    tension = EA * stretch * 0.5 * (stretch**2 - 1.0)
    expected = np.zeros(q.size)
    expected[0:3], expected[-6:-3] = -tension * direction, tension * direction
    assert np.abs(force - expected).max() < 1e-12 * EA
    assert out[0] == pytest.approx(1.1 * EA / 8.0 * (stretch**2 - 1.0) ** 2, rel=1e-12)


def test_energy_of_a_parabola():
    """r = (0, x, b x²/2): g = (0, 1, b x), ε = b² x²/2, |g × h| = b; ∫ by hand: EA b⁴ L⁵/40 + EI b² L/2."""
    made, b = beam(3), 0.4
    x = made.l * np.arange(4)
    q = made.straight()
    q[2::6], q[5::6] = 0.5 * b * x**2, b * x
    energy = made.force(q)[1]
    assert energy == pytest.approx(EA * b**4 * LENGTH**5 / 40.0 + EI * b * b * LENGTH / 2.0, rel=1e-13)


def test_mass_of_rigid_motion():
    """Translation has m v²/2, turning about one end m L² ω²/6; the matrix is positive definite."""
    density, m = 0.91, np.zeros((4, 4))
    element.mass(LENGTH, density, m)
    slide, turn = np.array([1.0, 0.0, 1.0, 0.0]), np.array([0.0, 1.0, LENGTH, 1.0])
    assert slide @ m @ slide == pytest.approx(density * LENGTH, rel=1e-14)
    assert turn @ m @ turn == pytest.approx(density * LENGTH**3 / 3.0, rel=1e-14)
    assert np.array_equal(m, m.T) and np.linalg.eigvalsh(m).min() > 0.0


def test_cantilever():
    """5e-8 was found; the order being 4, a mesh twice as fine has 3e-9 (measured)."""
    for row in rows(32, 2e-7):
        assert row.passed, row


def test_roll_up():
    """The error falls by 16 where the elements are halved; at 32 elements it is 6e-5 of the length."""
    for row in rolled_rows(32, 1e-4):
        assert row.passed, row


def test_order_of_the_element():
    row = order_row()
    assert row.passed, row
