"""The contact over a macro step: the motion inside it, the law along it, the force's mean and slope.

Everything is a polynomial in sigma = (tau - t) / h. A *path* (4, 15) holds the coefficients of 1, sigma,
sigma^2, sigma^3 of cable point p 0:3, tangent 3:6, wheel centre 6:9, axle 9:12 and of the wheel's rotation
since t 12:15. The equations stand in README.md of this folder.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from fmus.contact.law import LEFT, OK, SLIP, axle, foot, friction, lateral, walls
from fmus.kernels.jit import kernel

POINT, WAVEFORM, HERMITE = 0, 1, 2

# places in the inputs (45,)
_MOTION, _MEANS, _ROTATION, _ROTATION_MEAN, _CURVATURE = 0, 24, 36, 39, 42
INPUT_SIZE = 45

# places in the state
LAST = 0  # 0:24 motion at the last communication point, as it came in
BRISTLE = 24  # 24:26 elongation, m
ARC = 26  # arc length of the contact point, m
SHIFT = 27  # by how much it moved at the last communication point, m
STORED = 28  # elastic energy of walls and bristle, J
DISSIPATED = 29
WORK_CABLE = 30
WORK_WHEEL = 31
SLIDES = 32  # 1 if the bristle slides at the last communication point
GONE = 33  # 1 once the cable has left the groove
LAST_STEP = 34  # length of the last macro step, s
CURVATURE = 35  # 35:38 of the cable at the last communication point, 1/m
STATE_SIZE = 38

# places in the outputs
O_CABLE, O_WHEEL = 0, 12  # each force, moment, force rate, moment rate
O_ARC, O_NORMAL, O_FRICTION, O_DEEPEST, O_SLIP, O_LENGTH, O_STATUS = range(24, 31)
O_DISSIPATED, O_STRAIN, O_WORK_CABLE, O_WORK_WHEEL = range(31, 35)
OUTPUT_SIZE = 35

_VALUE = np.array([0, 1, 2, 3, 4, 5, 12, 13, 14, 15, 16, 17])
"""Places in a motion of p, t, w, a, in the order of a path; their rates stand in `_RATE`."""
_RATE = np.array([6, 7, 8, 9, 10, 11, 18, 19, 20])


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
def _quadratic(path, j, start, end, mean):
    """Write column j of a path: the quadratic through start and end with the given mean."""
    b = 6.0 * (0.5 * (start + end) - mean)
    path[0, j] = start
    path[1, j] = end - start - b
    path[2, j] = b
    path[3, j] = 0.0


@kernel
def _cubic(path, j, start, end, slope0, slope1):
    """Write column j of a path: the cubic Hermite polynomial; the slopes are derivatives by sigma."""
    path[0, j] = start
    path[1, j] = slope0
    path[2, j] = 3.0 * (end - start) - 2.0 * slope0 - slope1
    path[3, j] = slope0 + slope1 - 2.0 * (end - start)


@kernel
def waveform_path(start, inputs, path):
    """Rebuild the motion as quadratics from start motion, end motion and time means."""
    for j in range(12):
        i = _VALUE[j]
        _quadratic(path, j, start[i], inputs[i], inputs[_MEANS + j])
    for j in range(3):
        _quadratic(path, 12 + j, 0.0, inputs[_ROTATION + j], inputs[_ROTATION_MEAN + j])


@kernel
def _rotation_given(inputs):
    """Tell whether the wheel's rotation over the step is connected: it is not zero when it turns."""
    return inputs[_ROTATION] != 0.0 or inputs[_ROTATION + 1] != 0.0 or inputs[_ROTATION + 2] != 0.0


@kernel
def hermite_path(start, inputs, h, path):
    """Rebuild the motion as cubics from positions and velocities at both ends."""
    for j in range(9):
        i, k = _VALUE[j], _RATE[j]
        _cubic(path, j, start[i], inputs[i], h * start[k], h * inputs[k])
    given = _rotation_given(inputs)
    for j in range(3):
        k, l = (j + 1) % 3, (j + 2) % 3
        rate0 = start[21 + k] * start[15 + l] - start[21 + l] * start[15 + k]
        rate1 = inputs[21 + k] * inputs[15 + l] - inputs[21 + l] * inputs[15 + k]
        _cubic(path, 9 + j, start[15 + j], inputs[15 + j], h * rate0, h * rate1)
        om0, om1 = start[21 + j], inputs[21 + j]
        angle = inputs[_ROTATION + j] if given else 0.5 * h * (om0 + om1)
        _cubic(path, 12 + j, 0.0, angle, h * om0, h * om1)


