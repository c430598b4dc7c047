"""The contact law at one instant: a straight piece of cable in the V-groove of a wheel.

Vectors are inertial. Where things stand in ``prm``, ``motion`` and ``out``: places.py. Equations: README.md of this
folder.
"""

from __future__ import annotations

import math

import numpy as np

from fmus.contact import places as at
from fmus.kernels.jit import kernel
from fmus.module.variables import VariableTable

OPEN, STICK, SLIP, LEFT = 0, 1, 2, 3
"""Status of a contact; `LEFT`: the cable has left the groove."""
HUNT_CROSSLEY, IMPACT = 0, 1
"""What damps the walls: choices of the parameter `damping_law`."""
OK, NO_TANGENT, NO_AXLE, NOT_FINITE, STEEP, TOO_FAR = range(6)
"""What the kernels return: done, or why the law cannot be evaluated. `STEEP`: the cable presses on a wall, and it is
steeper to the wheel's plane than the wall is. `TOO_FAR`: a step takes the wheel farther than the groove is deep."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(9)
"""Gauss-Legendre rule on the piece of cable that a wall touches (relative error 4e-6 at n = 2.5)."""


def law_parameters(values: np.ndarray, table: VariableTable) -> np.ndarray:
    """Return the law's parameters ``prm`` from a module's flat array of values: (18,) float64."""
    prm = np.zeros(at.PRM_SIZE)
    prm[: len(at.PARAMETERS)] = values[table.indices(at.PARAMETERS)]
    half = 0.5 * prm[at.GROOVE_ANGLE]
    prm[at.SINE], prm[at.COSINE] = math.sin(half), math.cos(half)
    prm[at.APEX] = prm[at.WHEEL_RADIUS] - 0.5 * prm[at.GROOVE_WIDTH] / math.tan(half)
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
def step_up(x):
    """Return the cubic of ADAMS' STEP function from 0 at x = 0 to 1 at x = 1, held beyond (x >= 0)."""
    if x >= 1.0:
        return 1.0
    return x * x * (3.0 - 2.0 * x)


@kernel
def _pressed(share, elastic, delta, rate, prm):
    """Return with what force a wall presses at a point, never pulling, from the `elastic` part of it.

    Parameters
    ----------
    share : of the reference length, that the point stands for
    delta, rate : m, m/s; penetration and its rate
    """
    if prm[at.DAMPING_LAW] == IMPACT:
        ramp = step_up(delta / prm[at.DAMPING_DEPTH])
        return max(elastic + share * prm[at.DAMPING_COEFFICIENT] * ramp * rate, 0.0)
    return elastic * max(1.0 + prm[at.DAMPING] * rate, 0.0)


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
def _triple(x, first):
    """Return three entries of an array from `first` on."""
    return (x[first], x[first + 1], x[first + 2])


@kernel
def _square(x, first):
    """Return the sum of the squares of three entries of an array from `first` on."""
    return x[first] ** 2 + x[first + 1] ** 2 + x[first + 2] ** 2


@kernel
def foot(motion):
    """Return |t|, the unit tangent u, the offset (m) of the wheel centre's foot from p, and foot - w."""
    t = _triple(motion, at.TANGENT)
    length = math.sqrt(_dot(t, t))
    u = (t[0] / length, t[1] / length, t[2] / length)
    d = _combine(_triple(motion, at.POINT), -1.0, _triple(motion, at.CENTRE))
    offset = -_dot(d, u)
    return length, u, offset, _combine(d, offset, u)


@kernel
def axle(motion):
    """Return the axle, normalised: along an interpolated path it is a unit vector to second order only."""
    a = _triple(motion, at.AXLE)
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
def _reach(u_a, y, prm):
    """Return the ends, from the foot, of the piece of line on which contact is looked for.

    A point in the groove is nearer to the axle than the rim, so that half the piece is at most (R + d_c/2)/cos(θ/2) long
    while the cable is less steep than the walls; `max_contact_length` limits it, too. What touches lies on both sides of
    the foot, so that a limit longer than all of it cuts nothing. This does not move with the motion: a piece cut at the
    rims would lose energy with what is cut. A steeper line is looked at between the rims.
    """
    half = (prm[at.WHEEL_RADIUS] + 0.5 * prm[at.CABLE_DIAMETER]) / prm[at.COSINE]
    half = min(half, prm[at.MAX_LENGTH])
    rim, steep = 0.5 * prm[at.GROOVE_WIDTH], abs(u_a)
    if steep < prm[at.SINE] or abs(y) > rim:
        return -half, half
    drift = y if u_a > 0.0 else -y
    return max(-half, -(rim + drift) / steep), min(half, (rim - drift) / steep)


