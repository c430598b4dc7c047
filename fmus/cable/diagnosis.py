"""What is shown of the cable besides its ports: tensions, energies, reactions, shape."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import add_inertia, dot, internal_force, interpolate, kinetic_energy, locate
from fmus.cable.ports import port_loads
from fmus.cable.state import DISSIPATED, LAST_MACRO
from fmus.kernels.jit import kernel


@kernel
def mean_axial_force(model, s, axial, shape):
    """Return the axial force at arc length `s`: the mean over its element, or over both where `s` is a node."""
    e = locate(model, s, shape)
    if e > 0 and s - model.s[e] < 1e-9 * model.s[-1]:
        return 0.5 * (axial[e - 1] + axial[e])
    return axial[e]


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
        port_loads(model, q, ports, 0.5 * state[4 * n + LAST_MACRO], work)
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
