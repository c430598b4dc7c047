"""The contact law at one instant: a straight piece of cable in the V-groove of a wheel.

Vectors are inertial. ``motion`` (24,) holds ``p`` 0:3 the cable point at the contact's arc length, ``t`` 3:6
its tangent dr/ds, ``dp`` 6:9 and ``dt`` 9:12 their rates, ``w`` 12:15 the wheel centre, ``a`` 15:18 the axle,
``dw`` 18:21 the wheel's velocity and ``om`` 21:24 its angular velocity. Equations: README.md of this folder.
"""

from __future__ import annotations

import math

import numpy as np

from fmus.kernels.jit import kernel
from fmus.module.variables import VariableTable

PARAMETERS = (
    "stiffness",
    "exponent",
    "damping",
    "friction_coefficient",
    "wheel_radius",
    "groove_angle",
    "groove_width",
    "cable_diameter",
    "max_contact_length",
    "tangential_stiffness",
    "tangential_damping",
)
"""Names of ``prm[0:11]``; behind them stand sine and cosine of half the groove angle and the apex radius."""

OUT_SIZE = 32
OPEN, STICK, SLIP, LEFT = 0, 1, 2, 3
OK, NO_TANGENT, NO_AXLE, NOT_FINITE = 0, 1, 2, 3

_K, _N, _D, _MU, _RADIUS, _ANGLE, _WIDTH, _DIAMETER, _LENGTH, _KT, _CT, _SIN, _COS, _APEX = range(14)


NODES, WEIGHTS = np.polynomial.legendre.leggauss(9)
"""Gauss-Legendre rule on the piece of cable that a wall touches (relative error 4e-6 at n = 2.5)."""


def law_parameters(values: np.ndarray, table: VariableTable) -> np.ndarray:
    """Return the law's parameters from a module's flat array of values: (14,) float64."""
    prm = np.zeros(len(PARAMETERS) + 3)
    prm[: len(PARAMETERS)] = values[table.indices(PARAMETERS)]
    half = 0.5 * prm[_ANGLE]
    prm[_SIN], prm[_COS] = math.sin(half), math.cos(half)
    prm[_APEX] = prm[_RADIUS] - 0.5 * prm[_WIDTH] / math.tan(half)
    return prm


@kernel
def _power(x, n):
    """Return x**n for x >= 0; the exponents in use avoid the general power."""
    if n == 2.5:
        return x * x * math.sqrt(x)
    if n == 1.5:
        return x * math.sqrt(x)
    if n == 1.0:
        return x
    return x**n


@kernel
def _cross(a, b):
    """Return the cross product of two triples."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def _dot(a, b):
    """Return the scalar product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _combine(a, x, b):
    """Return a + x b of two triples."""
    return (a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2])


@kernel
def foot(motion):
    """Return |t|, the unit tangent u, the offset (m) of the wheel centre's foot from p, and foot - w."""
    t = (motion[3], motion[4], motion[5])
    length = math.sqrt(_dot(t, t))
    u = (t[0] / length, t[1] / length, t[2] / length)
    d = (motion[0] - motion[12], motion[1] - motion[13], motion[2] - motion[14])
    offset = -_dot(d, u)
    return length, u, offset, _combine(d, offset, u)


@kernel
def axle(motion):
    """Return the axle, normalised: along an interpolated path it is a unit vector to second order only."""
    a = (motion[15], motion[16], motion[17])
    norm = math.sqrt(_dot(a, a))
    return (a[0] / norm, a[1] / norm, a[2] / norm)


@kernel
def lateral(u, a):
    """Return the axle's direction across the cable (zero where the cable runs along the axle)."""
    b = _combine(a, -_dot(a, u), u)
    norm = math.sqrt(_dot(b, b))
    if norm < 1e-9:
        return (0.0, 0.0, 0.0)
    return (b[0] / norm, b[1] / norm, b[2] / norm)


@kernel
def _deepest(side, u_a, apart, prm):
    """Return where on the line, from the foot, a wall is pressed deepest within the longest contact length.

    The penetration is concave along the line while the angle between cable and wheel plane is below half the
    groove angle; beyond, its end is deepest.
    """
    half = 0.5 * prm[_LENGTH]
    slope = side * prm[_COS] * u_a
    room = prm[_SIN] ** 2 - u_a * u_a
    if room <= 0.0:
        return half if slope > 0.0 else -half
    radial = 1.0 - u_a * u_a
    centre, closest = apart[0], apart[1]
    x = centre + slope * closest / math.sqrt(radial * room)
    return min(max(x, -half), half)


