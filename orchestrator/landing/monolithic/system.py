"""Cable, robot and contacts as one system: the residual, its tangent and one step (kernels).

The equations are those of the modules' own kernels. Unknowns are the accelerations at the two stages of a
collocation step (`fmus.time_integration`): n of the cable and 10 of the robot (centre of mass, angular velocity, spin
of four wheels). Newton's matrix is the banded one of the cable, bordered by the robot's ten columns; the contact's
part of it, found by differences of the contact law, couples the element under each wheel to the robot.

The orientation within a step is exp(θ) times that at its start, θ' = T(θ)⁻¹ ω.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable.assembly import HALF_BANDWIDTH, Model, constrain_vector, interpolate, iteration_matrix, locate
from fmus.cable.dynamics import DISSIPATED, LAST_INNER, residual, state_size
from fmus.contact import law
from fmus.contact.exchange import silence
from fmus.kernels import banded
from fmus.kernels.jit import kernel
from fmus.kernels.rotations import from_rotation_vector, multiply, normalize
from fmus.kernels.time_integration import Collocation
from fmus.robot import rigid_body as rb

N_ROBOT = 10
"""Accelerations of the robot: centre of mass 3, angular velocity 3, spin of four wheels."""
S, SLIP, WALLS, FRICTION, LEFT, STATUS, STORED = 0, 1, 3, 4, 5, 6, 9
N_CONTACT = 10
"""Memory of a contact: arc length, bristle (2), energy dissipated by walls and by friction, left the groove, regime
at the last step's end and at its stages (2), elastic energy of the walls at its end."""
EXCESS = 27
"""Place in the law's results, free there: the bristle's force beyond the Coulomb limit, N."""
FOOT_ITERATIONS = 2
"""From the last iterate; each shrinks the error by the cable's curvature times the wheel's distance, 1e-2 or less."""
MAX_ITERATIONS = 15
SLOW = 0.2
ERROR_FACTOR = 0.01
"""Local error of a step over h² times the change of the robot's accelerations against those predicted."""
OK, NOT_CONVERGED, CONTACT_FAILED, OFF_CABLE = 0, 1, 2, 3
NEWTON_STEP = 1e-3
"""s; in shorter steps Newton's tolerance shrinks with the step, so that velocities, too, are found to a tolerance."""
SAFETY, GROW, SHRINK = 0.8, 2.0, 0.2
SHORTEST = 1e-7
"""s; a shorter step means that the equations cannot be solved."""
WANTED, LONGEST, ALLOWED, EVENT, NEWTON, MATRIX, STEPS, ITERATIONS, REJECTED = range(9)
"""Places in the control of `advance`."""


class System(NamedTuple):
    """What does not change: the cable's model, the method, parameters of robot and contacts, control loads.

    Attributes
    ----------
    robot : (56,) of `fmus.robot.rigid_body`
    contacts : (n_wheels, 14) of `fmus.contact.law`
    control : (4 + 7 n_wheels,) thrust, torque and drive torques in the places of `rigid_body.resultants`
    """

    model: Model
    method: Collocation
    robot: np.ndarray
    contacts: np.ndarray
    control: np.ndarray


class State(NamedTuple):
    """What changes: cable (its module's flat state), robot (21,), accelerations (2, 10), contacts (n_wheels, 10)."""

    cable: np.ndarray
    robot: np.ndarray
    accelerations: np.ndarray
    contacts: np.ndarray
    control_work: np.ndarray  # (1,) J


