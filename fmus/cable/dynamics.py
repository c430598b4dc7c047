"""One macro step of the cable: inner steps of an implicit method, Newton with a factorisation that is used again.

The state is flat: q (n), v (n), two rows of accelerations (2 n) and a few sums (`N_SUMS`). The iteration
matrix is made at the start of a macro step and whenever Newton's method slows down. It is kept beside the state
with what it was made from: a macro step repeated from the same start, as an implicit master does, finds it ready,
and as it is a function of that start alone, the repetition is bit-identical.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable.assembly import (
    HALF_BANDWIDTH,
    ElementWork,
    Model,
    add_inertia,
    add_load,
    constrain_vector,
    curvature,
    dot,
    element_work,
    internal_force,
    interpolate,
    iteration_matrix,
    kinetic_energy,
    locate,
)
from fmus.kernels import banded
from fmus.kernels.jit import kernel

N_PORTS = 4
DISSIPATED, LAST_INNER, LAST_MACRO, WORK = range(4)
"""Places behind the coordinates in the state; the work done through each port stands last."""
N_SUMS = WORK + N_PORTS
MAX_ITERATIONS = 12
SLOW = 0.25
"""Contraction of an iteration above which the iteration matrix is made anew."""
CONVERGED = 1e-12
"""Estimated remaining error of a coordinate, relative to the length of the cable over 200 m (1e-12 m there)."""
MAX_HALVINGS = 12
OK, NOT_CONVERGED, NOT_FINITE, OFF_CABLE = range(4)


class Work(NamedTuple):
    """Workspace and cached factorisations of a cable of n coordinates."""

    element: ElementWork
    shape: np.ndarray
    axial: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    residual: np.ndarray
    external: np.ndarray
    increment: np.ndarray
    band: np.ndarray
    late_band: np.ndarray
    late: np.ndarray
    matrix: np.ndarray
    mode: np.ndarray
    real_band: np.ndarray
    real_matrix: np.ndarray
    mass_band: np.ndarray
    key: np.ndarray
    load: np.ndarray
    point: np.ndarray
    start: np.ndarray
    trial: np.ndarray
    first: np.ndarray
    power: np.ndarray
    means: np.ndarray


def make_work(n: int, state_size: int) -> Work:
    """Return new workspace for n coordinates; generalized-alpha wants `factorise_mass` too."""
    width = 2 * HALF_BANDWIDTH + 1
    return Work(
        element=element_work(),
        shape=np.zeros(8),
        axial=np.zeros(n // 6 - 1),
        q=np.zeros((2, n)),
        v=np.zeros((2, n)),
        a=np.zeros((2, n)),
        residual=np.zeros((2, n)),
        external=np.zeros(n),
        increment=np.zeros(n),
        band=np.zeros((n, width), dtype=np.complex128),
        late_band=np.zeros((n, width), dtype=np.complex128),
        late=np.zeros(1, dtype=np.bool_),
        matrix=np.zeros((13, 12), dtype=np.complex128),
        mode=np.zeros(n, dtype=np.complex128),
        real_band=np.zeros((n, width)),
        real_matrix=np.zeros((13, 12)),
        mass_band=np.zeros((n, width)),
        key=np.full(2 * n + 2, np.nan),
        load=np.zeros((2, 3)),
        point=np.zeros((2, 6)),
        start=np.zeros((N_PORTS, 12)),
        trial=np.zeros(state_size),
        first=np.zeros((N_PORTS, 3)),
        power=np.zeros(2),
        means=np.zeros((N_PORTS, 6)),
    )


def factorise_mass(model: Model, q: np.ndarray, work: Work) -> None:
    """Put the factors of the mass matrix into the workspace."""
    iteration_matrix(model, q, np.zeros_like(q), 1.0, 0.0, 0.0, work.mass_band, work.real_matrix, work.element)
    banded.factorise(work.mass_band)


def state_size(n: int) -> int:
    """Return the length of the flat state of a cable of n coordinates."""
    return 4 * n + N_SUMS


@kernel
def residual(model, q, v, a, external, force, axial, work):
    """Write M a + Q(q, v) - weight - external to `force` (n,), supports not applied; return dissipated power."""
    power = internal_force(model, q, v, force, axial, work)[1]
    add_inertia(model, a, force, work)
    for i in range(force.size):
        force[i] -= model.weight[i] + external[i]
    return power


@kernel
def _port_loads(model, q, ports, offset, work):
    """Write what the ports apply at `offset` seconds from the middle of the macro step to ``work.external``."""
    work.external[:] = 0.0
    for k in range(N_PORTS):
        loaded = False
        for i in range(3):
            work.load[0, i] = ports[k, 1 + i] + ports[k, 7 + i] * offset
            work.load[1, i] = ports[k, 4 + i] + ports[k, 10 + i] * offset
            loaded = loaded or work.load[0, i] != 0.0 or work.load[1, i] != 0.0
        if loaded:
            add_load(model, q, ports[k, 0], work.load[0], work.load[1], work.shape, work.external)


@kernel
def _moment_work(model, q, v, ports, offset, weight, sums, work):
    """Add to the work of each port what its moment does: `weight` times the power at a stage."""
    for k in range(N_PORTS):
        moment = work.load[1]
        loaded = False
        for i in range(3):
            moment[i] = ports[k, 4 + i] + ports[k, 10 + i] * offset
            loaded = loaded or moment[i] != 0.0
        if not loaded:
            continue
        interpolate(model, q, ports[k, 0], work.shape, work.point[0])
        interpolate(model, v, ports[k, 0], work.shape, work.point[1])
        g, gd = work.point[0, 3:6], work.point[1, 3:6]
        square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        power = moment[0] * (g[1] * gd[2] - g[2] * gd[1])
        power += moment[1] * (g[2] * gd[0] - g[0] * gd[2])
        power += moment[2] * (g[0] * gd[1] - g[1] * gd[0])
        sums[WORK + k] += weight * power / square


@kernel
def _finished(change, rate, tolerance):
    """Return whether the error left after an iteration that changed a coordinate by `change` is below the tolerance.

    Newton's method with a kept matrix converges linearly: what is left is about change · rate / (1 - rate).
    """
    return change * min(1.0, rate / max(1e-3, 1.0 - rate)) < tolerance


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
def _collocation_matrix(model, method, q, v, h, band, work):
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
    return _collocation_matrix(model, method, work.q[1], work.v[1], h, work.band, work)


@kernel
def collocation_step(model, method, state, h, offset, ports, tolerance, ahead, work):
    """Advance the flat `state` by one inner step `h` of two-stage collocation.

    Parameters
    ----------
    offset : start of the step relative to the middle of the macro step, s
    ports : (N_PORTS, 13) s, force, moment, force rate, moment rate of each port
    tolerance : m, of a coordinate
    ahead : s, negative: go on with the iteration matrix of the step before; else one is made for so much later

    Returns
    -------
    status : OK or NOT_CONVERGED; the state is then undefined
    """
    n = model.weight.size
    q0, v0, a, sums = state[:n], state[n : 2 * n], state[2 * n : 4 * n].reshape(2, n), state[4 * n :]
    ratio = h / sums[LAST_INNER] if sums[LAST_INNER] > 0.0 else 0.0
    for i in range(n):  # the stage accelerations go on along their line
        slope = (a[1, i] - a[0, i]) / (method.c[1] - method.c[0])
        for j in range(2):
            work.a[j, i] = a[0, i] + slope * (1.0 + ratio * method.c[j] - method.c[0]) if ratio > 0.0 else a[1, i]
    if ahead >= 0.0 and _first_matrix(model, method, q0, v0, a[1], h, ahead, work) != OK:
        return NOT_CONVERGED
    previous = np.inf
    scale = h * h * abs(method.eigenvalue) ** 2
    power = work.power
    for iteration in range(MAX_ITERATIONS):
        for j in range(2):
            for i in range(n):
                work.q[j, i] = q0[i] + h * (
                    method.c[j] * v0[i] + h * (method.aa[j, 0] * work.a[0, i] + method.aa[j, 1] * work.a[1, i])
                )
                work.v[j, i] = v0[i] + h * (method.a[j, 0] * work.a[0, i] + method.a[j, 1] * work.a[1, i])
            _port_loads(model, work.q[j], ports, offset + method.c[j] * h, work)
            power[j] = residual(
                model,
                work.q[j],
                work.v[j],
                work.a[j],
                work.external,
                work.residual[j],
                work.axial,
                work.element,
            )
            constrain_vector(model, work.residual[j])
        for i in range(n):
            work.mode[i] = -(method.to_mode[0] * work.residual[0, i] + method.to_mode[1] * work.residual[1, i])
        banded.solve(work.late_band if work.late[0] else work.band, work.mode)
        change = 0.0
        for i in range(n):
            for j in range(2):
                increment = 2.0 * (method.from_mode[j] * work.mode[i]).real
                work.a[j, i] += increment
                if not abs(increment) < np.inf:
                    return NOT_CONVERGED
                change = max(change, scale * abs(increment))
        rate = change / previous if iteration > 0 else 1.0
        if _finished(change, rate, tolerance):
            break
        if rate > SLOW and iteration > 0:
            if change < 100.0 * tolerance and rate > 0.9:
                break  # round-off
            work.late[0] = True  # the factors made at the start are kept for its repetition
            if _collocation_matrix(model, method, work.q[1], work.v[1], h, work.late_band, work) != OK:
                return NOT_CONVERGED
        previous = change
        if iteration == MAX_ITERATIONS - 1:
            return NOT_CONVERGED
    for j in range(2):
        weight = h * method.b[j]
        sums[DISSIPATED] += weight * power[j]
        _moment_work(model, work.q[j], work.v[j], ports, offset + method.c[j] * h, weight, sums, work)
    for i in range(n):
        a0, a1 = work.a[0, i], work.a[1, i]
        q0[i] += h * (v0[i] + h * (method.bb[0] * a0 + method.bb[1] * a1))
        v0[i] += h * (method.b[0] * a0 + method.b[1] * a1)
        a[0, i], a[1, i] = a0, a1
    sums[LAST_INNER] = h
    return OK


@kernel
def generalized_alpha_step(model, method, state, h, offset, ports, tolerance, fresh, work):
    """Advance the flat `state` by one inner step of generalized-alpha; parameters as in `collocation_step`.

    Chung & Hulbert 1993, eqs. (5)–(9), with all forces at the generalised midpoint t + (1 - alpha_f) h: the load of a
    macro step is then never taken from its neighbour. The first row of accelerations is a, the second its value at the
    midpoint. `start_alpha` and `end_alpha` enclose the inner steps of a macro step.
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
    previous, power, at = np.inf, 0.0, offset + (1.0 - af) * h
    for iteration in range(MAX_ITERATIONS):
        for i in range(n):
            work.a[1, i] = cm * a1[i] + am * a[0, i]
            q[i] = q0[i] + (1.0 - af) * h * (v0[i] + h * ((0.5 - beta) * a[0, i] + beta * a1[i]))
            v[i] = v0[i] + (1.0 - af) * h * ((1.0 - gamma) * a[0, i] + gamma * a1[i])
        _port_loads(model, q, ports, at, work)
        power = residual(model, q, v, work.a[1], work.external, work.residual[0], work.axial, work.element)
        constrain_vector(model, work.residual[0])
        for i in range(n):
            work.increment[i] = -work.residual[0, i]
        banded.solve(work.real_band, work.increment)
        change = 0.0
        for i in range(n):
            a1[i] += work.increment[i]
            if not abs(work.increment[i]) < np.inf:
                return NOT_CONVERGED
            change = max(change, cq * abs(work.increment[i]))
        rate = change / previous if iteration > 0 else 1.0
        if _finished(change, rate, tolerance):
            break
        if rate > SLOW and iteration > 0:
            if change < 100.0 * tolerance and rate > 0.9:
                break  # round-off
            iteration_matrix(model, q, v, cm, cv, cq, work.real_band, work.real_matrix, work.element)
            if banded.factorise(work.real_band) != OK:
                return NOT_CONVERGED
        previous = change
        if iteration == MAX_ITERATIONS - 1:
            return NOT_CONVERGED
    sums[DISSIPATED] += h * power
    _moment_work(model, q, v, ports, at, h, sums, work)
    for i in range(n):
        q0[i] += h * (v0[i] + h * ((0.5 - beta) * a[0, i] + beta * a1[i]))
        v0[i] += h * ((1.0 - gamma) * a[0, i] + gamma * a1[i])
        a[1, i] = cm * a1[i] + am * a[0, i]
        a[0, i] = a1[i]
    sums[LAST_INNER] = h
    return OK


