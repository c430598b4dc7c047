"""LU factorisation of banded matrices, cost linear in their size.

A matrix of half bandwidth ``w`` is kept by rows: ``band[i, w + j - i]`` is its element (i, j), so `band` is
(n, 2 w + 1). No pivoting: the matrices here are mass matrices plus (complex) multiples of damping and
stiffness with a positive definite real part, or stiffness matrices at a stable equilibrium. The kernels serve
real and complex matrices alike.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel, summing_kernel


@kernel
def factorise(band):
    """Replace `band` (n, 2 w + 1) by its LU factors; return 1 if a pivot vanishes, else 0."""
    n = band.shape[0]
    w = band.shape[1] // 2
    for k in range(n):
        pivot = band[k, w]
        if abs(pivot) == 0.0 or abs(pivot) != abs(pivot):
            return 1
        inverse = 1.0 / pivot
        band[k, w] = inverse  # the diagonal keeps its inverse: solve() then never divides
        for i in range(k + 1, min(k + w + 1, n)):
            factor = band[i, w + k - i] * inverse
            band[i, w + k - i] = factor
            if factor != 0.0:
                shift = k - i
                for j in range(w + 1, min(2 * w, w + n - 1 - k) + 1):
                    band[i, j + shift] -= factor * band[k, j]
    return 0


@summing_kernel
def solve(band, x):
    """Overwrite `x` (n,) with the solution of the system factorised in `band`."""
    n = band.shape[0]
    w = band.shape[1] // 2
    for i in range(n):
        value = x[i]
        for j in range(max(0, i - w), i):
            value -= band[i, w + j - i] * x[j]
        x[i] = value
    for i in range(n - 1, -1, -1):
        value = x[i]
        for j in range(i + 1, min(n, i + w + 1)):
            value -= band[i, w + j - i] * x[j]
        x[i] = value * band[i, w]
