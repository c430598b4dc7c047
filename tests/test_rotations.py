"""Rotation kernels against scipy.spatial.transform.Rotation, which shares no code with them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fmus.kernels import rotations

pytestmark = pytest.mark.portable

ROUND_OFF = 1e-14
components = st.floats(-1.0, 1.0, allow_subnormal=False)
vectors = st.tuples(components, components, components).map(np.array)
angles = st.floats(-1.5, 1.5)


def scalar_first(rotation):
    return rotation.as_quat(scalar_first=True)


@settings(deadline=None, max_examples=50)
@given(vectors, vectors)
def test_rotate_and_back(turn, v):
    q = scalar_first(Rotation.from_rotvec(turn))
    rotated = np.array(rotations.rotate(q, *v))
    np.testing.assert_allclose(rotated, Rotation.from_rotvec(turn).apply(v), atol=ROUND_OFF)
    np.testing.assert_allclose(rotations.rotate_back(q, *rotated), v, atol=ROUND_OFF)


@settings(deadline=None, max_examples=50)
@given(vectors, st.sampled_from([1e-9, 0.9e-4, 1.1e-4, 1.0, 1.8]))
def test_rotation_vector(direction, size):
    v = direction * size
    q, back = np.zeros(4), np.zeros(3)
    rotations.from_rotation_vector(v, q)
    expected = scalar_first(Rotation.from_rotvec(v))
    np.testing.assert_allclose(q, expected, atol=ROUND_OFF)
    rotations.to_rotation_vector(q, back)
    np.testing.assert_allclose(back, Rotation.from_rotvec(v).as_rotvec(), rtol=1e-9, atol=ROUND_OFF)
    rotations.to_rotation_vector(-q, back)  # q and -q are the same rotation
    np.testing.assert_allclose(back, Rotation.from_rotvec(v).as_rotvec(), rtol=1e-9, atol=ROUND_OFF)


@settings(deadline=None, max_examples=50)
@given(angles, angles, angles)
def test_euler_angles(roll, pitch, yaw):
    q = np.zeros(4)
    rotations.from_euler(roll, pitch, yaw, q)
    matrix = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()  # upper case: Rz Ry Rx
    np.testing.assert_allclose(Rotation.from_quat(q, scalar_first=True).as_matrix(), matrix, atol=ROUND_OFF)
    # Near pitch = 1.5 rad the angles are worse conditioned by 1/cos²(pitch) = 200.
    np.testing.assert_allclose(rotations.to_euler(q), (roll, pitch, yaw), atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(vectors, vectors)
def test_product(u, v):
    p, q, out = (np.zeros(4) for _ in range(3))
    rotations.from_rotation_vector(u, p)
    rotations.from_rotation_vector(v, q)
    rotations.multiply(p, q, out)
    expected = (Rotation.from_rotvec(u) * Rotation.from_rotvec(v)).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(out, scalar_first=True).as_matrix(), expected, atol=ROUND_OFF)


def test_quaternion_rate_is_the_derivative():
    """Central difference of exp(w t) q at t = 0; its error is |w|³ h²/24 + eps/h = 1e-10 at h = 1e-5."""
    w, h = np.array([0.3, -0.8, 0.5]), 1e-5
    start = Rotation.from_rotvec([0.2, 0.4, -0.7])
    rate = np.zeros(4)
    rotations.quaternion_rate(scalar_first(start), *w, rate)
    ahead, behind = (scalar_first(Rotation.from_rotvec(s * h * w) * start) for s in (1, -1))
    np.testing.assert_allclose(rate, (ahead - behind) / (2 * h), atol=1e-10)


def test_normalize():
    q = np.array([3.0, 0.0, 4.0, 0.0])
    rotations.normalize(q)
    np.testing.assert_allclose(q, [0.6, 0.0, 0.8, 0.0], atol=ROUND_OFF)


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_followed_angles_keep_their_whole_turns(turns):
    q = np.zeros(4)
    rotations.from_euler(0.1, 0.2, -0.3, q)
    angles = np.array([2 * np.pi * turns, 0.0, 2 * np.pi * turns])
    rotations.follow_euler(q, angles)
    expected = (2 * np.pi * turns + 0.1, 0.2, 2 * np.pi * turns - 0.3)
    np.testing.assert_allclose(angles, expected, atol=1e-13)