class Space(NamedTuple):
    """Workspace; m = 6 n_wheels + 10 are the interface's coordinates."""

    stage: np.ndarray  # (2, 21) robot state at the stages
    theta: np.ndarray  # (2, 3)
    b: np.ndarray  # (2, 10) trial accelerations of the robot
    c: np.ndarray  # (2, 10) accelerations from the loads
    slip: np.ndarray  # (2, n_wheels, 2) slip velocities
    trial: np.ndarray  # (n_wheels, 2) trial elongations
    cable_point: np.ndarray  # (n_wheels, 12) p, t, dp, dt
    motion: np.ndarray  # (24,)
    out: np.ndarray  # (2, n_wheels, 32) results of the law
    generalized: np.ndarray  # (m,) generalised forces on (p, t) of each wheel, accelerations of the robot
    reference: np.ndarray  # (m,)
    dy: np.ndarray  # (m, m) derivatives by coordinates
    dv: np.ndarray  # (m, m) derivatives by rates
    dslip: np.ndarray  # (n_wheels, 2, m) of the slip velocities by rates
    probe: np.ndarray  # (21,) perturbed robot state
    probe_point: np.ndarray  # (n_wheels, 12)
    loads: np.ndarray
    resultants: np.ndarray  # (10,) force, moment, wheel torques
    quaternions: np.ndarray  # (3, 4)
    shapes: np.ndarray  # (n_wheels, 8)
    offsets: np.ndarray  # (n_wheels,) first coordinate of the element under each wheel
    coupling: np.ndarray  # (n_robot, n) complex: cable columns of the robot's unknowns, solved
    border: np.ndarray  # (n_wheels, 10, 12) complex: robot rows over the element's coordinates
    schur: np.ndarray  # (10, 10) complex, factorised
    pivots: np.ndarray  # (10,)
    robot_mode: np.ndarray  # (10,) complex
    guess: np.ndarray  # (10,) accelerations of the robot predicted for the second stage
    elongation: np.ndarray  # (n_wheels, 2) of the bristles where the matrix is made
    arc: np.ndarray  # (2, n_wheels) arc lengths of the wheels' feet at the stages
    saved: State  # at the start of a step


def make_space(n: int, n_wheels: int) -> Space:
    """Return new workspace for n cable coordinates and a number of wheels."""
    m = 6 * n_wheels + N_ROBOT
    z = np.zeros
    c = np.complex128
    return Space(
        z((2, rb.RIGID)), z((2, 3)), z((2, N_ROBOT)), z((2, N_ROBOT)), z((2, n_wheels, 2)), z((n_wheels, 2)),
        z((n_wheels, 12)), z(24), z((2, n_wheels, law.OUT_SIZE)), z(m), z(m), z((m, m)), z((m, m)), z((n_wheels, 2, m)),
        z(rb.RIGID), z((n_wheels, 12)), z(rb.BODY_LOADS + rb.WHEEL_LOADS * n_wheels), z(10), z((3, 4)),
        z((n_wheels, 8)), z(n_wheels, dtype=np.int64), z((N_ROBOT, n), dtype=c), z((n_wheels, N_ROBOT, 12), dtype=c),
        z((N_ROBOT, N_ROBOT), dtype=c), z(N_ROBOT, dtype=np.int64), z(N_ROBOT, dtype=c),
        z(N_ROBOT), z((n_wheels, 2)), z((2, n_wheels)),
        State(z(state_size(n)), z(rb.RIGID), z((2, N_ROBOT)), z((n_wheels, N_CONTACT)), z(1)),
    )  # fmt: skip


@kernel
def _turn(q, theta, scratch, out):
    """Write the quaternion exp(theta) q to `out`, which may not be q."""
    from_rotation_vector(theta, scratch)
    multiply(scratch, q, out)
    normalize(out)


@kernel
def _rotation_rate(theta, w, out):
    """Write T(theta)⁻¹ w, the rate of the rotation vector at the inertial angular velocity w."""
    t0, t1, t2 = theta[0], theta[1], theta[2]
    square = t0 * t0 + t1 * t1 + t2 * t2
    factor = 1.0 / 12.0 + square / 720.0
    if square > 1e-4:
        half = 0.5 * np.sqrt(square)
        factor = (1.0 - half / np.tan(half)) / square
    c0, c1, c2 = t1 * w[2] - t2 * w[1], t2 * w[0] - t0 * w[2], t0 * w[1] - t1 * w[0]
    out[0] = w[0] - 0.5 * c0 + factor * (t1 * c2 - t2 * c1)
    out[1] = w[1] - 0.5 * c1 + factor * (t2 * c0 - t0 * c2)
    out[2] = w[2] - 0.5 * c2 + factor * (t0 * c1 - t1 * c0)