@kernel
def _deepest(side, u_a, apart, reach, prm):
    """Return where on the line, from the foot, a wall is pressed deepest within `reach`.

    The penetration is concave along the line while the angle between cable and wheel plane is below half the
    groove angle; beyond, an end is deepest.
    """
    slope = side * prm[at.COSINE] * u_a
    room = prm[at.SINE] ** 2 - u_a * u_a
    if room <= 0.0:
        return reach[1] if slope > 0.0 else reach[0]
    radial = 1.0 - u_a * u_a
    centre, closest = apart[0], apart[1]
    x = centre + slope * closest / math.sqrt(radial * room)
    return min(max(x, reach[0]), reach[1])


@kernel
def _touched(side, u_a, y, distance_squared, reach, prm):
    """Return the ends, from the foot, of the piece of line that touches a wall which is pressed somewhere.

    delta > 0 means rho(x) < A + B x, a quadratic inequality; the cable must not be steeper than the wall.
    """
    c = prm[at.COSINE] / prm[at.SINE]
    A = prm[at.APEX] + 0.5 * prm[at.CABLE_DIAMETER] / prm[at.SINE] + side * c * y
    B = side * c * u_a
    q2 = 1.0 - u_a * u_a - B * B
    q1 = y * u_a + A * B
    q0 = distance_squared - y * y - A * A
    root = math.sqrt(max(q1 * q1 - q2 * q0, 0.0))
    return max((q1 - root) / q2, reach[0]), min((q1 + root) / q2, reach[1])


@kernel
def walls(prm, motion, out):
    """Write what the two walls do, without friction, and the kinematics of the contact.

    Parameters
    ----------
    prm : (18,) of `law_parameters`
    motion : (24,) of cable point and wheel: places.py
    out : (34,) as `contact_wrench`; friction's places are zero

    Returns
    -------
    int, OK or the cause of failure
    """
    for i in range(at.OUT_SIZE):
        out[i] = 0.0
    if not _square(motion, at.TANGENT) > 0.0:
        return NO_TANGENT
    if not _square(motion, at.AXLE) > 0.0:
        return NO_AXLE
    length, u, offset, d = foot(motion)
    a = axle(motion)
    b = lateral(u, a)
    om = _triple(motion, at.TURN_RATE)

    # relative velocity cable - wheel at distance x from the foot: v + x dv
    dt = _triple(motion, at.TANGENT_RATE)
    du = _combine(dt, -_dot(dt, u), u)
    du = (du[0] / length, du[1] / length, du[2] / length)
    v = _combine(_triple(motion, at.POINT_RATE), -1.0, _triple(motion, at.CENTRE_RATE))
    v = _combine(_combine(v, offset, du), -1.0, _cross(om, d))
    dv = _combine(du, -1.0, _cross(om, u))
    out[at.SLIP_VELOCITY] = _dot(v, u)
    out[at.SLIP_VELOCITY + 1] = _dot(v, b)
    out[at.OFFSET] = offset / length

    # axial and radial parts: y + x u_a, r + x ur, rho^2 = rr0 + 2 rr1 x + rr2 x^2
    y = _dot(d, a)
    u_a = _dot(u, a)
    r = _combine(d, -y, a)
    ur = _combine(u, -u_a, a)
    rr0, rr1, rr2 = _dot(r, r), _dot(r, ur), _dot(ur, ur)
    va0, va1 = _dot(v, a), _dot(dv, a)
    vr0, vr1, vr2 = _dot(v, r), _dot(v, ur) + _dot(dv, r), _dot(dv, ur)
    distance_squared = _dot(d, d)
    slip = out[at.SLIP_VELOCITY], out[at.SLIP_VELOCITY + 1]
    if not math.isfinite(distance_squared + va0 + va1 + vr0 + vr1 + vr2 + slip[0] + slip[1]):
        return NOT_FINITE
    centre = -rr1 / rr2 if rr2 > 1e-18 else 0.0
    closest = math.sqrt(max(rr0 + rr1 * centre, 0.0))

    k, n = prm[at.STIFFNESS], prm[at.EXPONENT]
    s, c, radius = prm[at.SINE], prm[at.COSINE], 0.5 * prm[at.CABLE_DIAMETER]
    rim = 0.5 * prm[at.GROOVE_WIDTH]
    outside = abs(y) > rim
    left = outside and math.sqrt(rr0) < prm[at.WHEEL_RADIUS] + radius

    normal = power = energy = 0.0
    sum_a = sum_ax = sum_r = sum_rx = sum_rxx = 0.0
    deepest = -math.inf
    first, last = math.inf, -math.inf
    reach = _reach(u_a, y, prm)
    for wall in range(2):
        side = 1.0 - 2.0 * wall
        x = _deepest(side, u_a, (centre, closest), reach, prm)
        rho = math.sqrt(max(rr0 + x * (2.0 * rr1 + x * rr2), 0.0))
        delta = radius - s * (rho - prm[at.APEX]) + side * c * (y + x * u_a)
        deepest = max(deepest, delta)
        if delta <= 0.0 or outside:
            continue
        if u_a * u_a >= s * s:
            return STEEP
        lo, hi = _touched(side, u_a, y, distance_squared, reach, prm)
        first, last = min(first, lo), max(last, hi)
        middle, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
        for i in range(len(NODES)):
            x = middle + half * NODES[i]
            rho = math.sqrt(max(rr0 + x * (2.0 * rr1 + x * rr2), 1e-24))
            delta = radius - s * (rho - prm[at.APEX]) + side * c * (y + x * u_a)
            if delta <= 0.0:
                continue
            rate = side * c * (va0 + x * va1) - s * (vr0 + x * (vr1 + x * vr2)) / rho
            share = WEIGHTS[i] * half / prm[at.REFERENCE_LENGTH]
            elastic = share * k * _power(delta, n)
            f = _pressed(share, elastic, delta, rate, prm)
            normal += f
            power += (f - elastic) * rate
            energy += elastic * delta / (n + 1.0)
            sum_a -= side * c * f
            sum_ax -= side * c * f * x
            radial = s * f / rho
            sum_r += radial
            sum_rx += radial * x
            sum_rxx += radial * x * x

    out[at.DEEPEST] = min(deepest, 0.0) if outside else deepest  # beyond the rim there is no wall
    out[at.STATUS] = LEFT if left else OPEN
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
        out[at.CABLE_FORCE + i] = force[i]
        out[at.CABLE_MOMENT + i] = on_cable[i]
        out[at.WHEEL_FORCE + i] = -force[i]
        out[at.WHEEL_MOMENT + i] = -(lever[i] + about_foot[i])
    nearest = math.sqrt(max(rr0, 1e-24))
    out[at.RADIAL] = (force[0] * r[0] + force[1] * r[1] + force[2] * r[2]) / nearest
    out[at.LATERAL] = -_dot(force, a)
    out[at.NORMAL] = normal
    out[at.CONTACT_LENGTH] = last - first
    out[at.STATUS] = STICK if normal > 0.0 else OPEN
    out[at.WALL_POWER] = power
    out[at.WALL_ENERGY] = energy
    return OK


