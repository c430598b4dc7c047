"""Implicit one-step methods for M a = f(q, v, t): what a step needs, as numbers.

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
