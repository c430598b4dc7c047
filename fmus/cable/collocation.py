"""One inner step of the cable by two-stage collocation, Newton's method with a factorisation that is used again.

The iteration matrix is made at the start of a macro step and whenever Newton's method slows down. It is kept with what
it was made from: a macro step repeated from the same start, as an implicit master does, finds it ready, and as it is a
function of that start alone, the repetition is bit-identical.
"""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import constrain_vector, iteration_matrix, residual
from fmus.cable.ports import moment_work, port_loads
from fmus.cable.state import DISSIPATED, LAST_INNER, N_LOSSES, NOT_CONVERGED, OK
from fmus.kernels import banded
from fmus.kernels.jit import kernel
from fmus.kernels.time_integration import (
    DONE,
    FAILED,
    RENEW,
    accept,
    correct,
    judge,
    predict,
    stage,
    stage_distances,
    to_mode,
)

MAX_ITERATIONS = 12
SLOW = 0.25
"""Contraction of an iteration above which the iteration matrix is made anew."""


@kernel
def _same_key(key, q, v, h, ahead):
    """Return whether the factors kept were made from this state, step and look-ahead."""
    n = q.size
    if key[2 * n] != h or key[2 * n + 1] != ahead:
        return False
    for i in range(n):
        if key[i] != q[i] or key[n + i] != v[i]:
            return False
    return True


@kernel
def _matrix(model, method, q, v, h, band, work):
    """Write the factors of M + h λ C + h² λ² K at (q, v) to `band`; return the status."""
    z = h * method.eigenvalue
    iteration_matrix(model, q, v, 1.0 + 0.0j, z, z * z, band, work.matrix, work.element)
    return banded.factorise(band)


@kernel
def _first_matrix(model, method, q, v, a, h, ahead, work):
    """Make ready the factors for steps `h` from (q, v) on, unless they were made of just that; return the status.

    The tangent is taken `ahead` seconds later, on the parabola with the acceleration `a`: in the middle of the steps
    that it is to serve it contracts best. The factors are a function of the start alone.
    """
    work.late[0] = False
    if _same_key(work.key, q, v, h, ahead):
        return OK
    n = q.size
    for i in range(n):
        work.key[i] = q[i]
        work.key[n + i] = v[i]
        work.q[1, i] = q[i] + ahead * (v[i] + 0.5 * ahead * a[i])
        work.v[1, i] = v[i] + ahead * a[i]
    work.key[2 * n], work.key[2 * n + 1] = h, ahead
    return _matrix(model, method, work.q[1], work.v[1], h, work.band, work)


@kernel
def step(model, method, state, h, offset, ports, tolerance, ahead, work):
    """Advance the flat `state` by one inner step `h` of two-stage collocation.

    Parameters
    ----------
    offset : start of the step relative to the middle of the macro step, s
    ports : (N_PORTS, 14) s, force, moment, force rate, moment rate, rate of s, of each port
    tolerance : m, of a coordinate
    ahead : s, negative: go on with the iteration matrix of the step before; else one is made for so much later

    Returns
    -------
    status : OK or NOT_CONVERGED; the state is then undefined
    """
    n = model.weight.size
    q0, v0, a, sums = state[:n], state[n : 2 * n], state[2 * n : 4 * n].reshape(2, n), state[4 * n :]
    ratio = h / sums[LAST_INNER] if sums[LAST_INNER] > 0.0 else 0.0
    predict(a, method.c[1] - method.c[0], stage_distances(method, ratio), work.a)
    if ahead >= 0.0 and _first_matrix(model, method, q0, v0, a[1], h, ahead, work) != OK:
        return NOT_CONVERGED
    previous, left = np.inf, MAX_ITERATIONS
    while True:
        for j in range(2):
            q, v, force = work.q[j], work.v[j], work.residual[j]
            stage(method, j, h, q0, v0, work.a[0], work.a[1], q, v)
            port_loads(model, q, ports, offset + method.c[j] * h, work)
            material, mass, drag = residual(model, q, v, work.a[j], work.external, force, work.element)
            work.power[j, 0], work.power[j, 1], work.power[j, 2] = material, mass, drag
            constrain_vector(model, force)
        to_mode(method, work.residual, work.mode)
        banded.solve(work.late_band if work.late[0] else work.band, work.mode)
        change, left = correct(method, h, work.mode, work.a), left - 1
        verdict = judge(change, previous, left, tolerance, SLOW)
        if verdict == FAILED:
            return NOT_CONVERGED
        if verdict == DONE:
            break
        if verdict == RENEW:
            work.late[0] = True  # the factors made at the start are kept for its repetition
            if _matrix(model, method, work.q[1], work.v[1], h, work.late_band, work) != OK:
                return NOT_CONVERGED
        previous = change
    for j in range(2):
        weight = h * method.b[j]
        for i in range(N_LOSSES):
            sums[DISSIPATED + i] += weight * work.power[j, i]
        moment_work(model, work.q[j], work.v[j], ports, offset + method.c[j] * h, weight, sums, work)
    accept(method, h, q0, v0, work.a[0], work.a[1])
    for j in range(2):
        for i in range(n):
            a[j, i] = work.a[j, i]
    sums[LAST_INNER] = h
    return OK
