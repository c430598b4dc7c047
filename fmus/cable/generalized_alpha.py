"""One inner step of the cable by generalized-alpha: Chung & Hulbert 1993, eqs. (5)–(9)."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import add_inertia, constrain_vector, iteration_matrix, residual
from fmus.cable.collocation import MAX_ITERATIONS, SLOW
from fmus.cable.ports import moment_work, port_loads
from fmus.cable.state import DISSIPATED, LAST_INNER, NOT_CONVERGED, OK
from fmus.kernels import banded
from fmus.kernels.jit import kernel
from fmus.kernels.time_integration import DONE, FAILED, RENEW, judge


@kernel
def _midpoint(method, h, q0, v0, a0, work):
    """Write the motion at the generalised midpoint: q, v and ``work.a[1]``, from the end's acceleration ``work.a[0]``."""
    am, af, beta, gamma = method.alpha_m, method.alpha_f, method.beta, method.gamma
    a1 = work.a[0]
    for i in range(q0.size):
        work.a[1, i] = (1.0 - am) * a1[i] + am * a0[i]
        work.q[0, i] = q0[i] + (1.0 - af) * h * (v0[i] + h * ((0.5 - beta) * a0[i] + beta * a1[i]))
        work.v[0, i] = v0[i] + (1.0 - af) * h * ((1.0 - gamma) * a0[i] + gamma * a1[i])


@kernel
def _correct(scale, work):
    """Improve the end's acceleration by one solve; return the largest change of a coordinate, infinite if not finite."""
    change = 0.0
    for i in range(work.increment.size):
        work.increment[i] = -work.residual[0, i]
    banded.solve(work.real_band, work.increment)
    for i in range(work.increment.size):
        work.a[0, i] += work.increment[i]
        if not abs(work.increment[i]) < np.inf:
            return np.inf
        change = max(change, scale * abs(work.increment[i]))
    return change


@kernel
def step(model, method, state, h, offset, ports, tolerance, fresh, work):
    """Advance the flat `state` by one inner step; a `fresh` one makes the iteration matrix anew, else see collocation.py.

    Chung & Hulbert 1993, eqs. (5)–(9), with all forces at the generalised midpoint t + (1 - alpha_f) h: the load of a
    macro step is then never taken from its neighbour. The first row of accelerations is a, the second its value at the
    midpoint. `start` and `end` enclose the inner steps of a macro step.
    """
    n = model.weight.size
    q0, v0, a, sums = state[:n], state[n : 2 * n], state[2 * n : 4 * n].reshape(2, n), state[4 * n :]
    am, af, beta, gamma = method.alpha_m, method.alpha_f, method.beta, method.gamma
    cm, cv, cq = 1.0 - am, (1.0 - af) * gamma * h, (1.0 - af) * beta * h * h
    q, v, a1 = work.q[0], work.v[0], work.a[0]
    if fresh:
        iteration_matrix(model, q0, v0, cm, cv, cq, work.real_band, work.real_matrix, work.element)
        if banded.factorise(work.real_band) != OK:
            return NOT_CONVERGED
    for i in range(n):
        a1[i] = a[0, i]
    previous, left, at = np.inf, MAX_ITERATIONS, offset + (1.0 - af) * h
    while True:
        _midpoint(method, h, q0, v0, a[0], work)
        port_loads(model, q, ports, at, work)
        material, mass, drag = residual(model, q, v, work.a[1], work.external, work.residual[0], work.element)
        constrain_vector(model, work.residual[0])
        change, left = _correct(cq, work), left - 1
        verdict = judge(change, previous, left, tolerance, SLOW)
        if verdict == FAILED:
            return NOT_CONVERGED
        if verdict == DONE:
            break
        if verdict == RENEW:
            iteration_matrix(model, q, v, cm, cv, cq, work.real_band, work.real_matrix, work.element)
            if banded.factorise(work.real_band) != OK:
                return NOT_CONVERGED
        previous = change
    sums[DISSIPATED] += h * material
    sums[DISSIPATED + 1] += h * mass
    sums[DISSIPATED + 2] += h * drag
    moment_work(model, q, v, ports, at, h, sums, work)
    for i in range(n):
        q0[i] += h * (v0[i] + h * ((0.5 - beta) * a[0, i] + beta * a1[i]))
        v0[i] += h * ((1.0 - gamma) * a[0, i] + gamma * a1[i])
        a[1, i] = cm * a1[i] + am * a[0, i]
        a[0, i] = a1[i]
    sums[LAST_INNER] = h
    return OK


@kernel
def start(model, state, ports, offset, work):
    """Turn what `end` left in the first row of accelerations into those under the loads of this macro step.

    Generalized-alpha carries a from step to step, a value at t + (alpha_m - alpha_f) h. Loads that jump between
    macro steps would leave it behind, an error of first order; what is kept is therefore M a less the loads.
    """
    n = model.weight.size
    port_loads(model, state[:n], ports, offset, work)
    for i in range(n):
        work.increment[i] = state[2 * n + i] + work.external[i]
    constrain_vector(model, work.increment)
    banded.solve(work.mass_band, work.increment)
    for i in range(n):
        state[2 * n + i] = work.increment[i]


@kernel
def end(model, state, ports, offset, work):
    """Turn the first row of accelerations into M a less the loads; `offset` (s, from the middle) is where a belongs."""
    n = model.weight.size
    work.increment[:] = 0.0
    add_inertia(model, state[2 * n : 3 * n], work.increment, work.element)
    port_loads(model, state[:n], ports, offset, work)
    for i in range(n):
        state[2 * n + i] = work.increment[i] - work.external[i]