@kernel
def _touched(side, u_a, y, distance_squared, prm):
    """Return the ends, from the foot, of the piece of line that touches a wall which is pressed somewhere.

    delta > 0 means rho(x) < A + B x, a quadratic inequality. Where the cable is steeper than the wall (more
    than half the groove angle off the wheel plane) the whole longest contact length is returned.
    """
    half = 0.5 * prm[_LENGTH]
    c = prm[_COS] / prm[_SIN]
    A = prm[_APEX] + 0.5 * prm[_DIAMETER] / prm[_SIN] + side * c * y
    B = side * c * u_a
    q2 = 1.0 - u_a * u_a - B * B
    q1 = y * u_a + A * B
    q0 = distance_squared - y * y - A * A
    if q2 <= 1e-12:
        return -half, half
    root = math.sqrt(max(q1 * q1 - q2 * q0, 0.0))
    return max((q1 - root) / q2, -half), min((q1 + root) / q2, half)


@kernel
def walls(prm, motion, out):
    """Write what the two walls do, without friction, and the kinematics of the contact.

    Parameters
    ----------
    prm : (14,) of `law_parameters`
    motion : (24,) see the module's head
    out : (32,) as `contact_wrench`; friction's places are zero

    Returns
    -------
    int, 0 or the cause of failure: 1 tangent without length, 2 axle without length, 3 motion not finite
    """
    for i in range(OUT_SIZE):
        out[i] = 0.0
    if not motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2 > 0.0:
        return NO_TANGENT
    if not motion[15] ** 2 + motion[16] ** 2 + motion[17] ** 2 > 0.0:
        return NO_AXLE
    length, u, offset, d = foot(motion)
    a = axle(motion)
    b = lateral(u, a)
    om = (motion[21], motion[22], motion[23])

    # relative velocity cable - wheel at distance x from the foot: v + x dv
    dt = (motion[9], motion[10], motion[11])
    du = _combine(dt, -_dot(dt, u), u)
    du = (du[0] / length, du[1] / length, du[2] / length)
    v = (motion[6] - motion[18], motion[7] - motion[19], motion[8] - motion[20])
    v = _combine(_combine(v, offset, du), -1.0, _cross(om, d))
    dv = _combine(du, -1.0, _cross(om, u))
    out[16] = _dot(v, u)
    out[17] = _dot(v, b)
    out[20] = offset / length

    # axial and radial parts: y + x u_a, r + x ur, rho^2 = rr0 + 2 rr1 x + rr2 x^2
    y = _dot(d, a)
    u_a = _dot(u, a)
    r = _combine(d, -y, a)
    ur = _combine(u, -u_a, a)
    rr0, rr1, rr2 = _dot(r, r), _dot(r, ur), _dot(ur, ur)
    va0, va1 = _dot(v, a), _dot(dv, a)
    vr0, vr1, vr2 = _dot(v, r), _dot(v, ur) + _dot(dv, r), _dot(dv, ur)
    distance_squared = _dot(d, d)
    if not math.isfinite(distance_squared + va0 + va1 + vr0 + vr1 + vr2 + out[16] + out[17]):
        return NOT_FINITE
    centre = -rr1 / rr2 if rr2 > 1e-18 else 0.0
    closest = math.sqrt(max(rr0 + rr1 * centre, 0.0))

    k, n, damping = prm[_K], prm[_N], prm[_D]
    s, c, radius = prm[_SIN], prm[_COS], 0.5 * prm[_DIAMETER]
    rim = 0.5 * prm[_WIDTH]
    outside = abs(y) > rim
    left = outside and math.sqrt(rr0) < prm[_RADIUS] + radius

    normal = power = energy = 0.0
    sum_a = sum_ax = sum_r = sum_rx = sum_rxx = 0.0
    deepest = -math.inf
    first, last = math.inf, -math.inf
    for wall in range(2):
        side = 1.0 - 2.0 * wall
        x = _deepest(side, u_a, (centre, closest), prm)
        rho = math.sqrt(max(rr0 + x * (2.0 * rr1 + x * rr2), 0.0))
        delta = radius - s * (rho - prm[_APEX]) + side * c * (y + x * u_a)
        deepest = max(deepest, delta)
        if delta <= 0.0 or outside:
            continue
        lo, hi = _touched(side, u_a, y, distance_squared, prm)
        first, last = min(first, lo), max(last, hi)
        middle, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
        for i in range(len(NODES)):
            x = middle + half * NODES[i]
            rho = math.sqrt(max(rr0 + x * (2.0 * rr1 + x * rr2), 1e-24))
            delta = radius - s * (rho - prm[_APEX]) + side * c * (y + x * u_a)
            if delta <= 0.0:
                continue
            rate = side * c * (va0 + x * va1) - s * (vr0 + x * (vr1 + x * vr2)) / rho
            elastic = WEIGHTS[i] * half / prm[_LENGTH] * k * _power(delta, n)
            f = elastic * max(1.0 + damping * rate, 0.0)
            normal += f
            power += (f - elastic) * rate
            energy += elastic * delta / (n + 1.0)
            sum_a -= side * c * f
            sum_ax -= side * c * f * x
            radial = s * f / rho
            sum_r += radial
            sum_rx += radial * x
            sum_rxx += radial * x * x

    out[15] = deepest
    out[19] = LEFT if left else OPEN
    if normal == 0.0 and energy == 0.0:
        return OK
    # resultant and first moment of the distributed force along the line
    force = (
        sum_a * a[0] + sum_r * r[0] + sum_rx * ur[0],
        sum_a * a[1] + sum_r * r[1] + sum_rx * ur[1],
        sum_a * a[2] + sum_r * r[2] + sum_rx * ur[2],
    )
    spread = (
        sum_ax * a[0] + sum_rx * r[0] + sum_rxx * ur[0],
        sum_ax * a[1] + sum_rx * r[1] + sum_rxx * ur[1],
        sum_ax * a[2] + sum_rx * r[2] + sum_rxx * ur[2],
    )
    on_cable = _cross(u, _combine(spread, offset, force))
    about_foot = _cross(u, spread)
    lever = _cross(d, force)
    for i in range(3):
        out[i] = force[i]
        out[3 + i] = on_cable[i]
        out[6 + i] = -force[i]
        out[9 + i] = -(lever[i] + about_foot[i])
    out[12] = normal
    out[18] = last - first
    out[19] = STICK if normal > 0.0 else OPEN
    out[23] = power
    out[25] = energy
    return OK


