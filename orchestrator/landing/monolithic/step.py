"""One step of cable, robot and contacts as one system, by collocation; Newton's method on the accelerations.

The equations are those of the modules' own kernels. Unknowns are the accelerations at the two stages of a step
(`fmus.kernels.time_integration`): n of the cable and 10 of the robot (centre of mass, angular velocity, spin of four
wheels).
"""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import constrain_vector, locate, residual
from fmus.cable.state import DISSIPATED, LAST_INNER, N_LOSSES
from fmus.contact import places as at
from fmus.kernels import banded, dense
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
    to_stage,
)
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic import contacts, matrix, robot
from orchestrator.landing.monolithic.state import ARC, BRISTLE, N_ROBOT, NOT_CONVERGED, OK, copy

MAX_ITERATIONS = 15
SLOW = 0.2
"""Contraction of an iteration above which the matrix is made anew."""
ERROR_FACTOR = 0.01
"""Local error of a step over h² times the change of the robot's accelerations against those predicted."""
NEWTON_STEP = 1e-3
"""s; in shorter steps Newton's tolerance shrinks with the step, so that velocities, too, are found to a tolerance."""


@kernel
def step(system, state, h, tolerance, fresh, space, work, allowed, event):
    """Advance `state` by one step `h`; it is unchanged unless the status is OK and the error at most `allowed`.

    A step longer than `event` in which a contact changes its status counts as too inaccurate.

    Returns
    -------
    status : OK, NOT_CONVERGED, CONTACT_FAILED or AXLE_ALONG
    error : local error estimate, m: h² times the difference of the robot's accelerations from those predicted
    iterations : of Newton's method
    """
    n = system.model.weight.size
    tolerance *= min(1.0, h / NEWTON_STEP)
    _predict(system, state, h, space, work)
    if fresh:
        for k in range(system.contacts.shape[0]):
            for i in range(2):
                space.elongation[k, i] = state.contacts[k, BRISTLE + i]
        q, v = state.cable[:n], state.cable[n : 2 * n]
        status = matrix.make(system, state.robot, q, v, state.contacts, space.arc[1], h, space, work)
        if status != OK:
            return status, 0.0, 0
    previous, iteration = np.inf, 0
    while True:
        status = _residuals(system, state, h, space, work)
        if status != OK:
            return status, 0.0, iteration
        change, iteration = _newton(system, h, space, work), iteration + 1
        verdict = judge(change, previous, MAX_ITERATIONS - iteration, tolerance, SLOW)
        if verdict == FAILED:
            return NOT_CONVERGED, 0.0, iteration
        if verdict == DONE:
            break
        if verdict == RENEW:
            for k in range(system.contacts.shape[0]):
                for i in range(2):
                    space.elongation[k, i] = space.trial[k, i]
            q, v = work.q[1], work.v[1]
            status = matrix.make(system, space.stage[1], q, v, state.contacts, space.arc[1], h, space, work)
            if status != OK:
                return status, 0.0, iteration
        previous = change
    status = _residuals(system, state, h, space, work)
    if status != OK:
        return status, 0.0, iteration
    error = _local_error(h, space)
    if error > allowed:
        return OK, error, iteration
    copy(state, space.saved)
    status = _accept(system, state, h, space, work)
    if status == OK and h > event and contacts.changed(state, space):
        copy(space.saved, state)
        error = 1e4 * allowed
    return status, error, iteration


@kernel
def _predict(system, state, h, space, work):
    """Take the stage accelerations from the line through those of the last step."""
    method, n = system.method, system.model.weight.size
    a, last = state.cable[2 * n : 4 * n].reshape(2, n), state.cable[4 * n + LAST_INNER]
    first, second = stage_distances(method, h / last if last > 0.0 else 0.0)
    apart = method.c[1] - method.c[0]
    distances = (first / apart, second / apart)
    predict(a, 1.0, distances, work.a)
    predict(state.accelerations, 1.0, distances, space.b)
    for i in range(N_ROBOT):
        space.guess[i] = space.b[1, i]
    for j in range(2):
        for k in range(state.contacts.shape[0]):
            space.arc[j, k] = state.contacts[k, ARC]


@kernel
def _local_error(h, space):
    """Return the error estimate of `step`."""
    error = 0.0
    for i in range(6):
        error = max(error, ERROR_FACTOR * h * h * abs(space.b[1, i] - space.guess[i]))
    return error