@kernel
def _robot_stages(method, start, b, h, space):
    """Write the robot's states at the stages, from its accelerations there, to ``space.stage``."""
    rate = space.quaternions
    for j in range(2):
        y = space.stage[j]
        for i in range(3):
            y[i] = start[i] + h * (
                method.c[j] * start[7 + i] + h * (method.aa[j, 0] * b[0, i] + method.aa[j, 1] * b[1, i])
            )
            y[7 + i] = start[7 + i] + h * (method.a[j, 0] * b[0, i] + method.a[j, 1] * b[1, i])
            y[10 + i] = start[10 + i] + h * (method.a[j, 0] * b[0, 3 + i] + method.a[j, 1] * b[1, 3 + i])
            space.theta[j, i] = method.c[j] * h * start[10 + i]
        for k in range(4):
            y[13 + k] = start[13 + k] + h * (
                method.c[j] * start[17 + k] + h * (method.aa[j, 0] * b[0, 6 + k] + method.aa[j, 1] * b[1, 6 + k])
            )
            y[17 + k] = start[17 + k] + h * (method.a[j, 0] * b[0, 6 + k] + method.a[j, 1] * b[1, 6 + k])
    for _ in range(8):
        for j in range(2):
            _rotation_rate(space.theta[j], space.stage[j, 10:13], rate[j])
        change = 0.0
        for j in range(2):
            for i in range(3):
                new = h * (method.a[j, 0] * rate[0, i] + method.a[j, 1] * rate[1, i])
                change = max(change, abs(new - space.theta[j, i]))
                space.theta[j, i] = new
        if change < 1e-16:
            break
    for j in range(2):
        _turn(start[3:7], space.theta[j], rate[2], space.stage[j, 3:7])


@kernel
def _walls(system, robot, points, outs, space):
    """Evaluate the walls of all contacts at one instant; return the status of the law."""
    motion = space.motion
    for k in range(system.contacts.shape[0]):
        for i in range(12):
            motion[i] = points[k, i]
        rb.wheel_motion(system.robot, robot, k, motion[12:24])
        if law.walls(system.contacts[k], motion, outs[k]) != law.OK:
            return CONTACT_FAILED
    return OK


@kernel
def _loads(system, robot, points, slips, contacts, outs, generalized, space):
    """Add friction, and write the generalised forces on the cable points and the robot's accelerations.

    A contact that has left the groove acts no more.
    """
    n_wheels = system.contacts.shape[0]
    motion = space.motion
    for i in range(space.loads.size):
        space.loads[i] = system.control[i]
    for k in range(n_wheels):
        for i in range(12):
            motion[i] = points[k, i]
        rb.wheel_motion(system.robot, robot, k, motion[12:24])
        out = outs[k]
        law.friction(system.contacts[k], motion, slips[k], out)
        out[EXCESS] = system.contacts[k, 9] * np.hypot(slips[k, 0], slips[k, 1]) - system.contacts[k, 3] * out[12]
        if contacts[k, LEFT] > 0.0:
            silence(out)
        g = motion[3:6]
        square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        for i in range(3):
            generalized[6 * k + i] = out[i]
        generalized[6 * k + 3] = (out[4] * g[2] - out[5] * g[1]) / square
        generalized[6 * k + 4] = (out[5] * g[0] - out[3] * g[2]) / square
        generalized[6 * k + 5] = (out[3] * g[1] - out[4] * g[0]) / square
        for i in range(6):
            space.loads[rb.BODY_LOADS + rb.WHEEL_LOADS * k + i] += out[6 + i]
    force, moment, torque = space.resultants[0:3], space.resultants[3:6], space.resultants[6:10]
    rb.resultants(system.robot, robot, space.loads, force, moment, torque)
    rb.accelerations(system.robot, robot, force, moment, torque, generalized[6 * n_wheels :])


@kernel
def _cable_points(system, q, v, arcs, points, shape):
    """Write p, t, dp, dt of every contact, at the arc lengths `arcs`, to `points` (n_wheels, 12)."""
    for k in range(arcs.size):
        interpolate(system.model, q, arcs[k], shape, points[k, 0:6])
        interpolate(system.model, v, arcs[k], shape, points[k, 6:12])


@kernel
def _follow(system, q, robot, arcs, space, shape):
    """Move every arc length in `arcs` (n_wheels,) to the foot of its wheel on the cable; return OK or OFF_CABLE.

    The law takes the cable for a straight line. At the foot itself that costs nothing; at a distance x from it, it
    would be wrong by curvature x²/2, which in every step would add that times the contact force to the energy.
    """
    motion, status = space.motion, OK
    for k in range(arcs.size):
        rb.wheel_motion(system.robot, robot, k, motion[12:24])
        for _ in range(FOOT_ITERATIONS):
            interpolate(system.model, q, arcs[k], shape, motion[0:6])
            along = square = 0.0
            for i in range(3):
                along += (motion[12 + i] - motion[i]) * motion[3 + i]
                square += motion[3 + i] * motion[3 + i]
            foot = arcs[k] + along / square
            if not 0.0 <= foot <= system.model.s[-1]:
                status = OFF_CABLE
            arcs[k] = min(max(foot, 0.0), system.model.s[-1])
    return status