@kernel
def start_alpha(model, state, ports, offset, work):
    """Turn what `end_alpha` left in the first row of accelerations into those under the loads of this macro step.

    Generalized-alpha carries a from step to step, a value at t + (alpha_m - alpha_f) h. Loads that jump between
    macro steps would leave it behind, an error of first order; what is kept is therefore M a less the loads.
    """
    n = model.weight.size
    _port_loads(model, state[:n], ports, offset, work)
    for i in range(n):
        work.increment[i] = state[2 * n + i] + work.external[i]
    constrain_vector(model, work.increment)
    banded.solve(work.mass_band, work.increment)
    for i in range(n):
        state[2 * n + i] = work.increment[i]


@kernel
def end_alpha(model, state, ports, offset, work):
    """Turn the first row of accelerations into M a less the loads; `offset` (s, from the middle) is where a belongs."""
    n = model.weight.size
    work.increment[:] = 0.0
    add_inertia(model, state[2 * n : 3 * n], work.increment, work.element)
    _port_loads(model, state[:n], ports, offset, work)
    for i in range(n):
        state[2 * n + i] = work.increment[i] - work.external[i]


@kernel
def port_motion(model, state, s, shape, out):
    """Write position, tangent, velocity and tangent rate at arc length `s` to `out` (12,)."""
    n = model.weight.size
    interpolate(model, state[:n], s, shape, out[0:6])
    interpolate(model, state[n : 2 * n], s, shape, out[6:12])


