"""The gradient-deficient ANCF cable element: mass, elastic and damping force, analytic tangent.

Jia et al. 2025, eqs. (6)–(26). A node carries position r and slope r_x, an element 12 coordinates in the order
r1, r_x1, r2, r_x2. With g = r_x and h = r_xx the energy per unstretched length is

    W = EA/2 eps² + EI/2 |k|²,   eps = (g·g - 1)/2,   k = g × h,

and Kelvin–Voigt damping replaces eps by eps + c eps', k by k + c k' in the stresses (c is the damping time). Both
parts of W are polynomials of degree 8 and 6 along the element, so five Gauss points integrate them exactly: the
result is that of the constant coefficient tensors of eqs. (19)–(26).

All fields derive from three vectors, d = (r2 - r1)/l, r_x1, r_x2, which keeps round-off small on long spans.
"""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel, summing_kernel

N_GAUSS = 5
_x, _w = np.polynomial.legendre.leggauss(N_GAUSS)
_xi = 0.5 * (_x + 1.0)
WEIGHTS = 0.5 * _w
"""Gauss weights on [0, 1]."""
SLOPE = np.stack([6 * _xi - 6 * _xi**2, 1 - 4 * _xi + 3 * _xi**2, 3 * _xi**2 - 2 * _xi], axis=1)
"""(5, 3): g = SLOPE · (d, r_x1, r_x2) at the Gauss points."""
BEND = np.stack([6 - 12 * _xi, 6 * _xi - 4, 6 * _xi - 2], axis=1)
"""(5, 3): l h = BEND · (d, r_x1, r_x2) at the Gauss points."""


@kernel
def shape(xi, length, out):
    """Write the Hermite functions s_a (eq. 7) to ``out[0:4]``, their derivatives by arc length to ``out[4:8]``."""
    out[0] = 1.0 - 3.0 * xi * xi + 2.0 * xi**3
    out[1] = length * (xi - 2.0 * xi * xi + xi**3)
    out[2] = 3.0 * xi * xi - 2.0 * xi**3
    out[3] = length * (xi**3 - xi * xi)
    out[4] = (6.0 * xi * xi - 6.0 * xi) / length
    out[5] = 1.0 - 4.0 * xi + 3.0 * xi * xi
    out[6] = -out[4]
    out[7] = 3.0 * xi * xi - 2.0 * xi


@kernel
def mass(l, density, out):
    """Write the scalar mass matrix m_ab = ∫ rhoA s_a s_b dx (eq. 10) to `out` (4, 4)."""
    f = density * l / 420.0
    out[0, 0] = out[2, 2] = 156.0 * f
    out[0, 1] = out[1, 0] = 22.0 * l * f
    out[0, 2] = out[2, 0] = 54.0 * f
    out[0, 3] = out[3, 0] = -13.0 * l * f
    out[1, 1] = out[3, 3] = 4.0 * l * l * f
    out[1, 2] = out[2, 1] = 13.0 * l * f
    out[1, 3] = out[3, 1] = -3.0 * l * l * f
    out[2, 3] = out[3, 2] = -22.0 * l * f


