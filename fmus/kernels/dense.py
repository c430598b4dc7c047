"""LU factorisation of small dense matrices, real or complex, with partial pivoting."""

from __future__ import annotations

from fmus.kernels.jit import kernel


@kernel
def factorise(a, pivots):
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
def solve(a, pivots, x):
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