@kernel
def _refusal(model, ports):
    """Return OK, or why a step under the loads `ports` cannot be made."""
    for k in range(N_PORTS):
        for i in range(13):
            if not abs(ports[k, i]) < np.inf:
                return NOT_FINITE
        if not 0.0 <= ports[k, 0] <= model.s[-1]:
            return OFF_CABLE
    return OK


@kernel
def macro_step(model, collocation, alpha, use_alpha, state, h, longest, ports, shown, out, rows, work):
    """Advance `state` by the macro step `h` with inner steps of at most `longest`, and write all outputs.

    An inner step that does not converge is repeated at half its length, up to MAX_HALVINGS times.

    Parameters
    ----------
    ports : (N_PORTS, 13), see `collocation_step`
    shown : (N_PORTS, 19), receives what `show_ports` writes, then the time means of position and tangent over the macro
        step (over each inner step (x0 + x1)/2 + h/12 (x0' - x1'), the mean of the cubic through its ends) and the work
    out, rows : see `diagnose`

    Returns
    -------
    status : OK; NOT_CONVERGED, the state is then undefined; NOT_FINITE or OFF_CABLE, nothing is changed
    """
    n = model.weight.size
    status = _refusal(model, ports)
    if status != OK:
        return status
    sums = state[4 * n :]
    tolerance = CONVERGED * max(1.0, model.s[-1] / 200.0)
    means = work.means
    means[:, :] = 0.0
    first = work.first
    for k in range(N_PORTS):
        port_motion(model, state, ports[k, 0], work.shape, work.start[k])
        for i in range(3):
            first[k, i] = work.start[k, i]
    inner = h / max(1.0, np.ceil(h / longest - 1e-9))
    lag = alpha.alpha_m - alpha.alpha_f
    if use_alpha:
        start_alpha(model, state, ports, lag * inner - 0.5 * h, work)
    halvings, elapsed = 0, 0.0
    fresh = elapsed < h  # true; a constant here would be compiled as a type of its own
    while elapsed < h * (1.0 - 1e-12):
        step = min(inner, h - elapsed)
        if h - elapsed - step < 1e-9 * h:
            step = h - elapsed
        for i in range(state.size):
            work.trial[i] = state[i]
        if use_alpha:
            status = generalized_alpha_step(
                model, alpha, work.trial, step, elapsed - 0.5 * h, ports, tolerance, fresh, work
            )
        else:
            ahead = 0.5 * (h - elapsed) if fresh else -1.0
            status = collocation_step(
                model, collocation, work.trial, step, elapsed - 0.5 * h, ports, tolerance, ahead, work
            )
        if status != OK:
            halvings += 1
            if halvings > MAX_HALVINGS:
                return NOT_CONVERGED
            inner *= 0.5
            fresh = elapsed < h
            continue
        fresh = abs(step - inner) > 1e-9 * inner
        for i in range(state.size):
            state[i] = work.trial[i]
        elapsed += step
        for k in range(N_PORTS):
            point = work.point.reshape(12)
            port_motion(model, state, ports[k, 0], work.shape, point)
            for i in range(6):
                mean = 0.5 * (work.start[k, i] + point[i]) + step / 12.0 * (work.start[k, 6 + i] - point[6 + i])
                means[k, i] += mean * step / h
            for i in range(12):
                work.start[k, i] = point[i]
    if use_alpha:
        end_alpha(model, state, ports, lag * sums[LAST_INNER] + 0.5 * h, work)
    for k in range(N_PORTS):
        for i in range(3):
            force, rate = ports[k, 1 + i], ports[k, 7 + i]
            end = work.start[k, i]
            sums[WORK + k] += force * (end - first[k, i]) + rate * h * (0.5 * (first[k, i] + end) - means[k, i])
    sums[LAST_MACRO] = h
    show_ports(model, state, ports, shown, work)
    for k in range(N_PORTS):
        for i in range(6):
            shown[k, 12 + i] = means[k, i]
        shown[k, 18] = sums[WORK + k]
    diagnose(model, collocation, use_alpha, state, ports, out, rows, work)
    return OK