@summing_kernel
def internal_force(q, v, o, l, ea, ei, c, force, out):
    """Add the elastic and damping force of the element at offset `o` of q and v to `force`.

    Parameters
    ----------
    q, v : (n,) coordinates and velocities of the whole cable; the element's are o … o + 12
    l, ea, ei, c : element length m, axial stiffness N, bending stiffness N m², damping time s
    force : (n,), Q_e + Q_d is added (eqs. 22, 24)
    out : (2,) elastic energy J and dissipated power W, added to
    """
    # d, r_x1, r_x2 and their rates
    d0, d1, d2 = (q[o + 6] - q[o]) / l, (q[o + 7] - q[o + 1]) / l, (q[o + 8] - q[o + 2]) / l
    e0, e1, e2 = (v[o + 6] - v[o]) / l, (v[o + 7] - v[o + 1]) / l, (v[o + 8] - v[o + 2]) / l
    a0, a1, a2 = q[o + 3], q[o + 4], q[o + 5]
    b0, b1, b2 = q[o + 9], q[o + 10], q[o + 11]
    ad0, ad1, ad2 = v[o + 3], v[o + 4], v[o + 5]
    bd0, bd1, bd2 = v[o + 9], v[o + 10], v[o + 11]
    fd0 = fd1 = fd2 = fa0 = fa1 = fa2 = fb0 = fb1 = fb2 = 0.0
    energy = power = 0.0
    for i in range(N_GAUSS):
        s0, s1, s2 = SLOPE[i, 0], SLOPE[i, 1], SLOPE[i, 2]
        z0, z1, z2 = BEND[i, 0] / l, BEND[i, 1] / l, BEND[i, 2] / l
        g0, g1, g2 = s0 * d0 + s1 * a0 + s2 * b0, s0 * d1 + s1 * a1 + s2 * b1, s0 * d2 + s1 * a2 + s2 * b2
        h0, h1, h2 = z0 * d0 + z1 * a0 + z2 * b0, z0 * d1 + z1 * a1 + z2 * b1, z0 * d2 + z1 * a2 + z2 * b2
        gd0, gd1, gd2 = (
            s0 * e0 + s1 * ad0 + s2 * bd0,
            s0 * e1 + s1 * ad1 + s2 * bd1,
            s0 * e2 + s1 * ad2 + s2 * bd2,
        )
        hd0, hd1, hd2 = (
            z0 * e0 + z1 * ad0 + z2 * bd0,
            z0 * e1 + z1 * ad1 + z2 * bd1,
            z0 * e2 + z1 * ad2 + z2 * bd2,
        )
        eps = 0.5 * (g0 * g0 + g1 * g1 + g2 * g2 - 1.0)
        eps_rate = g0 * gd0 + g1 * gd1 + g2 * gd2
        k0, k1, k2 = g1 * h2 - g2 * h1, g2 * h0 - g0 * h2, g0 * h1 - g1 * h0
        kd0 = gd1 * h2 - gd2 * h1 + g1 * hd2 - g2 * hd1
        kd1 = gd2 * h0 - gd0 * h2 + g2 * hd0 - g0 * hd2
        kd2 = gd0 * h1 - gd1 * h0 + g0 * hd1 - g1 * hd0
        w = WEIGHTS[i] * l
        energy += 0.5 * w * (ea * eps * eps + ei * (k0 * k0 + k1 * k1 + k2 * k2))
        power += w * c * (ea * eps_rate * eps_rate + ei * (kd0 * kd0 + kd1 * kd1 + kd2 * kd2))
        n = ea * (eps + c * eps_rate)
        m0, m1, m2 = ei * (k0 + c * kd0), ei * (k1 + c * kd1), ei * (k2 + c * kd2)
        # P_g = n g + h × m, P_h = m × g
        pg0, pg1, pg2 = (
            w * (n * g0 + h1 * m2 - h2 * m1),
            w * (n * g1 + h2 * m0 - h0 * m2),
            w * (n * g2 + h0 * m1 - h1 * m0),
        )
        ph0, ph1, ph2 = w * (m1 * g2 - m2 * g1), w * (m2 * g0 - m0 * g2), w * (m0 * g1 - m1 * g0)
        fd0 += s0 * pg0 + z0 * ph0
        fd1 += s0 * pg1 + z0 * ph1
        fd2 += s0 * pg2 + z0 * ph2
        fa0 += s1 * pg0 + z1 * ph0
        fa1 += s1 * pg1 + z1 * ph1
        fa2 += s1 * pg2 + z1 * ph2
        fb0 += s2 * pg0 + z2 * ph0
        fb1 += s2 * pg1 + z2 * ph1
        fb2 += s2 * pg2 + z2 * ph2
    force[o] -= fd0 / l
    force[o + 1] -= fd1 / l
    force[o + 2] -= fd2 / l
    force[o + 3] += fa0
    force[o + 4] += fa1
    force[o + 5] += fa2
    force[o + 6] += fd0 / l
    force[o + 7] += fd1 / l
    force[o + 8] += fd2 / l
    force[o + 9] += fb0
    force[o + 10] += fb1
    force[o + 11] += fb2
    out[0] += energy
    out[1] += power


