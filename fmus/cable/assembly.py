"""The cable as a whole: its model, its internal force, its iteration matrix, and what acts and is seen at a port."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable import air, element
from fmus.kernels.jit import kernel

HALF_BANDWIDTH = 11
"""Two neighbouring nodes of six coordinates each."""


class Model(NamedTuple):
    """A meshed cable; n = 6 (n_elements + 1) coordinates, six a node: r, r_x.

    Attributes
    ----------
    s : (n_elements + 1,) arc lengths of the nodes, m
    ea, ei, damping, density, gravity : N, N m², s, kg/m, m/s²
    mass_damping, drag : of the damping in proportion to mass 1/s, and of the air, ½ ρ_air C_d d, kg/m²
    wind : (3,) velocity of the air, m/s
    weight : (n,) generalised force of gravity (eq. 26)
    ends : (2, 3, 3) projectors onto the directions in which the slope of the first and last node may change:
        identity where pinned, d dᵀ (d along the unstressed line) where clamped, so that strain stays free
    """

    s: np.ndarray
    ea: float
    ei: float
    damping: float
    density: float
    gravity: float
    mass_damping: float
    drag: float
    wind: np.ndarray
    weight: np.ndarray
    ends: np.ndarray


class ElementWork(NamedTuple):
    """Workspace of one element: its matrices (12, 12), scalar mass matrix (4, 4), vectors."""

    K: np.ndarray
    C: np.ndarray
    m: np.ndarray
    points: np.ndarray
    out: np.ndarray


def element_work() -> ElementWork:
    """Return a new workspace."""
    return ElementWork(np.zeros((12, 12)), np.zeros((12, 12)), np.zeros((4, 4)), np.zeros((7, 4)), np.zeros(2))


@kernel
def internal_force(model, q, v, force, work):
    """Write the internal force Q_e + Q_d to `force` (n,).

    Returns elastic energy (J) and dissipated power (W).
    """
    force[:] = 0.0
    work.out[:] = 0.0
    for e in range(model.s.size - 1):
        l = model.s[e + 1] - model.s[e]
        element.internal_force(q, v, 6 * e, l, model.ea, model.ei, model.damping, force, work.out)
    return work.out[0], work.out[1]


@kernel
def add_inertia(model, a, force, work):
    """Add M a to `force` (n,)."""
    for e in range(model.s.size - 1):
        element.mass(model.s[e + 1] - model.s[e], model.density, work.m)
        for i in range(4):
            for j in range(4):
                f = work.m[i, j]
                for k in range(3):
                    force[6 * e + 3 * i + k] += f * a[6 * e + 3 * j + k]


@kernel
def add_outer_damping(model, q, v, force, work):
    """Add what damping from outside takes to `force` (n,): α M v and the drag of the air; return the power of each, W."""
    mass = drag = 0.0
    if model.mass_damping > 0.0:
        mass = _add_mass_damping(model, v, force, work)
    if model.drag > 0.0:
        for e in range(model.s.size - 1):
            l = model.s[e + 1] - model.s[e]
            drag += air.add_drag(q, v, 6 * e, l, model.drag, model.wind, force, work.points)
    return mass, drag


@kernel
def _add_mass_damping(model, v, force, work):
    """Add α M v to `force` (n,); return α v·M v."""
    power = 0.0
    for e in range(model.s.size - 1):
        element.mass(model.s[e + 1] - model.s[e], model.mass_damping * model.density, work.m)
        for i in range(4):
            for j in range(4):
                for k in range(3):
                    f = work.m[i, j] * v[6 * e + 3 * j + k]
                    force[6 * e + 3 * i + k] += f
                    power += f * v[6 * e + 3 * i + k]
    return power


@kernel
def residual(model, q, v, a, external, force, work):
    """Write M a + Q(q, v) + outer damping - weight - external to `force` (n,), supports not applied.

    Returns
    -------
    material, mass, drag : power that each kind of damping takes, W; in the order of `state.DISSIPATED`
    """
    material = internal_force(model, q, v, force, work)[1]
    mass, drag = add_outer_damping(model, q, v, force, work)
    add_inertia(model, a, force, work)
    for i in range(force.size):
        force[i] -= model.weight[i] + external[i]
    return material, mass, drag


@kernel
def constrain_vector(model, x):
    """Take from `x` (n,) what the supports hold: the positions of the ends, and their slopes where clamped."""
    n = x.size
    for side in range(2):
        o = side * (n - 6)
        p = model.ends[side]
        x[o] = x[o + 1] = x[o + 2] = 0.0
        x0, x1, x2 = x[o + 3], x[o + 4], x[o + 5]
        for k in range(3):
            x[o + 3 + k] = p[k, 0] * x0 + p[k, 1] * x1 + p[k, 2] * x2


@kernel
def _constrain_element(matrix, o, p, scale, row):
    """Apply the support at node offset `o` (0 or 6) to an element matrix (12, 12); `row` is (4,) work."""
    for i in range(12):
        for k in range(3):
            matrix[i, o + k] = 0.0
            row[k] = matrix[i, o + 3] * p[0, k] + matrix[i, o + 4] * p[1, k] + matrix[i, o + 5] * p[2, k]
        for k in range(3):
            matrix[i, o + 3 + k] = row[k]
    for j in range(12):
        for k in range(3):
            matrix[o + k, j] = 0.0
            row[k] = p[k, 0] * matrix[o + 3, j] + p[k, 1] * matrix[o + 4, j] + p[k, 2] * matrix[o + 5, j]
        for k in range(3):
            matrix[o + 3 + k, j] = row[k]
    for k in range(3):
        matrix[o + k, o + k] = scale
        for j in range(3):
            same = 1.0 if j == k else 0.0
            matrix[o + 3 + k, o + 3 + j] += scale * (same - p[k, j])


@kernel
def iteration_matrix(model, q, v, cm, cv, cq, band, matrix, work):
    """Write cm M + cv C + cq K with the supports applied to `band` (n, 2 HALF_BANDWIDTH + 1).

    C and K are the derivatives of all forces, those of damping from outside included: C = α M + ….
    `cv`, `cq` and `band` are all real or all complex; `matrix` (12, 12) and work points are workspace of that type.
    """
    band[:, :] = 0.0
    n_elements = model.s.size - 1
    for e in range(n_elements):
        l = model.s[e + 1] - model.s[e]
        element.tangent(q, v, 6 * e, l, model.ea, model.ei, model.damping, work.K, work.C, work.points)
        if model.drag > 0.0:
            air.add_drag_tangent(q, v, 6 * e, l, model.drag, model.wind, work.K, work.C, work.points)
        element.mass(l, model.density, work.m)
        for i in range(12):
            for j in range(12):
                matrix[i, j] = cv * work.C[i, j] + cq * work.K[i, j]
                if i % 3 == j % 3:
                    matrix[i, j] += (cm + cv * model.mass_damping) * work.m[i // 3, j // 3]
        for side in range(2):
            if e == side * (n_elements - 1):
                _constrain_element(matrix, 6 * side, model.ends[side], matrix[6 - 6 * side, 6 - 6 * side], matrix[12])
        for i in range(12):
            for j in range(12):
                band[6 * e + i, HALF_BANDWIDTH + j - i] += matrix[i, j]


@kernel
def locate(model, s, shape):
    """Return the element that holds arc length `s` and write its shape functions there to `shape` (8,)."""
    low, high = 0, model.s.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if model.s[middle] <= s:
            low = middle
        else:
            high = middle
    l = model.s[low + 1] - model.s[low]
    element.shape(min(1.0, max(0.0, (s - model.s[low]) / l)), l, shape)
    return low


@kernel
def add_load(model, q, s, force, moment, shape, external):
    """Add a force (N) and a moment about the same point (N m), each (3,), at arc length `s` to `external` (n,).

    The moment turns the tangent at the rate g × ġ / |g|², g = r_x: its generalised force on r_x is M × g / |g|².
    """
    o = 6 * locate(model, s, shape)
    g0 = g1 = g2 = 0.0
    for a in range(4):
        f = shape[4 + a]
        g0 += f * q[o + 3 * a]
        g1 += f * q[o + 3 * a + 1]
        g2 += f * q[o + 3 * a + 2]
    square = g0 * g0 + g1 * g1 + g2 * g2
    m0 = (moment[1] * g2 - moment[2] * g1) / square
    m1 = (moment[2] * g0 - moment[0] * g2) / square
    m2 = (moment[0] * g1 - moment[1] * g0) / square
    for a in range(4):
        external[o + 3 * a] += shape[a] * force[0] + shape[4 + a] * m0
        external[o + 3 * a + 1] += shape[a] * force[1] + shape[4 + a] * m1
        external[o + 3 * a + 2] += shape[a] * force[2] + shape[4 + a] * m2


@kernel
def interpolate(model, x, s, shape, out):
    """Write the field with nodal values `x` (n,) at arc length `s`, and its derivative by s, to `out` (6,)."""
    o = 6 * locate(model, s, shape)
    for k in range(3):
        value = slope = 0.0
        for a in range(4):
            value += shape[a] * x[o + 3 * a + k]
            slope += shape[4 + a] * x[o + 3 * a + k]
        out[k] = value
        out[3 + k] = slope


@kernel
def curvature(model, q, s, shape, out):
    """Write d²r/ds² at arc length `s` to `out` (3,): the exact one of the element that `locate` gives."""
    e = locate(model, s, shape)
    l, o = model.s[e + 1] - model.s[e], 6 * e
    xi = min(1.0, max(0.0, (s - model.s[e]) / l))
    for k in range(3):
        chord = (q[o + 6 + k] - q[o + k]) / l
        out[k] = ((6.0 - 12.0 * xi) * chord + (6.0 * xi - 4.0) * q[o + 3 + k] + (6.0 * xi - 2.0) * q[o + 9 + k]) / l


@kernel
def kinetic_energy(model, v, work, scratch):
    """Return v·M v / 2; `scratch` (n,) is workspace."""
    scratch[:] = 0.0
    add_inertia(model, v, scratch, work)
    total = 0.0
    for i in range(v.size):
        total += 0.5 * v[i] * scratch[i]
    return total


@kernel
def dot(x, y):
    """Return x·y."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total