@kernel
def _perturb(robot, column, step, rate, probe, scratch):
    """Write the robot state with its coordinate (or, if `rate`, its velocity) number `column` changed by `step`."""
    for i in range(rb.RIGID):
        probe[i] = robot[i]
    if rate:
        probe[(7 if column < 6 else 11) + column] += step
    elif column < 3:
        probe[column] += step
    elif column < 6:
        for i in range(3):
            scratch[0, i] = step if i == column - 3 else 0.0
        _turn(robot[3:7], scratch[0, 0:3], scratch[1], probe[3:7])
    else:
        probe[7 + column] += step


@kernel
def _interface_tangent(system, robot, points, slips, contacts, space):
    """Write the derivatives of the generalised forces by coordinates and rates of the interface, by differences.

    A displacement also stretches the bristles, by the slip it amounts to.
    """
    n_wheels = system.contacts.shape[0]
    m = 6 * n_wheels + N_ROBOT
    outs, value, base = space.out[0], space.generalized, space.reference
    if _walls(system, robot, points, outs, space) != OK:
        return CONTACT_FAILED
    base_slip = space.slip[0]
    for k in range(n_wheels):
        base_slip[k, 0], base_slip[k, 1] = outs[k, 16], outs[k, 17]
        space.trial[k, 0], space.trial[k, 1] = slips[k, 0], slips[k, 1]
    _loads(system, robot, points, space.trial, contacts, outs, base, space)
    for rate in (True, False):
        for column in range(m):
            step = 1e-6 if rate else 1e-8
            for k in range(n_wheels):
                for i in range(12):
                    space.probe_point[k, i] = points[k, i]
            for i in range(rb.RIGID):
                space.probe[i] = robot[i]
            if column < 6 * n_wheels:
                space.probe_point[column // 6, column % 6 + (6 if rate else 0)] += step
            else:
                _perturb(robot, column - 6 * n_wheels, step, rate, space.probe, space.quaternions)
            if _walls(system, space.probe, space.probe_point, outs, space) != OK:
                return CONTACT_FAILED
            for k in range(n_wheels):
                for i in range(2):
                    if rate:
                        space.dslip[k, i, column] = (outs[k, 16 + i] - base_slip[k, i]) / step
                        space.trial[k, i] = slips[k, i]
                    else:
                        space.trial[k, i] = slips[k, i] + step * space.dslip[k, i, column]
            _loads(system, space.probe, space.probe_point, space.trial, contacts, outs, value, space)
            target = space.dv if rate else space.dy
            for i in range(m):
                target[i, column] = (value[i] - base[i]) / step
    return OK


@kernel
def _factorise_dense(a, pivots):
    """Replace `a` by its LU factors with partial pivoting; return 1 if singular."""
    n = a.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        pivots[k] = best
        if not abs(a[best, k]) > 0.0:
            return 1
        for j in range(n):
            a[k, j], a[best, j] = a[best, j], a[k, j]
        for i in range(k + 1, n):
            a[i, k] /= a[k, k]
            for j in range(k + 1, n):
                a[i, j] -= a[i, k] * a[k, j]
    return 0


@kernel
def _solve_dense(a, pivots, x):
    """Overwrite `x` with the solution of the system factorised in `a`."""
    n = a.shape[0]
    for k in range(n):
        best = pivots[k]
        x[k], x[best] = x[best], x[k]
    for i in range(n):
        for j in range(i):
            x[i] -= a[i, j] * x[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= a[i, j] * x[j]
        x[i] /= a[i, i]


@kernel
def _matrix(system, robot, q, v, contacts, arcs, h, space, work):
    """Make and factorise Newton's matrix at the given state; return the status."""
    model, n_wheels = system.model, system.contacts.shape[0]
    first = 6 * n_wheels
    z = h * system.method.eigenvalue
    _cable_points(system, q, v, arcs, space.cable_point, work.shape)
    if _interface_tangent(system, robot, space.cable_point, space.elongation, contacts, space) != OK:
        return CONTACT_FAILED
    iteration_matrix(model, q, v, 1.0 + 0.0j, z, z * z, work.band, work.matrix, work.element)
    space.coupling[:, :] = 0.0
    for k in range(n_wheels):
        o = 6 * locate(model, arcs[k], space.shapes[k])
        space.offsets[k] = o
        shape = space.shapes[k]
        for a in range(4):
            for i in range(3):
                row = o + 3 * a + i
                for b in range(4):
                    for j in range(3):
                        total = 0.0 + 0.0j
                        for side in range(2):
                            for other in range(2):
                                r, c = 6 * k + 3 * side + i, 6 * k + 3 * other + j
                                weight = shape[4 * side + a] * shape[4 * other + b]
                                total += weight * (z * z * space.dy[r, c] + z * space.dv[r, c])
                        column = o + 3 * b + j
                        if _free(model, row) and _free(model, column):
                            work.band[row, HALF_BANDWIDTH + column - row] -= total
                for j in range(N_ROBOT):
                    total = 0.0 + 0.0j
                    back = 0.0 + 0.0j
                    for side in range(2):
                        r = 6 * k + 3 * side + i
                        total += shape[4 * side + a] * (z * z * space.dy[r, first + j] + z * space.dv[r, first + j])
                        back += shape[4 * side + a] * (z * z * space.dy[first + j, r] + z * space.dv[first + j, r])
                    if _free(model, row):
                        space.coupling[j, row] -= total
                    space.border[k, j, 3 * a + i] = -back
    if banded.factorise(work.band) != 0:
        return NOT_CONVERGED
    for j in range(N_ROBOT):
        banded.solve(work.band, space.coupling[j])
    for i in range(N_ROBOT):
        for j in range(N_ROBOT):
            entry = -(z * z * space.dy[first + i, first + j] + z * space.dv[first + i, first + j])
            if i == j:
                entry += 1.0
            for k in range(n_wheels):
                for c in range(12):
                    entry -= space.border[k, i, c] * space.coupling[j, space.offsets[k] + c]
            space.schur[i, j] = entry
    return _factorise_dense(space.schur, space.pivots)


@kernel
def _free(model, row):
    """Return whether a coordinate is not held by a support (clamped slopes are left to the cable's own matrix)."""
    n = model.weight.size
    if row < 6:
        return row >= 3 and model.ends[0, 0, 0] == 1.0
    if row >= n - 6:
        return row >= n - 3 and model.ends[1, 0, 0] == 1.0
    return True


@kernel
def _residuals(system, state, h, space, work):
    """Write the residuals of both stages at the trial accelerations; return the status."""
    model, method = system.model, system.method
    n, n_wheels = model.weight.size, system.contacts.shape[0]
    q0, v0 = state.cable[:n], state.cable[n : 2 * n]
    _robot_stages(method, state.robot, space.b, h, space)
    for j in range(2):
        for i in range(n):
            work.q[j, i] = q0[i] + h * (
                method.c[j] * v0[i] + h * (method.aa[j, 0] * work.a[0, i] + method.aa[j, 1] * work.a[1, i])
            )
            work.v[j, i] = v0[i] + h * (method.a[j, 0] * work.a[0, i] + method.a[j, 1] * work.a[1, i])
        _follow(system, work.q[j], space.stage[j], space.arc[j], space, work.shape)
        _cable_points(system, work.q[j], work.v[j], space.arc[j], space.cable_point, work.shape)
        if _walls(system, space.stage[j], space.cable_point, space.out[j], space) != OK:
            return CONTACT_FAILED
        for k in range(n_wheels):
            space.slip[j, k, 0], space.slip[j, k, 1] = space.out[j, k, 16], space.out[j, k, 17]
    for j in range(2):
        for k in range(n_wheels):
            for i in range(2):
                path = method.a[j, 0] * space.slip[0, k, i] + method.a[j, 1] * space.slip[1, k, i]
                space.trial[k, i] = state.contacts[k, SLIP + i] + h * path
        _cable_points(system, work.q[j], work.v[j], space.arc[j], space.cable_point, work.shape)
        _loads(
            system,
            space.stage[j],
            space.cable_point,
            space.trial,
            state.contacts,
            space.out[j],
            space.generalized,
            space,
        )
        work.external[:] = 0.0
        for k in range(n_wheels):
            o = 6 * locate(model, space.arc[j, k], work.shape)
            for a in range(4):
                for i in range(3):
                    work.external[o + 3 * a + i] += (
                        work.shape[a] * space.generalized[6 * k + i]
                        + work.shape[4 + a] * space.generalized[6 * k + 3 + i]
                    )
        work.power[j] = residual(
            model, work.q[j], work.v[j], work.a[j], work.external, work.residual[j], work.axial, work.element
        )
        constrain_vector(model, work.residual[j])
        for i in range(N_ROBOT):
            space.c[j, i] = space.b[j, i] - space.generalized[6 * n_wheels + i]
    return OK


@kernel
def _newton(system, h, space, work):
    """Improve the trial accelerations by one solve; return the largest change of a coordinate."""
    method, n_wheels = system.method, system.contacts.shape[0]
    n = system.model.weight.size
    for i in range(n):
        work.mode[i] = -(method.to_mode[0] * work.residual[0, i] + method.to_mode[1] * work.residual[1, i])
    banded.solve(work.band, work.mode)
    x = space.robot_mode
    for i in range(N_ROBOT):
        x[i] = -(method.to_mode[0] * space.c[0, i] + method.to_mode[1] * space.c[1, i])
        for k in range(n_wheels):
            for c in range(12):
                x[i] -= space.border[k, i, c] * work.mode[space.offsets[k] + c]
    _solve_dense(space.schur, space.pivots, x)
    scale, change = h * h * abs(method.eigenvalue) ** 2, 0.0
    for i in range(n):
        w = work.mode[i]
        for j in range(N_ROBOT):
            w -= space.coupling[j, i] * x[j]
        for j in range(2):
            increment = 2.0 * (method.from_mode[j] * w).real
            work.a[j, i] += increment
            if not abs(increment) < np.inf:
                return np.inf
            change = max(change, scale * abs(increment))
    for i in range(N_ROBOT):
        for j in range(2):
            increment = 2.0 * (method.from_mode[j] * x[i]).real
            space.b[j, i] += increment
            if not abs(increment) < np.inf:
                return np.inf
            change = max(change, scale * abs(increment))
    return change


@kernel
def _predict(system, state, h, space, work):
    """Take the stage accelerations from the line through those of the last step."""
    method, n = system.method, system.model.weight.size
    a, last = state.cable[2 * n : 4 * n].reshape(2, n), state.cable[4 * n + LAST_INNER]
    ratio = h / last if last > 0.0 else 0.0
    for j in range(2):
        at = (1.0 + ratio * method.c[j] - method.c[0]) / (method.c[1] - method.c[0]) if ratio > 0.0 else 1.0
        for i in range(n):
            work.a[j, i] = a[0, i] + at * (a[1, i] - a[0, i])
        for i in range(N_ROBOT):
            space.b[j, i] = state.accelerations[0, i] + at * (state.accelerations[1, i] - state.accelerations[0, i])
        for k in range(state.contacts.shape[0]):
            space.arc[j, k] = state.contacts[k, S]


@kernel
def _accept(system, state, h, space, work):
    """Move `state` to the end of the step whose stages have been found."""
    method, n = system.method, system.model.weight.size
    q0, v0 = state.cable[:n], state.cable[n : 2 * n]
    for i in range(n):
        a0, a1 = work.a[0, i], work.a[1, i]
        q0[i] += h * (v0[i] + h * (method.bb[0] * a0 + method.bb[1] * a1))
        v0[i] += h * (method.b[0] * a0 + method.b[1] * a1)
        state.cable[2 * n + i], state.cable[3 * n + i] = a0, a1
    state.cable[4 * n + DISSIPATED] += h * (method.b[0] * work.power[0] + method.b[1] * work.power[1])
    state.cable[4 * n + LAST_INNER] = h
    r, b = state.robot, space.b
    for j in range(2):
        power = rb.control_power(system.robot, space.stage[j], system.control)
        state.control_work[0] += h * method.b[j] * power
    rate = space.quaternions
    for j in range(2):
        _rotation_rate(space.theta[j], space.stage[j, 10:13], rate[j])
    theta = space.theta[0]
    for i in range(3):
        r[i] += h * (r[7 + i] + h * (method.bb[0] * b[0, i] + method.bb[1] * b[1, i]))
        r[7 + i] += h * (method.b[0] * b[0, i] + method.b[1] * b[1, i])
        r[10 + i] += h * (method.b[0] * b[0, 3 + i] + method.b[1] * b[1, 3 + i])
        theta[i] = h * (method.b[0] * rate[0, i] + method.b[1] * rate[1, i])
    _turn(r[3:7], theta, rate[2], space.probe[3:7])
    for i in range(4):
        r[3 + i] = space.probe[3 + i]
        r[13 + i] += h * (r[17 + i] + h * (method.bb[0] * b[0, 6 + i] + method.bb[1] * b[1, 6 + i]))
        r[17 + i] += h * (method.b[0] * b[0, 6 + i] + method.b[1] * b[1, 6 + i])
    for j in range(2):
        for i in range(N_ROBOT):
            state.accelerations[j, i] = b[j, i]
    return _accept_contacts(system, state, h, space, work)


@kernel
def _regime(prm, out):
    """Return the piece of the contact law at work: its status, and whether bristle and damper are at their limit.

    Where it changes the friction has a kink. A step across one would be less accurate than its error estimate says.
    """
    limit = prm[3] * out[12]
    if limit > 0.0 and out[13] ** 2 + out[14] ** 2 >= limit * limit * (1.0 - 1e-9):
        return out[19] + 10.0
    return out[19]


@kernel
def _accept_contacts(system, state, h, space, work):
    """Move the contacts' memory to the end of the step: bristle, energies, arc length; write the loads there."""
    method = system.method
    for k in range(system.contacts.shape[0]):
        memory = state.contacts[k]
        stiffness = system.contacts[k, 9]
        memory[FRICTION] += 0.5 * stiffness * (memory[SLIP] ** 2 + memory[SLIP + 1] ** 2)
        for j in range(2):
            out, weight = space.out[j, k], h * method.b[j]
            memory[STATUS + 1 + j] = _regime(system.contacts[k], out)
            memory[WALLS] += weight * out[23]
            memory[FRICTION] -= weight * (out[13] * out[16] + out[14] * out[17])
            memory[SLIP] += weight * space.slip[j, k, 0]
            memory[SLIP + 1] += weight * space.slip[j, k, 1]
    return settle(system, state, True, space, work)


@kernel
def settle(system, state, move, space, work):
    """Evaluate the contacts at the present state; with `move` also limit their bristles and follow the wheels.

    The results stay in ``space.out[0]``.
    """
    n = system.model.weight.size
    q, v, arcs = state.cable[:n], state.cable[n : 2 * n], space.arc[0]
    for k in range(arcs.size):
        arcs[k] = state.contacts[k, S]
        space.trial[k, 0], space.trial[k, 1] = state.contacts[k, SLIP], state.contacts[k, SLIP + 1]
    status = _follow(system, q, state.robot, arcs, space, work.shape) if move else OK
    _cable_points(system, q, v, arcs, space.cable_point, work.shape)
    if _walls(system, state.robot, space.cable_point, space.out[0], space) != OK:
        return CONTACT_FAILED
    _loads(system, state.robot, space.cable_point, space.trial, state.contacts, space.out[0], space.generalized, space)
    if move:
        for k in range(arcs.size):
            state.contacts[k, STATUS] = _regime(system.contacts[k], space.out[0, k])
            _remember(state.contacts[k], space.out[0, k], arcs[k])
    return status


@kernel
def _remember(memory, out, arc):
    """Renew the memory of a contact from the law's results at the end of a step.

    What the walls had stored when the cable left the groove is not given back.
    """
    memory[SLIP], memory[SLIP + 1] = out[21], out[22]
    memory[FRICTION] -= out[26]
    if memory[LEFT] > 0.0:
        return
    if out[19] == law.LEFT:
        memory[LEFT] = 1.0
        memory[WALLS] += memory[STORED]
    memory[STORED] = out[25]
    memory[S] = arc


@kernel
def step(system, state, h, tolerance, fresh, space, work, allowed, event):
    """Advance `state` by one step `h`; it is unchanged unless the status is OK and the error at most `allowed`.

    A step longer than `event` in which a contact changes its status counts as too inaccurate.

    Returns
    -------
    status : OK, NOT_CONVERGED or CONTACT_FAILED
    error : local error estimate, m: h² times the difference of the robot's accelerations from those predicted
    iterations : of Newton's method
    """
    n = system.model.weight.size
    tolerance *= min(1.0, h / NEWTON_STEP)
    _predict(system, state, h, space, work)
    guess = space.guess
    for i in range(N_ROBOT):
        guess[i] = space.b[1, i]
    if fresh:
        for k in range(system.contacts.shape[0]):
            for i in range(2):
                space.elongation[k, i] = state.contacts[k, SLIP + i]
        q, v = state.cable[:n], state.cable[n : 2 * n]
        status = _matrix(system, state.robot, q, v, state.contacts, space.arc[1], h, space, work)
        if status != OK:
            return status, 0.0, 0
    previous, iteration = np.inf, 0
    while True:
        status = _residuals(system, state, h, space, work)
        if status != OK:
            return status, 0.0, iteration
        change = _newton(system, h, space, work)
        iteration += 1
        if not change < np.inf:
            return NOT_CONVERGED, 0.0, iteration
        rate = change / previous if iteration > 1 else 1.0
        if change * min(1.0, rate / max(1e-3, 1.0 - rate)) < tolerance:
            break
        if iteration >= MAX_ITERATIONS:
            return NOT_CONVERGED, 0.0, iteration
        if rate > SLOW and iteration > 1:
            if change < 100.0 * tolerance and rate > 0.9:
                break  # round-off
            for k in range(system.contacts.shape[0]):
                for i in range(2):
                    space.elongation[k, i] = space.trial[k, i]
            q, v = work.q[1], work.v[1]
            status = _matrix(system, space.stage[1], q, v, state.contacts, space.arc[1], h, space, work)
            if status != OK:
                return status, 0.0, iteration
        previous = change
    status = _residuals(system, state, h, space, work)
    if status != OK:
        return status, 0.0, iteration
    error = 0.0
    for i in range(6):
        error = max(error, ERROR_FACTOR * h * h * abs(space.b[1, i] - guess[i]))
    if error > allowed:
        return OK, error, iteration
    _copy(state, space.saved)
    status = _accept(system, state, h, space, work)
    if status == OK and h > event and _changed(state, space):
        _copy(space.saved, state)
        error = 1e4 * allowed
    return status, error, iteration


@kernel
def _copy(source, target):
    """Write one state over another."""
    for i in range(source.cable.size):
        target.cable[i] = source.cable[i]
    for i in range(source.robot.size):
        target.robot[i] = source.robot[i]
    target.control_work[0] = source.control_work[0]
    for i in range(N_ROBOT):
        target.accelerations[0, i], target.accelerations[1, i] = source.accelerations[0, i], source.accelerations[1, i]
    for k in range(source.contacts.shape[0]):
        for i in range(N_CONTACT):
            target.contacts[k, i] = source.contacts[k, i]


@kernel
def _changed(state, space):
    """Return whether a contact's regime has changed in a step just made: at its end, at a stage, or in between.

    The last shows in the bristle's excess over its limit, which grows as long as the contact slides.
    """
    for k in range(state.contacts.shape[0]):
        for i in range(STATUS, STATUS + 3):
            if state.contacts[k, i] != space.saved.contacts[k, STATUS]:
                return True
        if space.out[0, k, 19] == law.SLIP and space.out[0, k, EXCESS] < space.out[1, k, EXCESS]:
            return True
    return False


@kernel
def advance(system, state, control, t, end, space, work):
    """Integrate from `t` to `end` with controlled steps.

    Parameters
    ----------
    control : (9,) step wanted, longest step, allowed error, event step, tolerance of Newton's method, step of the
        matrix (0: none), number of steps, of iterations, of rejected steps; changed

    Returns
    -------
    status : OK, NOT_CONVERGED where no step is short enough, or OFF_CABLE
    t : time reached
    """
    while end - t > 1e-12 * max(1.0, end):
        left = end - t
        h = left / max(1.0, np.ceil(left / min(control[WANTED], control[LONGEST]) - 1e-9))
        fresh = abs(h - control[MATRIX]) > 1e-9 * h
        status, error, iterations = step(
            system, state, h, control[NEWTON], fresh, space, work, control[ALLOWED], control[EVENT]
        )
        control[ITERATIONS] += iterations
        if status == OFF_CABLE:
            return OFF_CABLE, t
        if status != OK or error > control[ALLOWED]:
            factor = SHRINK
            if status == OK:
                factor = max(SHRINK, SAFETY * (control[ALLOWED] / error) ** 0.25)
            control[WANTED] = h * factor
            control[MATRIX] = 0.0
            control[REJECTED] += 1.0
            if control[WANTED] < SHORTEST:
                return NOT_CONVERGED, t
            continue
        t += h
        control[STEPS] += 1.0
        control[MATRIX] = 0.0 if iterations > 5 else h
        wanted = h * min(GROW, SAFETY * (control[ALLOWED] / max(error, 1e-300)) ** 0.25)
        if wanted > 1.3 * h or wanted < h:  # a step kept is a matrix kept
            control[WANTED] = wanted
    return OK, end
