"""The contact law along a path: sampled at Gauss points, its force projected, the bristle led on, the work booked."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from fmus.contact import path as columns
from fmus.contact import places as at
from fmus.contact.law import LEFT, OK, axle, foot, friction, lateral, walls
from fmus.contact.path import motion_at
from fmus.kernels.jit import kernel

FOOT_ITERATIONS = 6
FOOT_ERROR = 1e-13
"""m; each iteration shrinks the error by curvature times the wheel's distance, 1e-2 or less for a wheel on the cable."""


def gauss_rule(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights on [0, 1] and the rule's integrals between the nodes.

    Returns
    -------
    nodes, weights : (n,)
    increments : (n + 1, n); row i integrates the interpolant from node i - 1 (or 0) to node i (or 1)
    """
    x, w = legendre.leggauss(n)
    ends = np.append(x, 1.0)
    # the interpolant in Legendre polynomials, integrated from -1 by (2k + 1) int P_k = P_{k+1} - P_{k-1}
    antiderivative = legendre.legvander(ends, n)[:, 1:]
    antiderivative[:, 1:] -= legendre.legvander(ends, n - 2)
    antiderivative[:, 0] += 1.0
    integrals = 0.25 * antiderivative @ (legendre.legvander(x, n - 1).T * w)
    return 0.5 * (x + 1.0), 0.5 * w, np.diff(integrals, axis=0, prepend=0.0)


@kernel
def sample_law(prm, path, h, nodes, weights, increments, end, curvature, z, motions, samples):
    """Sample the law along a path and at the end motion.

    What friction dissipates is its work, in the same quadrature as the forces' work, less what the bristle stores: the
    books balance whether it sticks or slides.

    Parameters
    ----------
    prm : the law's parameters; path : (4, 15); h : s
    nodes, weights, increments : of `gauss_rule(m)`
    end : (24,) motion at the end of the step
    curvature : (3,) of the cable, 1/m
    z : (2,) bristle at the start; becomes that at the end
    motions, samples : (m + 1, 24) and (m + 1, 34), written; may be longer

    Returns
    -------
    status of the law, energy dissipated (J)
    """
    m = len(nodes)
    for i in range(m):
        motion_at(path, nodes[i], h, motions[i])
    for j in range(at.MOTION_SIZE):
        motions[m, j] = end[j]
    for i in range(m + 1):
        bend(motions[i], curvature)
        status = walls(prm, motions[i], samples[i])
        if status != OK:
            return status, 0.0
    bristle = 0.5 * prm[at.TANGENTIAL_STIFFNESS] * (z[0] ** 2 + z[1] ** 2)
    dissipated = 0.0
    for i in range(m + 1):
        _lead_bristle(prm, h, increments[i], i, z, motions, samples)
        if i < m:  # what walls and friction do on both bodies, at the points where their force is sampled
            dissipated += h * weights[i] * _lost_power(samples[i])
    return OK, dissipated + bristle - samples[m, at.BRISTLE_ENERGY]


@kernel
def sample_walls(prm, path, h, nodes, curvature, motions, samples):
    """Write the motions at the Gauss points and the end of a path, and what the walls do at the Gauss points; return the
    status of the law."""
    motion_at(path, 1.0, h, motions[len(nodes)])
    for i in range(len(nodes)):
        motion_at(path, nodes[i], h, motions[i])
        bend(motions[i], curvature)
        status = walls(prm, motions[i], samples[i])
        if status != OK:
            return status
    return OK


@kernel
def _lead_bristle(prm, h, increments, i, z, motions, samples):
    """Lead the bristle `z` (2,) on to sample i by the slip since the sample before, and add the friction there."""
    m = len(increments)
    trial, slip = samples[m, at.SCRATCH : at.SCRATCH + 2], at.SLIP_VELOCITY
    trial[0], trial[1] = z[0], z[1]
    for j in range(m):
        trial[0] += h * increments[j] * samples[j, slip]
        trial[1] += h * increments[j] * samples[j, slip + 1]
    friction(prm, motions[i], trial, samples[i])
    z[0], z[1] = samples[i, at.ELONGATION], samples[i, at.ELONGATION + 1]


@kernel
def _lost_power(out):
    """Return the power (W) that the walls dissipate and friction takes from both bodies."""
    along = out[at.FRICTION] * out[at.SLIP_VELOCITY]
    return out[at.WALL_POWER] - along - out[at.FRICTION + 1] * out[at.SLIP_VELOCITY + 1]


@kernel
def project_force(samples, nodes, weights, h, outputs):
    """Write the mean and slope of the sampled forces and moments: their L2 projection on linear functions."""
    for i in range(at.WRENCHES):
        mean = slope = 0.0
        for k in range(len(nodes)):
            value = weights[k] * samples[k, i]
            mean += value
            slope += value * (nodes[k] - 0.5)
        # rows of a sample: force, moment of the cable, then of the wheel
        o = at.O_CABLE + i if i < at.WHEEL_FORCE else at.O_WHEEL + i - at.WHEEL_FORCE
        outputs[o] = mean
        outputs[o + 6] = 12.0 / h * slope


@kernel
def point_law(prm, path, h, start, end, z, slides, row):
    """Evaluate the law at the end of the step; return its status and the energy dissipated."""
    status = walls(prm, end, row)
    if status != OK:
        return status, 0.0
    trial = row[at.SCRATCH : at.SCRATCH + 2]
    first = columns.ROTATION
    rotation = (path[1, first], path[1, first + 1], path[1, first + 2])
    slip_displacement(start, end, rotation, trial)
    trial[0] += z[0]
    trial[1] += z[1]
    dissipated = _advance_bristle(prm, end, trial, row, z, slides)
    stiffness = prm[at.TANGENTIAL_STIFFNESS]
    viscous = -row[at.SLIP_VELOCITY] * (row[at.FRICTION] + stiffness * z[0])
    viscous -= row[at.SLIP_VELOCITY + 1] * (row[at.FRICTION + 1] + stiffness * z[1])
    return OK, dissipated + h * (row[at.WALL_POWER] + viscous)


@kernel
def _advance_bristle(prm, motion, trial, sample, z, slides):
    """Return the plastic dissipation of one piece of path; the law limits the bristle, `z` is renewed.

    The bristle's force during sliding is the trapezoid of both ends where it was sliding before, else the
    end's.
    """
    friction(prm, motion, trial, sample)
    z0, z1 = sample[at.ELONGATION], sample[at.ELONGATION + 1]
    plastic0, plastic1 = trial[0] - z0, trial[1] - z1
    before = z[0] * plastic0 + z[1] * plastic1
    lost = z0 * plastic0 + z1 * plastic1
    if slides and before > 0.0:
        lost = 0.5 * (lost + before)
    z[0], z[1] = z0, z1
    return prm[at.TANGENTIAL_STIFFNESS] * lost


@kernel
def tangent_work(motion, dt, ds, force, o):
    """Return the work in dt, at ds from the middle of the step, of the moment on the tangent's rotation."""
    t, dt_ds = at.TANGENT, at.TANGENT_RATE
    squared = motion[t] ** 2 + motion[t + 1] ** 2 + motion[t + 2] ** 2
    work = 0.0
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        rate = (motion[t + k] * motion[dt_ds + l] - motion[t + l] * motion[dt_ds + k]) / squared
        work += (force[o + 3 + i] + force[o + 9 + i] * ds) * rate
    return work * dt


@kernel
def bend(motion, curvature):
    """Turn the straight cable of a motion into the tangent of the curved one, at the foot of the wheel.

    At the distance x of the foot from p the cable is at p + x t + x²/2 c and points along t + x c; the line through
    that point is written as one through p - x²/2 c. The foot is that on the bent line: x is iterated, for as long as it
    comes nearer.
    """
    length, _u, offset, _d = foot(motion)
    x = offset / length
    if not math.isfinite(x):
        return  # the law says what is wrong
    p0, p1, p2 = motion[at.POINT], motion[at.POINT + 1], motion[at.POINT + 2]
    t0, t1, t2 = motion[at.TANGENT], motion[at.TANGENT + 1], motion[at.TANGENT + 2]
    change = math.inf
    for _ in range(FOOT_ITERATIONS):
        _bent_at(x, (p0, p1, p2), (t0, t1, t2), curvature, motion)
        length, _u, offset, _d = foot(motion)
        step = offset / length - x
        if not abs(step) < change or abs(step) < FOOT_ERROR:
            break
        x, change = x + step, abs(step)
    _bent_at(x, (p0, p1, p2), (t0, t1, t2), curvature, motion)


@kernel
def _bent_at(x, p, t, curvature, motion):
    """Write the line that touches the cable through p along t, with its `curvature`, at the distance x from p."""
    for i in range(3):
        motion[at.POINT + i] = p[i] - 0.5 * x * x * curvature[i]
        motion[at.TANGENT + i] = t[i] + x * curvature[i]


@kernel
def slip_displacement(start, end, rotation, slip):
    """Write how far the cable has slipped on the wheel between two motions, in their mean frame: (2,) m."""
    _l0, u0, x0, d0 = foot(start)
    _l1, u1, x1, d1 = foot(end)
    a0, a1 = axle(start), axle(end)
    x = 0.5 * (x0 + x1)
    u = (0.5 * (u0[0] + u1[0]), 0.5 * (u0[1] + u1[1]), 0.5 * (u0[2] + u1[2]))
    b = lateral(u, (0.5 * (a0[0] + a1[0]), 0.5 * (a0[1] + a1[1]), 0.5 * (a0[2] + a1[2])))
    norm = math.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)
    slip[0] = slip[1] = 0.0
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        turn = 0.5 * (rotation[k] * (d0[l] + d1[l]) - rotation[l] * (d0[k] + d1[k]))
        point, centre = end[at.POINT + i] - start[at.POINT + i], end[at.CENTRE + i] - start[at.CENTRE + i]
        way = point + x * (u1[i] - u0[i]) - centre - turn
        slip[0] += way * u[i] / norm
        slip[1] += way * b[i]


@kernel
def passed_axle(start, end):
    """Tell whether the wheel has jumped through the cable: the radial direction is reversed."""
    _l0, _u0, _x0, d0 = foot(start)
    _l1, _u1, _x1, d1 = foot(end)
    a0, a1 = axle(start), axle(end)
    y0 = d0[0] * a0[0] + d0[1] * a0[1] + d0[2] * a0[2]
    y1 = d1[0] * a1[0] + d1[1] * a1[1] + d1[2] * a1[2]
    across = 0.0
    for i in range(3):
        across += (d0[i] - y0 * a0[i]) * (d1[i] - y1 * a1[i])
    return across < 0.0


@kernel
def silence(out):
    """Clear all forces and energies that the law has written: the cable has left the groove."""
    for i in range(at.DEEPEST):
        out[i] = 0.0
    out[at.CONTACT_LENGTH] = 0.0
    for i in range(at.ELONGATION, at.SCRATCH):
        out[i] = 0.0
    out[at.STATUS] = LEFT