@kernel
def _residuals(system, state, h, space, work):
    """Write the residuals of both stages at the trial accelerations; return the status."""
    model, method = system.model, system.method
    n, n_wheels = model.weight.size, system.contacts.shape[0]
    q0, v0, points = state.cable[:n], state.cable[n : 2 * n], space.cable_point
    robot.stages(method, state.robot, space.b, h, space)
    for j in range(2):
        stage(method, j, h, q0, v0, work.a[0], work.a[1], work.q[j], work.v[j])
        contacts.follow(system, work.q[j], space.stage[j], space.arc[j], space, work.shape)
        contacts.cable_points(system, work.q[j], work.v[j], space.arc[j], points, work.shape)
        status = contacts.walls(system, space.stage[j], points, state.contacts, space.out[j], space)
        if status != OK:
            return status
        for k in range(n_wheels):
            for i in range(2):
                space.slip[j, k, i] = space.out[j, k, at.SLIP_VELOCITY + i]
    for j in range(2):
        for k in range(n_wheels):
            for i in range(2):
                path = to_stage(method, j, space.slip[0, k, i], space.slip[1, k, i])
                space.trial[k, i] = state.contacts[k, BRISTLE + i] + h * path
        contacts.cable_points(system, work.q[j], work.v[j], space.arc[j], points, work.shape)
        forces, out, control = space.generalized, space.out[j], space.control[j]
        contacts.loads(system, control, space.stage[j], points, space.trial, state.contacts, out, forces, space)
        _external(model, space.arc[j], forces, work)
        force = work.residual[j]
        material, mass, drag = residual(model, work.q[j], work.v[j], work.a[j], work.external, force, work.element)
        work.power[j, 0], work.power[j, 1], work.power[j, 2] = material, mass, drag
        constrain_vector(model, force)
        for i in range(N_ROBOT):
            space.c[j, i] = space.b[j, i] - forces[6 * n_wheels + i]
    return OK


@kernel
def _external(model, arcs, generalized, work):
    """Write what the contacts do to the cable's coordinates to ``work.external``."""
    work.external[:] = 0.0
    for k in range(arcs.size):
        o = 6 * locate(model, arcs[k], work.shape)
        for a in range(4):
            for i in range(3):
                work.external[o + 3 * a + i] += (
                    work.shape[a] * generalized[6 * k + i] + work.shape[4 + a] * generalized[6 * k + 3 + i]
                )


@kernel
def _newton(system, h, space, work):
    """Improve the trial accelerations by one solve; return the largest change of a coordinate."""
    method, x = system.method, space.robot_mode
    to_mode(method, work.residual, work.mode)
    banded.solve(work.band, work.mode)
    to_mode(method, space.c, x)
    for i in range(N_ROBOT):
        for k in range(system.contacts.shape[0]):
            for c in range(12):
                x[i] -= space.border[k, i, c] * work.mode[space.offsets[k] + c]
    dense.solve(space.schur, space.pivots, x)
    for i in range(work.mode.size):
        for j in range(N_ROBOT):
            work.mode[i] -= space.coupling[j, i] * x[j]
    return max(correct(method, h, work.mode, work.a), correct(method, h, x, space.b))


@kernel
def _accept(system, state, h, space, work):
    """Move `state` to the end of the step whose stages have been found."""
    method, n = system.method, system.model.weight.size
    accept(method, h, state.cable[:n], state.cable[n : 2 * n], work.a[0], work.a[1])
    for i in range(n):
        state.cable[2 * n + i], state.cable[3 * n + i] = work.a[0, i], work.a[1, i]
    for i in range(N_LOSSES):
        power = method.b[0] * work.power[0, i] + method.b[1] * work.power[1, i]
        state.cable[4 * n + DISSIPATED + i] += h * power
    state.cable[4 * n + LAST_INNER] = h
    for j in range(2):
        power = rb.control_power(system.robot, space.stage[j], space.control[j])
        state.control_work[0] += h * method.b[j] * power
        for i in range(N_ROBOT):
            state.accelerations[j, i] = space.b[j, i]
    robot.end(method, state.robot, space.b, h, space)
    return contacts.end(system, state, h, space, work)