@kernel
def friction(prm, motion, slip, out):
    """Add the friction to what `walls` has written; the bristle is kept inside the Coulomb disc.

    The elongation is projected on the disc |k_t z| <= mu N, then the force k_t z + c_t v on the disc mu N.
    Both are projections on a convex set, so that neither can give back more energy than was put in.
    """
    kt, ct = prm[at.TANGENTIAL_STIFFNESS], prm[at.TANGENTIAL_DAMPING]
    limit = prm[at.FRICTION_COEFFICIENT] * out[at.NORMAL]
    if limit <= 0.0:
        return
    z0, z1 = slip[0], slip[1]
    v0, v1 = out[at.SLIP_VELOCITY], out[at.SLIP_VELOCITY + 1]
    elongation = kt * math.sqrt(z0 * z0 + z1 * z1)
    if elongation > limit:
        z0 *= limit / elongation
        z1 *= limit / elongation
        out[at.STATUS] = SLIP
    f0 = kt * z0 + ct * v0
    f1 = kt * z1 + ct * v1
    size = math.sqrt(f0 * f0 + f1 * f1)
    if size > limit:
        f0 *= limit / size
        f1 *= limit / size
    out[at.FRICTION], out[at.FRICTION + 1] = -f0, -f1
    out[at.ELONGATION], out[at.ELONGATION + 1] = z0, z1
    out[at.FRICTION_POWER] = (f0 - kt * z0) * v0 + (f1 - kt * z1) * v1
    if out[at.STATUS] == SLIP:
        out[at.FRICTION_POWER] += max(kt * (z0 * v0 + z1 * v1), 0.0)
    out[at.BRISTLE_ENERGY] = 0.5 * kt * (z0 * z0 + z1 * z1)

    _length, u, offset, d = foot(motion)
    b = lateral(u, axle(motion))
    force = (-f0 * u[0] - f1 * b[0], -f0 * u[1] - f1 * b[1], -f0 * u[2] - f1 * b[2])
    on_cable = _cross(u, force)
    on_wheel = _cross(d, force)
    for i in range(3):
        out[at.CABLE_FORCE + i] += force[i]
        out[at.CABLE_MOMENT + i] += offset * on_cable[i]
        out[at.WHEEL_FORCE + i] -= force[i]
        out[at.WHEEL_MOMENT + i] -= on_wheel[i]


@kernel
def contact_wrench(prm, motion, slip, out):
    """Write the contact law at one instant (eqs. 27-43 of Jia et al. 2025, geometry of README.md).

    Parameters
    ----------
    prm : (18,) of `law_parameters`
    motion : (24,) of cable point and wheel: places.py
    slip : (2,) m, trial elongation of the friction bristle along the cable and along the axle
    out : (34,) wrenches on cable and wheel, kinematics, powers and energies: places.py

    Returns
    -------
    int, OK or the cause of failure: no length of tangent or axle, motion not finite, cable too steep to the wheel
    """
    status = walls(prm, motion, out)
    if status == OK:
        friction(prm, motion, slip, out)
    return status
