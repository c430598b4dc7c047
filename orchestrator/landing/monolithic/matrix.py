"""Newton's matrix: the banded one of the cable, bordered by the robot's ten columns.

The contact's part of it, found by differences of the contact law, couples the element under each wheel to the robot.
Eliminating the cable leaves a dense matrix (10, 10) for the robot, the Schur complement.
"""

from __future__ import annotations

from fmus.cable.assembly import HALF_BANDWIDTH, iteration_matrix, locate
from fmus.contact import places as at
from fmus.kernels import banded, dense
from fmus.kernels.jit import kernel
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic.contacts import cable_points, loads, walls
from orchestrator.landing.monolithic.robot import perturb
from orchestrator.landing.monolithic.state import N_ROBOT, NOT_CONVERGED, OK

RATE_STEP, STEP = 1e-6, 1e-8
"""Steps of the differences: m/s and rad/s, m and rad."""


@kernel
def make(system, robot, q, v, contacts, arcs, h, space, work):
    """Make and factorise Newton's matrix at the given state; return the status."""
    model, n_wheels = system.model, system.contacts.shape[0]
    z = h * system.method.eigenvalue
    cable_points(system, q, v, arcs, space.cable_point, work.shape)
    status = _interface_tangent(system, robot, space.cable_point, space.elongation, contacts, space)
    if status != OK:
        return status
    iteration_matrix(model, q, v, 1.0 + 0.0j, z, z * z, work.band, work.matrix, work.element)
    space.coupling[:, :] = 0.0
    for k in range(n_wheels):
        space.offsets[k] = 6 * locate(model, arcs[k], space.shapes[k])
        _add_contact(model, k, z, work.band, space)
        _add_border(model, k, n_wheels, z, space)
    if banded.factorise(work.band) != 0:
        return NOT_CONVERGED
    for j in range(N_ROBOT):
        banded.solve(work.band, space.coupling[j])
    return _schur(n_wheels, z, space)


@kernel
def _interface_tangent(system, robot, points, slips, contacts, space):
    """Write the derivatives of the generalised forces by coordinates and rates of the interface, by differences.

    A displacement also stretches the bristles, by the slip it amounts to.
    """
    n_wheels = system.contacts.shape[0]
    outs, value, base = space.out[0], space.generalized, space.reference
    status = walls(system, robot, points, contacts, outs, space)
    if status != OK:
        return status
    base_slip = space.slip[0]
    for k in range(n_wheels):
        for i in range(2):
            base_slip[k, i] = outs[k, at.SLIP_VELOCITY + i]
            space.trial[k, i] = slips[k, i]
    control = space.control[1]
    loads(system, control, robot, points, space.trial, contacts, outs, base, space)
    for rate in (True, False):
        step = RATE_STEP if rate else STEP
        for column in range(value.size):
            _probe(robot, points, column, step, rate, space)
            status = walls(system, space.probe, space.probe_point, contacts, outs, space)
            if status != OK:
                return status
            for k in range(n_wheels):
                for i in range(2):
                    if rate:
                        space.dslip[k, i, column] = (outs[k, at.SLIP_VELOCITY + i] - base_slip[k, i]) / step
                        space.trial[k, i] = slips[k, i]
                    else:
                        space.trial[k, i] = slips[k, i] + step * space.dslip[k, i, column]
            loads(system, control, space.probe, space.probe_point, space.trial, contacts, outs, value, space)
            target = space.dv if rate else space.dy
            for i in range(value.size):
                target[i, column] = (value[i] - base[i]) / step
    return OK


@kernel
def _probe(robot, points, column, step, rate, space):
    """Write cable points and robot, one coordinate (or rate) of the interface changed, to the workspace."""
    for k in range(points.shape[0]):
        for i in range(at.WHEEL):
            space.probe_point[k, i] = points[k, i]
    for i in range(rb.RIGID):
        space.probe[i] = robot[i]
    if column < 6 * points.shape[0]:
        space.probe_point[column // 6, column % 6 + (at.POINT_RATE if rate else at.POINT)] += step
    else:
        perturb(robot, column - 6 * points.shape[0], step, rate, space.probe, space.quaternions)


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
def _add_contact(model, k, z, band, space):
    """Take from the cable's matrix what contact k adds to the stiffness and damping of the element under it."""
    o, shape = space.offsets[k], space.shapes[k]
    for row in range(12):
        a, i = row // 3, row % 3
        for column in range(12):
            b, j = column // 3, column % 3
            total = 0.0 + 0.0j
            for side in range(2):
                for other in range(2):
                    r, c = 6 * k + 3 * side + i, 6 * k + 3 * other + j
                    weight = shape[4 * side + a] * shape[4 * other + b]
                    total += weight * (z * z * space.dy[r, c] + z * space.dv[r, c])
            if _free(model, o + row) and _free(model, o + column):
                band[o + row, HALF_BANDWIDTH + column - row] -= total


@kernel
def _add_border(model, k, n_wheels, z, space):
    """Write how the robot acts on the element under wheel k (columns, `coupling`) and that on it (rows, `border`)."""
    o, shape, first = space.offsets[k], space.shapes[k], 6 * n_wheels
    for row in range(12):
        a, i = row // 3, row % 3
        for j in range(N_ROBOT):
            total = 0.0 + 0.0j
            back = 0.0 + 0.0j
            for side in range(2):
                r = 6 * k + 3 * side + i
                total += shape[4 * side + a] * (z * z * space.dy[r, first + j] + z * space.dv[r, first + j])
                back += shape[4 * side + a] * (z * z * space.dy[first + j, r] + z * space.dv[first + j, r])
            if _free(model, o + row):
                space.coupling[j, o + row] -= total
            space.border[k, j, row] = -back


@kernel
def _schur(n_wheels, z, space):
    """Write and factorise the matrix of the robot that is left when the cable is eliminated; return 1 if singular."""
    first = 6 * n_wheels
    for i in range(N_ROBOT):
        for j in range(N_ROBOT):
            entry = -(z * z * space.dy[first + i, first + j] + z * space.dv[first + i, first + j])
            if i == j:
                entry += 1.0
            for k in range(n_wheels):
                for c in range(12):
                    entry -= space.border[k, i, c] * space.coupling[j, space.offsets[k] + c]
            space.schur[i, j] = entry
    return dense.factorise(space.schur, space.pivots)