@kernel
def straight_path(start, inputs, h, path):
    """Join start and end motion by straight lines."""
    given = _rotation_given(inputs)
    for j in range(15):
        first = start[_VALUE[j]] if j < 12 else 0.0
        if j < 12:
            end = inputs[_VALUE[j]]
        elif given:
            end = inputs[_ROTATION + j - 12]
        else:
            end = 0.5 * h * (start[9 + j] + inputs[9 + j])
        path[0, j] = first
        path[1, j] = end - first
        path[2, j] = path[3, j] = 0.0


@kernel
def motion_at(path, sigma, h, motion):
    """Write the motion (24,) on a path."""
    for j in range(15):
        value = path[0, j] + sigma * (path[1, j] + sigma * (path[2, j] + sigma * path[3, j]))
        rate = (path[1, j] + sigma * (2.0 * path[2, j] + sigma * 3.0 * path[3, j])) / h
        if j < 12:
            motion[_VALUE[j]] = value
        if j < 9:
            motion[_RATE[j]] = rate
        elif j >= 12:
            motion[9 + j] = rate


@kernel
def _work(path, first, h, force, o):
    """Return F.dx + Fdot.(h/2 (x0 + x1) - h x_mean) of one body's translation: three columns from `first`."""
    work = 0.0
    for i in range(3):
        j = first + i
        x0, dx = path[0, j], path[1, j] + path[2, j] + path[3, j]
        mean = x0 + path[1, j] / 2.0 + path[2, j] / 3.0 + path[3, j] / 4.0
        work += force[o + i] * dx + force[o + 6 + i] * (0.5 * h * (2.0 * x0 + dx) - h * mean)
    return work


@kernel
def _tangent_work(motion, dt, ds, force, o):
    """Return the work in dt, at ds from the middle of the step, of the moment on the tangent's rotation."""
    squared = motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2
    work = 0.0
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        rate = (motion[3 + k] * motion[9 + l] - motion[3 + l] * motion[9 + k]) / squared
        work += (force[o + 3 + i] + force[o + 9 + i] * ds) * rate
    return work * dt


@kernel
def _advance_bristle(prm, motion, trial, sample, z, slides):
    """Return the plastic dissipation of one piece of path; the law limits the bristle, `z` is renewed.

    The bristle's force during sliding is the trapezoid of both ends where it was sliding before, else the
    end's.
    """
    friction(prm, motion, trial, sample)
    plastic0, plastic1 = trial[0] - sample[21], trial[1] - sample[22]
    before = z[0] * plastic0 + z[1] * plastic1
    lost = sample[21] * plastic0 + sample[22] * plastic1
    if slides and before > 0.0:
        lost = 0.5 * (lost + before)
    z[0], z[1] = sample[21], sample[22]
    return prm[9] * lost


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
    motions, samples : (m + 1, 24) and (m + 1, 32), written

    Returns
    -------
    status of the law, energy dissipated (J)
    """
    m = len(nodes)
    for i in range(m):
        motion_at(path, nodes[i], h, motions[i])
    for j in range(24):
        motions[m, j] = end[j]
    for i in range(m + 1):
        bend(motions[i], curvature)
        status = walls(prm, motions[i], samples[i])
        if status != OK:
            return status, 0.0
    bristle = 0.5 * prm[9] * (z[0] ** 2 + z[1] ** 2)
    dissipated = 0.0
    trial = samples[m, 27:29]
    for i in range(m + 1):
        trial[0], trial[1] = z[0], z[1]
        for j in range(m):
            trial[0] += h * increments[i, j] * samples[j, 16]
            trial[1] += h * increments[i, j] * samples[j, 17]
        row = samples[i]
        friction(prm, motions[i], trial, row)
        z[0], z[1] = row[21], row[22]
        if i < m:
            # what friction does on both bodies, at the points where its force is sampled
            dissipated += h * weights[i] * (row[23] - row[13] * row[16] - row[14] * row[17])
    return OK, dissipated + bristle - samples[m, 26]


@kernel
def project_force(samples, nodes, weights, h, outputs):
    """Write the mean and slope of the sampled forces and moments: their L2 projection on linear functions."""
    for i in range(12):
        mean = slope = 0.0
        for k in range(len(nodes)):
            value = weights[k] * samples[k, i]
            mean += value
            slope += value * (nodes[k] - 0.5)
        # rows of a sample: force, moment of the cable, then of the wheel
        o = i if i < 6 else i + 6
        outputs[o] = mean
        outputs[o + 6] = 12.0 / h * slope


@kernel
def _same(inputs, state, first, n):
    """Tell whether n inputs from `first` are bit for bit those of the last communication point."""
    same = True
    for i in range(first, first + n):
        same = same and inputs[i] == state[LAST + i]
    return same


@kernel
def start_motion(state, start):
    """Write the last communication point's motion, its cable point moved along the cable."""
    for i in range(24):
        start[i] = state[LAST + i]
    shift = state[SHIFT]
    for i in range(3):
        start[i] += shift * (start[3 + i] + 0.5 * shift * state[CURVATURE + i])
        start[3 + i] += shift * state[CURVATURE + i]
        start[6 + i] += shift * start[9 + i]