@kernel
def friction(prm, motion, slip, out):
    """Add the friction to what `walls` has written; the bristle is kept inside the Coulomb disc.

    The elongation is projected on the disc |k_t z| <= mu N, then the force k_t z + c_t v on the disc mu N.
    Both are projections on a convex set, so that neither can give back more energy than was put in.
    """
    kt, ct = prm[_KT], prm[_CT]
    limit = prm[_MU] * out[12]
    if limit <= 0.0:
        return
    z0, z1 = slip[0], slip[1]
    elongation = kt * math.sqrt(z0 * z0 + z1 * z1)
    if elongation > limit:
        z0 *= limit / elongation
        z1 *= limit / elongation
        out[19] = SLIP
    f0 = kt * z0 + ct * out[16]
    f1 = kt * z1 + ct * out[17]
    size = math.sqrt(f0 * f0 + f1 * f1)
    if size > limit:
        f0 *= limit / size
        f1 *= limit / size
    out[13], out[14] = -f0, -f1
    out[21], out[22] = z0, z1
    out[24] = (f0 - kt * z0) * out[16] + (f1 - kt * z1) * out[17]
    if out[19] == SLIP:
        out[24] += max(kt * (z0 * out[16] + z1 * out[17]), 0.0)
    out[26] = 0.5 * kt * (z0 * z0 + z1 * z1)

    _length, u, offset, d = foot(motion)
    b = lateral(u, axle(motion))
    force = (-f0 * u[0] - f1 * b[0], -f0 * u[1] - f1 * b[1], -f0 * u[2] - f1 * b[2])
    on_cable = _cross(u, force)
    on_wheel = _cross(d, force)
    for i in range(3):
        out[i] += force[i]
        out[3 + i] += offset * on_cable[i]
        out[6 + i] -= force[i]
        out[9 + i] -= on_wheel[i]


@kernel
def contact_wrench(prm, motion, slip, out):
    """Write the contact law at one instant (eqs. 27-43 of Jia et al. 2025, geometry of README.md).

    Parameters
    ----------
    prm : (14,) of `law_parameters`
    motion : (24,) see the module's head
    slip : (2,) m, trial elongation of the friction bristle along the cable and along the axle
    out : (32,) 0:3 force (N) and 3:6 moment about p (N.m) on the cable, 6:9 force and 9:12 moment about w on
        the wheel, 12 normal force of both walls, 13:15 friction on the cable along cable and axle, 15 deepest
        penetration (m; negative: the gap), 16:18 slip velocity of the cable relative to the wheel, 18 contact
        length, 19 status, 20 offset of the contact from p (m of arc length), 21:23 elongation after the
        Coulomb limit, 23 and 24 power (W) dissipated by the walls and by friction, 25 and 26 elastic energy
        (J) of walls and bristle

    Returns
    -------
    int, 0 or the cause of failure: 1 tangent without length, 2 axle without length, 3 motion not finite
    """
    status = walls(prm, motion, out)
    if status == OK:
        friction(prm, motion, slip, out)
    return status
