"""Implicit one-step methods for M a = f(q, v, t): their coefficients, and the kernels that a step is made of.

Both methods ask for accelerations A_j at one or two *stages* of a step h, where

    v_i = v_0 + h sum_j a_ij A_j,        q_i = q_0 + h c_i v_0 + h² sum_j (a²)_ij A_j,

and differ only in their coefficients. Newton's method needs one linear solve an iteration with the matrix
M + h λ C + h² λ² K, λ being an eigenvalue of (a_ij): real for one stage, one of a complex pair for two.

**Collocation** (two stages, `collocation`): the nodes are the roots of P2 - γ P1, P the Legendre polynomials on [0, 1].
γ = 0 gives Gauss (order 4, spectral radius 1 at infinity, symplectic), γ = 1 gives Radau IIA (order 3, spectral
radius 0); γ = (1 - ρ)/(1 + ρ) gives ρ in between, with an error of third order that is γ times that of Radau. A-stable
for every ρ. Hairer & Wanner, Solving Ordinary Differential Equations II, sections IV.3 and IV.5.

**Generalized-alpha** (`generalized_alpha`): order 2, spectral radius ρ at infinity; Chung & Hulbert 1993, with all
forces at the generalised midpoint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kernels.jit import kernel


class Collocation(NamedTuple):
    """Coefficients of a two-stage collocation method.

    Attributes
    ----------
    c, b : (2,) nodes and weights
    a, aa : (2, 2) a_ij and its square
    bb : (2,) b·a, the weights of the accelerations in the end position
    eigenvalue : () complex λ of a, the other one being its conjugate
    to_mode, from_mode : (2,) complex, r ↦ to_mode·r and w ↦ 2 Re(from_mode w): the change to the eigenvector of λ
        and back
    end : (2,), acceleration at the end of the step on that line
    """

    c: np.ndarray
    b: np.ndarray
    a: np.ndarray
    aa: np.ndarray
    bb: np.ndarray
    eigenvalue: complex
    to_mode: np.ndarray
    from_mode: np.ndarray
    end: np.ndarray


def collocation(spectral_radius: float) -> Collocation:
    """Return the coefficients for a spectral radius at infinity between 0 (Radau IIA) and 1 (Gauss)."""
    gamma = (1.0 - spectral_radius) / (1.0 + spectral_radius)
    c = np.sort(np.roots([6.0, -6.0 - 2.0 * gamma, 1.0 + gamma]).real)
    powers = np.vander(c, 2, increasing=True)
    a = np.stack([c, c**2 / 2], axis=1) @ np.linalg.inv(powers)
    b = np.array([1.0, 0.5]) @ np.linalg.inv(powers)
    values, vectors = np.linalg.eig(a)
    k = int(np.argmax(np.imag(values)))
    order = [k, 1 - k]
    inverse = np.linalg.inv(vectors[:, order])
    line = np.linalg.inv(powers)
    return Collocation(
        c=c,
        b=b,
        a=a,
        aa=a @ a,
        bb=b @ a,
        eigenvalue=complex(values[k]),
        to_mode=np.ascontiguousarray(inverse[0]),
        from_mode=np.ascontiguousarray(vectors[:, k]),
        end=np.array([1.0, 1.0]) @ line,
    )


class GeneralizedAlpha(NamedTuple):
    """Coefficients of the generalized-alpha method: alpha_m, alpha_f, beta, gamma of Chung & Hulbert."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float


def generalized_alpha(spectral_radius: float) -> GeneralizedAlpha:
    """Return the coefficients of optimal damping for a spectral radius at infinity between 0 and 1."""
    rho = spectral_radius
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    return GeneralizedAlpha(alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma)


# --- a step of collocation: predict the stages' accelerations, then until `judge` is content: stages, residuals,
# to_mode, solve, correct; then accept. Rows of accelerations (2, n) belong to the two stages.