@kernel
def bend(motion, curvature):
    """Turn the straight cable of a motion into the tangent of the curved one, at the foot of the wheel.

    At the distance x of the foot from p the cable is at p + x t + x²/2 c and points along t + x c; the line through
    that point is written as one through p - x²/2 c.
    """
    length, _u, offset, _d = foot(motion)
    x = offset / length
    if not math.isfinite(x):
        return  # the law says what is wrong
    for i in range(3):
        motion[i] -= 0.5 * x * x * curvature[i]
        motion[3 + i] += x * curvature[i]


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
        way = end[i] - start[i] + x * (u1[i] - u0[i]) - (end[12 + i] - start[12 + i]) - turn
        slip[0] += way * u[i] / norm
        slip[1] += way * b[i]


@kernel
def _passed_axle(start, end):
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
def write_instant(sample, outputs):
    """Write the outputs that belong to one instant: normal force to status, elastic energy."""
    outputs[O_NORMAL] = sample[12]
    outputs[O_FRICTION] = math.sqrt(sample[13] ** 2 + sample[14] ** 2)
    outputs[O_DEEPEST] = sample[15]
    outputs[O_SLIP] = math.sqrt(sample[16] ** 2 + sample[17] ** 2)
    outputs[O_LENGTH] = sample[18]
    outputs[O_STATUS] = sample[19]
    outputs[O_STRAIN] = sample[25] + sample[26]


@kernel
def write_memory(state, outputs):
    """Write the outputs that the state remembers."""
    outputs[O_ARC] = state[ARC]
    outputs[O_DISSIPATED] = state[DISSIPATED]
    outputs[O_WORK_CABLE] = state[WORK_CABLE]
    outputs[O_WORK_WHEEL] = state[WORK_WHEEL]


@kernel
def _write_point(sample, outputs):
    """Write forces and moments of one sample, with no slope."""
    for i in range(6):
        outputs[O_CABLE + i], outputs[O_WHEEL + i] = sample[i], sample[6 + i]
        outputs[O_CABLE + 6 + i] = outputs[O_WHEEL + 6 + i] = 0.0


@kernel
def silence(sample):
    """Clear all forces and energies of a sample: the cable has left the groove."""
    for i in range(15):
        sample[i] = 0.0
    sample[18] = sample[21] = sample[22] = sample[23] = sample[24] = sample[25] = sample[26] = 0.0
    sample[19] = LEFT


@kernel
def refresh(prm, inputs, state, motions, samples, outputs):
    """Write the outputs at the instant of the inputs; the state stays. Return the status of the law.

    The bristle is led on from the last communication point to the inputs. Inputs that have not changed since
    then have not moved: neither does the new cable point count nor the wheel's rotation over the step that is
    past.
    """
    start, row, end = motions[0], samples[0], inputs[:24]
    status = walls(prm, end, row)
    if status != OK:
        return status
    start_motion(state, start)
    if _same(inputs, state, 0, 12):
        for i in range(12):
            start[i] = state[LAST + i]
    slip, rotation = samples[1, 0:2], samples[1, 2:5]
    turned = not _same(inputs, state, 12, 12)
    given = _rotation_given(inputs)
    for i in range(3):
        angle = inputs[_ROTATION + i] if given else 0.5 * state[LAST_STEP] * (start[21 + i] + end[21 + i])
        rotation[i] = angle if turned else 0.0
    slip_displacement(start, end, rotation, slip)
    slip[0] += state[BRISTLE]
    slip[1] += state[BRISTLE + 1]
    friction(prm, end, slip, row)
    if state[GONE] != 0.0:
        silence(row)
    _write_point(row, outputs)
    write_instant(row, outputs)
    write_memory(state, outputs)
    return OK