@kernel
def tangent(q, v, o, l, ea, ei, c, K, C, work):
    """Write dQ/dq (eq. 23, damping included) and dQ/dq' of one element to K and C, each (12, 12).

    Parameters as in `internal_force`; `work` is (7, 4). K is symmetric where v = 0. With g' = g + c ġ, h' = h + c ḣ
    and m = EI (k + c k') the blocks are

        dP_g/dg = n I + EA g ⊗ g' + EI (h·h' I - h' ⊗ h),      dP_g/dh = EI (g' ⊗ h - h·g' I) - [m]ₓ,
        dP_h/dh = EI (g·g' I - g' ⊗ g),                        dP_h/dg = EI (h' ⊗ g - g·h' I) + [m]ₓ.
    """
    K[:, :] = 0.0
    C[:, :] = 0.0
    g, h, gp, hp, m, s, z = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    for i in range(N_GAUSS):
        # weights of r1, r_x1, r2, r_x2 in g and h
        s[0], s[1], s[2], s[3] = -SLOPE[i, 0] / l, SLOPE[i, 1], SLOPE[i, 0] / l, SLOPE[i, 2]
        z[0], z[1], z[2], z[3] = -BEND[i, 0] / l / l, BEND[i, 1] / l, BEND[i, 0] / l / l, BEND[i, 2] / l
        for k in range(3):
            dq, dv = q[o + 6 + k] - q[o + k], v[o + 6 + k] - v[o + k]
            g[k] = s[2] * dq + s[1] * q[o + 3 + k] + s[3] * q[o + 9 + k]
            h[k] = z[2] * dq + z[1] * q[o + 3 + k] + z[3] * q[o + 9 + k]
            gp[k] = g[k] + c * (s[2] * dv + s[1] * v[o + 3 + k] + s[3] * v[o + 9 + k])
            hp[k] = h[k] + c * (z[2] * dv + z[1] * v[o + 3 + k] + z[3] * v[o + 9 + k])
        gg = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        hh = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
        gh = g[0] * h[0] + g[1] * h[1] + g[2] * h[2]
        ggp = g[0] * gp[0] + g[1] * gp[1] + g[2] * gp[2]
        hhp = h[0] * hp[0] + h[1] * hp[1] + h[2] * hp[2]
        hgp = h[0] * gp[0] + h[1] * gp[1] + h[2] * gp[2]
        ghp = g[0] * hp[0] + g[1] * hp[1] + g[2] * hp[2]
        n = ea * (0.5 * (gg - 1.0) + ggp - gg)
        for k in range(3):
            j, k2 = (k + 1) % 3, (k + 2) % 3
            # k + c k' = g × h' + (g' - g) × h
            m[k] = ei * (g[j] * hp[k2] - g[k2] * hp[j] + (gp[j] - g[j]) * h[k2] - (gp[k2] - g[k2]) * h[j])
        w = WEIGHTS[i] * l
        for j in range(3):
            for k in range(3):
                same = 1.0 if j == k else 0.0
                cross = 0.0  # [m]ₓ at (j, k)
                if k == (j + 1) % 3:
                    cross = -m[(j + 2) % 3]
                elif k == (j + 2) % 3:
                    cross = m[(j + 1) % 3]
                kgg = w * (n * same + ea * g[j] * gp[k] + ei * (hhp * same - hp[j] * h[k]))
                kgh = w * (ei * (gp[j] * h[k] - hgp * same) - cross)
                khg = w * (ei * (hp[j] * g[k] - ghp * same) + cross)
                khh = w * ei * (ggp * same - gp[j] * g[k])
                cgg = w * c * (ea * g[j] * g[k] + ei * (hh * same - h[j] * h[k]))
                cgh = w * c * ei * (g[j] * h[k] - gh * same)
                chg = w * c * ei * (h[j] * g[k] - gh * same)
                chh = w * c * ei * (gg * same - g[j] * g[k])
                for a in range(4):
                    kg, kh = s[a] * kgg + z[a] * khg, s[a] * kgh + z[a] * khh
                    cg, ch = s[a] * cgg + z[a] * chg, s[a] * cgh + z[a] * chh
                    for b in range(4):
                        K[3 * a + j, 3 * b + k] += kg * s[b] + kh * z[b]
                        C[3 * a + j, 3 * b + k] += cg * s[b] + ch * z[b]
