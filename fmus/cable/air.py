"""Drag of the air on one element: quadratic in the velocity across the line, with its analytic tangent.

With the unit tangent t = r_x/|r_x| and the velocity w = r' - u relative to the wind u, what the air takes is

    f = c |w_n| w_n,   w_n = w - (w·t) t,   c = ½ ρ_air C_d d,

per unstretched length (the stretch, 1e-3, is left out); w along the line has no drag. Where w_n keeps its direction
along a straight element, f s_a is a polynomial of degree 9, which five Gauss points integrate exactly.
Hoerner, Fluid-Dynamic Drag, 1965, chapter III: the cross-flow principle for inclined cylinders.
"""

from __future__ import annotations

import numpy as np

from fmus.cable.element import N_GAUSS, SLOPE, WEIGHTS
from fmus.kernels.jit import kernel

_xi = 0.5 * (np.polynomial.legendre.leggauss(N_GAUSS)[0] + 1.0)
SHAPE = np.stack(
    [1 - 3 * _xi**2 + 2 * _xi**3, _xi - 2 * _xi**2 + _xi**3, 3 * _xi**2 - 2 * _xi**3, _xi**3 - _xi**2], axis=1
)
"""(5, 4): Hermite functions at the Gauss points; the second and the fourth lack the element's length."""
VALUE, SLOPES, TANGENT, ACROSS, VELOCITY = range(5)
"""Rows of the workspace: shape functions and their derivatives by arc length, t, w_n, r'."""


@kernel
def _flow(q, v, o, l, wind, i, work):
    """Write shape functions, tangent and velocities at Gauss point `i` to `work`; return |r_x|, w·t and |w_n|."""
    s, p, t, n, u = work[VALUE], work[SLOPES], work[TANGENT], work[ACROSS], work[VELOCITY]
    s[0], s[1], s[2], s[3] = SHAPE[i, 0], SHAPE[i, 1] * l, SHAPE[i, 2], SHAPE[i, 3] * l
    p[0], p[1], p[2], p[3] = -SLOPE[i, 0] / l, SLOPE[i, 1], SLOPE[i, 0] / l, SLOPE[i, 2]
    square = along = speed = 0.0
    for k in range(3):
        t[k] = p[2] * (q[o + 6 + k] - q[o + k]) + p[1] * q[o + 3 + k] + p[3] * q[o + 9 + k]
        u[k] = s[0] * v[o + k] + s[1] * v[o + 3 + k] + s[2] * v[o + 6 + k] + s[3] * v[o + 9 + k]
        square += t[k] * t[k]
    size = np.sqrt(square)
    for k in range(3):
        t[k] /= size
        along += t[k] * (u[k] - wind[k])
    for k in range(3):
        n[k] = u[k] - wind[k] - along * t[k]
        speed += n[k] * n[k]
    return size, along, np.sqrt(speed)


@kernel
def add_drag(q, v, o, l, drag, wind, force, work):
    """Add what the air takes from the element at offset `o` to `force` (n,); return its power, W.

    Parameters
    ----------
    q, v : (n,) coordinates and velocities of the whole cable; the element's are o … o + 12
    l, drag : element length m, ½ ρ_air C_d d kg/m²
    wind : (3,) m/s; with one, the power may be negative: the air then drives the cable
    work : (7, 4)
    """
    power, s, n, u = 0.0, work[VALUE], work[ACROSS], work[VELOCITY]
    for i in range(N_GAUSS):
        _size, _along, speed = _flow(q, v, o, l, wind, i, work)
        factor = WEIGHTS[i] * l * drag * speed
        for k in range(3):
            f = factor * n[k]
            power += f * u[k]
            for a in range(4):
                force[o + 3 * a + k] += f * s[a]
    return power


@kernel
def add_drag_tangent(q, v, o, l, drag, wind, K, C, work):
    """Add the derivatives of the drag by q and q' to K and C, each (12, 12); parameters as in `add_drag`.

    Per length, with P = I - t tᵀ,

        df/dr' = c (|w_n| P + w_n w_nᵀ/|w_n|),    df/dr_x = -((w·t) df/dr' + c |w_n| t w_nᵀ) / |r_x|.
    """
    s, p, t, n = work[VALUE], work[SLOPES], work[TANGENT], work[ACROSS]
    for i in range(N_GAUSS):
        size, along, speed = _flow(q, v, o, l, wind, i, work)
        if speed == 0.0:
            continue
        factor = WEIGHTS[i] * l * drag
        for j in range(3):
            for k in range(3):
                same = 1.0 if j == k else 0.0
                by_rate = factor * (speed * (same - t[j] * t[k]) + n[j] * n[k] / speed)
                by_slope = -(along * by_rate + factor * speed * t[j] * n[k]) / size
                for a in range(4):
                    for b in range(4):
                        C[3 * a + j, 3 * b + k] += s[a] * by_rate * s[b]
                        K[3 * a + j, 3 * b + k] += s[a] * by_slope * p[b]
