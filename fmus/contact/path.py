"""The motion of cable and wheel inside a macro step, rebuilt from what is known of it.

Everything is a polynomial in sigma = (tau - t) / h. A *path* (4, 21) holds the coefficients of 1, sigma, sigma^2,
sigma^3, a column each. The equations stand in README.md of this folder.

Where the cable point moves along the cable within the step, at the rate ds/dt, the path is that of the moving point; the
material under it has a velocity that is less by the *drift* ds/dt dr/ds, and a rate of the tangent less by ds/dt d²r/ds².
"""

from __future__ import annotations

import numpy as np

from fmus.contact import places as at
from fmus.kernels.jit import kernel

POINT, TANGENT, CENTRE, AXLE, ROTATION = 0, 3, 6, 9, 12
"""First columns of cable point, tangent, wheel centre, axle, and of the wheel's rotation since t."""
DRIFT = 15
"""First column of the cable point's drift, m/s, and three further that of the tangent's, 1/s."""
PATH_SHAPE = (4, 21)

VALUE = np.array([first + i for first in (at.POINT, at.TANGENT, at.CENTRE, at.AXLE) for i in range(3)])
"""Places in a motion of what stands in the first twelve columns."""
RATE = np.array([first + i for first in (at.POINT_RATE, at.TANGENT_RATE, at.CENTRE_RATE) for i in range(3)])
"""Places of the rates of the first nine."""


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
        i = VALUE[j]
        _quadratic(path, j, start[i], inputs[i], inputs[at.MEANS + j])
    for j in range(3):
        _quadratic(path, ROTATION + j, 0.0, inputs[at.ROTATION + j], inputs[at.ROTATION_MEAN + j])


@kernel
def rotation_given(inputs):
    """Tell whether the wheel's rotation over the step is connected: it is not zero when it turns."""
    return inputs[at.ROTATION] != 0.0 or inputs[at.ROTATION + 1] != 0.0 or inputs[at.ROTATION + 2] != 0.0


@kernel
def hermite_path(start, inputs, h, along, curvature, path):
    """Rebuild the motion as cubics from positions and velocities at both ends.

    Parameters
    ----------
    along : ds/dt of the cable point, m/s; curvature : (3,) at the start, 1/m
    """
    for j in range(9):
        i, k = VALUE[j], RATE[j]
        rate0, rate1 = start[k], inputs[k]
        if j < TANGENT:
            rate0, rate1 = rate0 + along * start[at.TANGENT + j], rate1 + along * inputs[at.TANGENT + j]
        elif j < CENTRE:
            rate0 += along * curvature[j - TANGENT]
            rate1 += along * inputs[at.CURVATURE + j - TANGENT]
        _cubic(path, j, start[i], inputs[i], h * rate0, h * rate1)
    given = rotation_given(inputs)
    for j in range(3):
        rate0, rate1 = _axle_rate(start, j), _axle_rate(inputs, j)
        _cubic(path, AXLE + j, start[at.AXLE + j], inputs[at.AXLE + j], h * rate0, h * rate1)
        om0, om1 = start[at.TURN_RATE + j], inputs[at.TURN_RATE + j]
        angle = inputs[at.ROTATION + j] if given else 0.5 * h * (om0 + om1)
        _cubic(path, ROTATION + j, 0.0, angle, h * om0, h * om1)


@kernel
def _axle_rate(motion, j):
    """Return component j of the axle's rate, angular velocity times axle."""
    k, l = (j + 1) % 3, (j + 2) % 3
    return motion[at.TURN_RATE + k] * motion[at.AXLE + l] - motion[at.TURN_RATE + l] * motion[at.AXLE + k]


@kernel
def straight_path(start, inputs, h, path):
    """Join start and end motion by straight lines."""
    given = rotation_given(inputs)
    for j in range(15):
        first = start[VALUE[j]] if j < ROTATION else 0.0
        if j < ROTATION:
            end = inputs[VALUE[j]]
        elif given:
            end = inputs[at.ROTATION + j - ROTATION]
        else:
            turn = at.TURN_RATE + j - ROTATION
            end = 0.5 * h * (start[turn] + inputs[turn])
        path[0, j] = first
        path[1, j] = end - first
        path[2, j] = path[3, j] = 0.0


@kernel
def drift_along(path, h, along, curvature, inputs):
    """Write the drift of a path whose cable point moves at the rate `along`, m/s; `curvature` (3,) is that at the start.

    Of the tangent the projection on linear functions is taken: the point's velocity then stays what the force's mean and
    slope do work on. The tangent's own drift is linear, too, with the mean that leaves the mean of its rate: a curvature
    that jumps within the step, where elements meet, is counted by what it does.
    """
    for i in range(3):
        a, b, c = path[1, TANGENT + i], path[2, TANGENT + i], path[3, TANGENT + i]
        slope = a + b + 0.9 * c
        path[0, DRIFT + i] = along * (path[0, TANGENT + i] + a / 2.0 + b / 3.0 + c / 4.0 - 0.5 * slope)
        path[1, DRIFT + i] = along * slope
        bend = along * (inputs[at.CURVATURE + i] - curvature[i])
        mean = (a + b + c) / h - inputs[at.TURN_MEAN + i] if along != 0.0 else 0.0
        path[0, DRIFT + 3 + i] = mean - 0.5 * bend
        path[1, DRIFT + 3 + i] = bend


@kernel
def drift_work(path, h, wrench, o):
    """Return the work, J, that the force in `wrench` would do along the drift of its point."""
    work = 0.0
    for i in range(3):
        slope = path[1, DRIFT + i]
        work += wrench[o + i] * h * (path[0, DRIFT + i] + 0.5 * slope) + wrench[o + 6 + i] * h * h * slope / 12.0
    return work


@kernel
def motion_at(path, sigma, h, motion):
    """Write the motion (24,) on a path."""
    for j in range(15):
        value = path[0, j] + sigma * (path[1, j] + sigma * (path[2, j] + sigma * path[3, j]))
        rate = (path[1, j] + sigma * (2.0 * path[2, j] + sigma * 3.0 * path[3, j])) / h
        if j < ROTATION:
            motion[VALUE[j]] = value
        if j < AXLE:
            motion[RATE[j]] = rate
            if j < CENTRE:
                motion[RATE[j]] -= path[0, DRIFT + j] + sigma * path[1, DRIFT + j]
        elif j >= ROTATION:
            motion[at.TURN_RATE + j - ROTATION] = rate


@kernel
def path_work(path, first, h, wrench, o):
    """Return F.dx + Fdot.(h/2 (x0 + x1) - h x_mean) of what stands in three columns of a path from `first` on.

    F stands in `wrench` from `o` on, its slope six places further.
    """
    work = 0.0
    for i in range(3):
        j = first + i
        x0, dx = path[0, j], path[1, j] + path[2, j] + path[3, j]
        mean = x0 + path[1, j] / 2.0 + path[2, j] / 3.0 + path[3, j] / 4.0
        work += wrench[o + i] * dx + wrench[o + 6 + i] * (0.5 * h * (2.0 * x0 + dx) - h * mean)
    return work