@kernel
def _point_step(prm, path, h, start, end, z, slides, row, outputs):
    """Advance by the law at the end of the step; return its status and the energy dissipated."""
    status = walls(prm, end, row)
    if status != OK:
        return status, 0.0
    trial = row[27:29]
    rotation = (path[1, 12], path[1, 13], path[1, 14])
    slip_displacement(start, end, rotation, trial)
    trial[0] += z[0]
    trial[1] += z[1]
    dissipated = _advance_bristle(prm, end, trial, row, z, slides)
    viscous = -row[16] * (row[13] + prm[9] * z[0]) - row[17] * (row[14] + prm[9] * z[1])
    _write_point(row, outputs)
    return OK, dissipated + h * (row[23] + viscous)


@kernel
def step(prm, method, inputs, h, nodes, weights, increments, state, path, motions, samples, outputs):
    """Advance the contact over one macro step; the inputs hold the motion at its end and the means over it.

    Parameters
    ----------
    prm : (14,); method : 0 point, 1 waveform, 2 hermite; inputs : (45,); h : s
    nodes, weights, increments : of `gauss_rule(m)`
    state : (38,), advanced; outputs : (35,), written
    path, motions, samples : (4, 15), (m + 2, 24), (m + 1, 32) work space

    Returns
    -------
    int, status of the law
    """
    m = len(nodes)
    start, end, last = motions[m + 1], inputs[:24], samples[m]
    z = state[BRISTLE : BRISTLE + 2]
    slides = state[SLIDES] != 0.0
    start_motion(state, start)
    if method == POINT:
        straight_path(start, inputs, h, path)
        status, dissipated = _point_step(prm, path, h, start, end, z, slides, last, outputs)
    else:
        if method == WAVEFORM:
            waveform_path(start, inputs, path)
        else:
            hermite_path(start, inputs, h, path)
        status, dissipated = sample_law(
            prm, path, h, nodes, weights, increments, end, inputs[_CURVATURE : _CURVATURE + 3], z, motions, samples
        )
    if status != OK:
        return status
    if method != POINT:
        project_force(samples, nodes, weights, h, outputs)

    if state[GONE] != 0.0:
        silence(last)
        _write_point(last, outputs)
        z[0] = z[1] = dissipated = 0.0
    work_cable = _work(path, 0, h, outputs, O_CABLE)
    if method == POINT:
        motion_at(path, 0.5, h, motions[0])
        work_cable += _tangent_work(motions[0], h, 0.0, outputs, O_CABLE)
    else:
        for i in range(m):
            ds = h * (nodes[i] - 0.5)
            work_cable += _tangent_work(motions[i], h * weights[i], ds, outputs, O_CABLE)
    work_wheel = _work(path, 6, h, outputs, O_WHEEL) + _work(path, 12, h, outputs, O_WHEEL + 3)

    if state[GONE] == 0.0 and (last[19] == LEFT or _passed_axle(start, end)):
        # what the walls and the bristle had stored is not given back
        state[GONE] = 1.0
        silence(last)
        z[0] = z[1] = 0.0
        dissipated = state[STORED] - work_cable - work_wheel
    state[STORED] = last[25] + last[26]
    state[DISSIPATED] += dissipated
    state[WORK_CABLE] += work_cable
    state[WORK_WHEEL] += work_wheel
    state[SLIDES] = 1.0 if last[19] == SLIP else 0.0
    state[SHIFT] = last[20] if state[GONE] == 0.0 else 0.0
    state[ARC] += state[SHIFT]
    state[LAST_STEP] = h
    for i in range(24):
        state[LAST + i] = end[i]
    for i in range(3):
        state[CURVATURE + i] = inputs[_CURVATURE + i]
    write_instant(last, outputs)
    write_memory(state, outputs)
    return OK
