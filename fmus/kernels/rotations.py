"""Rotations: unit quaternions, rotation vectors and Euler angles (kernels).

A quaternion q = (w, x, y, z) stands for the rotation R_IB that takes components in B to components in I.
Euler angles are roll phi, pitch theta and yaw psi with R = Rz(psi) Ry(theta) Rx(phi).
Angular velocities are those of B in I, in inertial components, so that dq/dt = (0, w_IB) * q / 2.

All formulas are textbook ones: Shuster, "A survey of attitude representations", J. Astronaut. Sci. 41 (1993).
"""

from __future__ import annotations

import math

from fmus.kernels.jit import kernel

SMALL_ANGLE = 1e-4
"""Below this angle (rad), three terms of a series are exact to round-off."""


@kernel
def rotate(q, x, y, z):
    """Return the components in I, a tuple (3,), of the vector with components x, y, z in B."""
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * tx + q[2] * tz - q[3] * ty,
        y + q[0] * ty + q[3] * tx - q[1] * tz,
        z + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@kernel
def rotate_back(q, x, y, z):
    """Return the components in B, a tuple (3,), of the vector with components x, y, z in I."""
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    return (
        x - q[0] * tx + q[2] * tz - q[3] * ty,
        y - q[0] * ty + q[3] * tx - q[1] * tz,
        z - q[0] * tz + q[1] * ty - q[2] * tx,
    )


@kernel
def normalize(q):
    """Scale the quaternion q (4,) to unit length, in place."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= scale


@kernel
def multiply(p, q, out):
    """Write the product p * q (first q, then p) to `out` (4,), which is neither p nor q."""
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]


@kernel
def quaternion_rate(q, wx, wy, wz, out):
    """Write dq/dt for the inertial angular velocity (rad/s) to `out` (4,)."""
    out[0] = -0.5 * (wx * q[1] + wy * q[2] + wz * q[3])
    out[1] = 0.5 * (wx * q[0] + wy * q[3] - wz * q[2])
    out[2] = 0.5 * (wy * q[0] + wz * q[1] - wx * q[3])
    out[3] = 0.5 * (wz * q[0] + wx * q[2] - wy * q[1])


@kernel
def from_rotation_vector(v, out):
    """Write the quaternion of the rotation vector v (3,), rad, to `out` (4,)."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if angle < SMALL_ANGLE:
        scale = 0.5 - angle * angle / 48.0
    else:
        scale = math.sin(0.5 * angle) / angle
    out[0] = math.cos(0.5 * angle)
    for i in range(3):
        out[1 + i] = scale * v[i]


@kernel
def to_rotation_vector(q, out):
    """Write the rotation vector (3,), rad, of at most half a turn, of the quaternion q to `out`."""
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    cosine = q[0]
    sign = 1.0
    if cosine < 0.0:
        cosine = -cosine
        sign = -1.0
    if sine < SMALL_ANGLE:
        scale = 2.0 + sine * sine / 3.0
    else:
        scale = 2.0 * math.atan2(sine, cosine) / sine
    for i in range(3):
        out[i] = sign * scale * q[1 + i]


@kernel
def from_euler(roll, pitch, yaw, out):
    """Write the quaternion of R = Rz(yaw) Ry(pitch) Rx(roll) to `out` (4,)."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    out[0] = cy * cp * cr + sy * sp * sr
    out[1] = cy * cp * sr - sy * sp * cr
    out[2] = cy * sp * cr + sy * cp * sr
    out[3] = sy * cp * cr - cy * sp * sr


@kernel
def to_euler(q):
    """Return roll and yaw in [-pi, pi] and pitch in [-pi/2, pi/2], as (roll, pitch, yaw)."""
    sine = 2.0 * (q[0] * q[2] - q[1] * q[3])
    pitch = math.asin(min(1.0, max(-1.0, sine)))
    roll = math.atan2(2.0 * (q[2] * q[3] + q[0] * q[1]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]))
    yaw = math.atan2(2.0 * (q[1] * q[2] + q[0] * q[3]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))
    return roll, pitch, yaw


@kernel
def follow_euler(q, angles):
    """Move `angles` (roll, pitch, yaw) to those of q, adding the whole turns that keep them continuous."""
    turn = 2.0 * math.pi
    roll, pitch, yaw = to_euler(q)
    angles[0] = roll + turn * math.floor((angles[0] - roll) / turn + 0.5)
    angles[1] = pitch
    angles[2] = yaw + turn * math.floor((angles[2] - yaw) / turn + 0.5)


@kernel
def turn(q, theta, scratch, out):
    """Write the quaternion exp(theta) q to `out`, which may not be q."""
    from_rotation_vector(theta, scratch)
    multiply(scratch, q, out)
    normalize(out)


@kernel
def rotation_vector_rate(theta, w, out):
    """Write T(theta)⁻¹ w, the rate of the rotation vector at the inertial angular velocity w."""
    t0, t1, t2 = theta[0], theta[1], theta[2]
    square = t0 * t0 + t1 * t1 + t2 * t2
    factor = 1.0 / 12.0 + square / 720.0
    if square > 1e-4:
        half = 0.5 * math.sqrt(square)
        factor = (1.0 - half / math.tan(half)) / square
    c0, c1, c2 = t1 * w[2] - t2 * w[1], t2 * w[0] - t0 * w[2], t0 * w[1] - t1 * w[0]
    out[0] = w[0] - 0.5 * c0 + factor * (t1 * c2 - t2 * c1)
    out[1] = w[1] - 0.5 * c1 + factor * (t2 * c0 - t0 * c2)
    out[2] = w[2] - 0.5 * c2 + factor * (t0 * c1 - t1 * c0)