@kernel
def mean_axial_force(model, s, axial, shape):
    """Return the axial force at arc length `s`: the mean over its element, or over both where `s` is a node."""
    e = locate(model, s, shape)
    if e > 0 and s - model.s[e] < 1e-9 * model.s[-1]:
        return 0.5 * (axial[e - 1] + axial[e])
    return axial[e]


@kernel
def show_ports(model, state, ports, shown, work):
    """Write position, tangent, velocity, tangent rate and d²r/ds² of every port to `shown` (N_PORTS, 22)."""
    n = model.weight.size
    for k in range(N_PORTS):
        port_motion(model, state, ports[k, 0], work.shape, shown[k, 0:12])
        curvature(model, state[:n], ports[k, 0], work.shape, shown[k, 19:22])


@kernel
def diagnose(model, method, use_alpha, state, ports, out, rows, work):
    """Write what is shown of the cable besides its ports.

    Parameters
    ----------
    ports : (N_PORTS, 13), the loads of the macro step that has just been made
    out : (13,), receives tension left, mid, right, kinetic, elastic, gravitational and dissipated energy, force of the
        left support (3) and of the right one (3) on the cable
    rows : (m, 4), receives position and axial force at equally spaced arc lengths
    """
    n = model.weight.size
    q, v, force = state[:n], state[n : 2 * n], work.residual[0]
    out[3] = kinetic_energy(model, v, work.element, force)
    out[4] = internal_force(model, q, v, force, work.axial, work.element)[0]
    out[5] = -dot(model.weight, q)
    out[6] = state[4 * n + DISSIPATED]
    work.external[:] = 0.0
    if use_alpha:  # M a less the loads is kept, see `end_alpha`
        for i in range(n):
            force[i] += state[2 * n + i]
    else:
        for i in range(n):
            work.a[0, i] = method.end[0] * state[2 * n + i] + method.end[1] * state[3 * n + i]
        add_inertia(model, work.a[0], force, work.element)
        _port_loads(model, q, ports, 0.5 * state[4 * n + LAST_MACRO], work)
    for k in range(3):
        out[7 + k] = force[k] - model.weight[k] - work.external[k]
        out[10 + k] = force[n - 6 + k] - model.weight[n - 6 + k] - work.external[n - 6 + k]
    out[0] = np.sqrt(out[7] ** 2 + out[8] ** 2 + out[9] ** 2)
    out[1] = mean_axial_force(model, 0.5 * model.s[-1], work.axial, work.shape)
    out[2] = np.sqrt(out[10] ** 2 + out[11] ** 2 + out[12] ** 2)
    for i in range(rows.shape[0]):
        s = model.s[-1] * i / (rows.shape[0] - 1)
        interpolate(model, q, s, work.shape, work.point[0])
        for k in range(3):
            rows[i, k] = work.point[0, k]
        rows[i, 3] = mean_axial_force(model, s, work.axial, work.shape)
