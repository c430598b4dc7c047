"""What is shown of the cable besides its ports: tensions, energies, reactions, shape."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import add_inertia, add_outer_damping, dot, internal_force, interpolate, kinetic_energy, locate
from fmus.cable.ports import port_loads
from fmus.cable.state import DISSIPATED, LAST_MACRO, N_LOSSES
from fmus.kernels.jit import kernel


@kernel
def section_forces(force, section):
    """Write the force of the cross-section in the middle of each element to `section` (n_elements + 2, 3), N.

    The first and the last row, of the supports, are left. The internal forces of an element sum to nothing, so that
    those of all nodes up to it are what it does to its first node: the mean of the section's force P_g - P_h' over it,
    with the weight 6 ξ (1 - ξ), which is the force in its middle where that is linear.

    Parameters
    ----------
    force : (n,) internal force, from `internal_force`
    """
    for k in range(3):
        total = 0.0
        for e in range(section.shape[0] - 2):
            total -= force[6 * e + k]
            section[e + 1, k] = total


@kernel
def _place(model, i):
    """Return the arc length that row `i` of the section forces belongs to."""
    last = model.s.size
    if i == 0 or i == last:
        return model.s[0] if i == 0 else model.s[-1]
    return 0.5 * (model.s[i - 1] + model.s[i])


@kernel
def tension(model, s, tangent, section, shape):
    """Return the tension at arc length `s`: the section's force, linear between the rows of `section`, along the tangent.

    Bending is part of it: in a plane it is EA λ ε + 2 EI λ³ θ'² (README).
    """
    i = locate(model, s, shape)
    i += 1 if s >= _place(model, i + 1) else 0
    start, end = _place(model, i), _place(model, i + 1)
    x = (s - start) / (end - start)
    along = square = 0.0
    for k in range(3):
        along += ((1.0 - x) * section[i, k] + x * section[i + 1, k]) * tangent[k]
        square += tangent[k] * tangent[k]
    return along / np.sqrt(square)


@kernel
def diagnose(model, method, use_alpha, state, ports, out, rows, work):
    """Write what is shown of the cable besides its ports.

    Parameters
    ----------
    ports : (N_PORTS, 14), the loads of the macro step that has just been made
    out : (16,), receives tension left, mid, right, kinetic, elastic, gravitational and dissipated energy, force of the
        left support (3) and of the right one (3) on the cable, the energy dissipated by each kind of damping (3)
    rows : (m, 4), receives position and tension at equally spaced arc lengths
    """
    n = model.weight.size
    q, v, force = state[:n], state[n : 2 * n], work.residual[0]
    out[3] = kinetic_energy(model, v, work.element, force)
    out[4] = internal_force(model, q, v, force, work.element)[0]
    section_forces(force, work.section)
    add_outer_damping(model, q, v, force, work.element)
    out[5] = -dot(model.weight, q)
    out[6] = 0.0
    for i in range(N_LOSSES):
        out[13 + i] = state[4 * n + DISSIPATED + i]
        out[6] += out[13 + i]
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
    out[2] = np.sqrt(out[10] ** 2 + out[11] ** 2 + out[12] ** 2)
    for k in range(3):
        work.section[0, k], work.section[-1, k] = -out[7 + k], out[10 + k]
    interpolate(model, q, 0.5 * model.s[-1], work.shape, work.point[0])
    out[1] = tension(model, 0.5 * model.s[-1], work.point[0, 3:6], work.section, work.shape)
    for i in range(rows.shape[0]):
        s = model.s[-1] * i / (rows.shape[0] - 1)
        interpolate(model, q, s, work.shape, work.point[0])
        for k in range(3):
            rows[i, k] = work.point[0, k]
        rows[i, 3] = tension(model, s, work.point[0, 3:6], work.section, work.shape)