GO_ON, RENEW, DONE, FAILED = range(4)
"""What `judge` says of Newton's method: another iteration, one with a new matrix, enough, or it does not converge."""


@kernel
def stage_distances(method, ratio):
    """Return how far the stages of a step lie behind the first stage of the one before, in lengths of the latter.

    Parameters
    ----------
    ratio : length of this step over that of the one before; 0: there is none, and its second stage stands for both
    """
    if ratio > 0.0:
        return 1.0 + ratio * method.c[0] - method.c[0], 1.0 + ratio * method.c[1] - method.c[0]
    apart = method.c[1] - method.c[0]
    return apart, apart


@kernel
def predict(last, apart, distances, a):
    """Write to `a` (2, n) the values at two `distances` on the line through those of `last` (2, n), `apart` apart."""
    for i in range(last.shape[1]):
        slope = (last[1, i] - last[0, i]) / apart
        a[0, i] = last[0, i] + slope * distances[0]
        a[1, i] = last[0, i] + slope * distances[1]


@kernel
def to_stage(method, j, first, second):
    """Return the integral, over h, from the start of a step to stage j of a rate with these values at the stages."""
    return method.a[j, 0] * first + method.a[j, 1] * second


@kernel
def to_end(method, first, second):
    """Return the integral, over h, over a step of a rate with these values at the stages."""
    return method.b[0] * first + method.b[1] * second


@kernel
def stage(method, j, h, q0, v0, first, second, q, v):
    """Write position and velocity (n,) at stage j, from those at the start and the accelerations at both stages."""
    for i in range(q0.size):
        q[i] = q0[i] + h * (method.c[j] * v0[i] + h * (method.aa[j, 0] * first[i] + method.aa[j, 1] * second[i]))
        v[i] = v0[i] + h * to_stage(method, j, first[i], second[i])


@kernel
def to_mode(method, residual, mode):
    """Write the right-hand side of the one complex system that stands for both stages' residuals (2, n)."""
    for i in range(residual.shape[1]):
        mode[i] = -(method.to_mode[0] * residual[0, i] + method.to_mode[1] * residual[1, i])


@kernel
def correct(method, h, mode, a):
    """Add to the accelerations (2, n) what the solution `mode` (n,) stands for.

    Returns the largest change of a coordinate in this step; infinity if the solution is not finite.
    """
    scale, change = h * h * abs(method.eigenvalue) ** 2, 0.0
    for i in range(a.shape[1]):
        for j in range(2):
            increment = 2.0 * (method.from_mode[j] * mode[i]).real
            a[j, i] += increment
            if not abs(increment) < np.inf:
                return np.inf
            change = max(change, scale * abs(increment))
    return change


@kernel
def accept(method, h, q, v, first, second):
    """Move position and velocity (n,) from the start of a step to its end, by the accelerations at both stages."""
    for i in range(q.size):
        q[i] += h * (v[i] + h * (method.bb[0] * first[i] + method.bb[1] * second[i]))
        v[i] += h * to_end(method, first[i], second[i])


@kernel
def judge(change, previous, left, tolerance, slow):
    """Return what to do after an iteration of Newton's method with a kept matrix: GO_ON, RENEW, DONE or FAILED.

    It converges linearly: what is left is about change · rate / (1 - rate). An iteration that no longer gets smaller
    near the tolerance has come down to round-off.

    Parameters
    ----------
    change, previous : largest changes of a coordinate in this iteration and the one before (infinite: none)
    left : number of iterations still allowed
    tolerance : of the error left
    slow : contraction above which the matrix is made anew
    """
    if not change < np.inf:
        return FAILED
    first = previous == np.inf
    rate = 1.0 if first else change / previous
    if change * min(1.0, rate / max(1e-3, 1.0 - rate)) < tolerance:
        return DONE
    if not first and rate > 0.9 and change < 100.0 * tolerance:
        return DONE
    if left <= 0:
        return FAILED
    return RENEW if rate > slow and not first else GO_ON
