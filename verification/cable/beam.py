"""Independent statics and small vibrations of a beam-cable in a vertical plane: no element, no code of `fmus`.

The centreline r(s) has stretch λ and inclination θ: r' = λ (cos θ, sin θ). Energy per unstretched length is, with
the strain measure of the project (Green–Lagrange) or engineering strain,

    W = EA/2 ((λ² - 1)/2)² + EI/2 (λ² θ')²      or      W = EA/2 (λ - 1)² + EI/2 θ'².

Stationarity of ∫ (W - f·r + N·(r' - λ e(θ))) ds, e = (cos θ, sin θ), n = (-sin θ, cos θ), gives

    N' = -f,   ∂W/∂λ = N·e,   M = ∂W/∂θ' = EI λ⁴ θ'  (or EI θ'),   M' = -λ N·n,

a boundary-value problem for y, z, θ, M and the unknown tension (H, V) at the left end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.linalg import eigh
from scipy.optimize import root, root_scalar

TOLERANCE = 1e-9
"""Relative residual left by `solve_bvp`."""


@dataclass(frozen=True)
class Beam:
    """A uniform beam-cable: N, N m², kg/m, m, m/s²."""

    ea: float
    ei: float
    density: float
    length: float
    gravity: float = 9.8
    green_lagrange: bool = True

    @property
    def weight(self) -> float:
        return self.density * self.gravity

    def stretch(self, axial: np.ndarray, moment: np.ndarray | float = 0.0) -> np.ndarray:
        """Return λ from the axial component of N and the moment."""
        stretch = 1.0 + axial / self.ea
        if not self.green_lagrange:
            return stretch
        m2 = 2.0 * np.square(moment) / self.ei if self.ei > 0.0 else 0.0
        for _ in range(12):
            f = 0.5 * self.ea * stretch * (stretch**2 - 1.0) + m2 / stretch**5 - axial
            stretch = stretch - f / (self.ea * (1.5 * stretch**2 - 0.5) - 5.0 * m2 / stretch**6)
        return stretch

    def curvature(self, moment: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """Return θ'."""
        return moment / (self.ei * stretch**4) if self.green_lagrange else moment / self.ei


@dataclass(frozen=True)
class Shape:
    """An equilibrium: tension (H, V) at the left end, loads (arc length m, N downwards), the solution by segment."""

    beam: Beam
    h: float
    v: float
    loads: tuple[tuple[float, float], ...]
    knots: np.ndarray
    solution: object
    scale: np.ndarray

    def at(self, s: np.ndarray) -> np.ndarray:
        """Return y, z, θ, M at arc lengths `s`: (4, len(s))."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        k = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, self.knots.size - 2)
        x = (s - self.knots[k]) / (self.knots[k + 1] - self.knots[k])
        values = self.solution(x).reshape(-1, 4, s.size)  # type: ignore[operator]
        return values[k, :, np.arange(s.size)].T * self.scale[:, None]

    def force(self, s: np.ndarray) -> np.ndarray:
        """Return N = (N_y, N_z) at `s`: (2, len(s))."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        vertical = self.v + self.beam.weight * s + sum(p * (s > at) for at, p in self.loads)
        return np.stack([np.full(s.size, self.h), vertical])

    def stretch(self, s: np.ndarray) -> np.ndarray:
        """Return λ at `s`."""
        _, _, theta, moment = self.at(s)
        force = self.force(s)
        return self.beam.stretch(force[0] * np.cos(theta) + force[1] * np.sin(theta), moment)


def chord_tension(beam: Beam, chord: float, extra: float = 0.0) -> float:
    """Return the tension of the flat parabola: H/EA = chord/L - 1 + (W/H)²/24, W with `extra` load (Irvine 1981)."""
    w = beam.weight * beam.length + extra
    bracket = (1e-6 * w, beam.ea + 10.0 * w)
    return root_scalar(lambda t: t / beam.ea - (chord / beam.length - 1.0) - (w / t) ** 2 / 24.0, bracket=bracket).root


def equilibrium(
    beam: Beam, span: float, level: float, clamped: bool, loads: Sequence[tuple[float, float]] = ()
) -> Shape:
    """Return the equilibrium between supports at (0, 0) and (span, level); clamps hold θ at the chord's direction."""
    chord, angle = np.hypot(span, level), np.arctan2(level, span)
    t0 = chord_tension(beam, chord, sum(p for _, p in loads))
    knots = np.array([0.0, *(s for s, _ in loads), beam.length])
    scale = np.array([beam.length, beam.length, 1.0, np.sqrt(beam.ei * t0)])
    x = _mesh(min(0.2, np.sqrt(beam.ei / t0) / beam.length))
    n = knots.size - 1
    vertical = [beam.weight * a + sum(p for at, p in loads if at <= a + 1e-12) for a in knots[:-1]]

    def rates(x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        out = np.empty_like(u)
        for k in range(n):
            l = knots[k + 1] - knots[k]
            theta, moment = u[4 * k + 2], u[4 * k + 3] * scale[3]
            nz = p[1] * t0 + vertical[k] + beam.weight * l * x
            axial, shear = (
                p[0] * t0 * np.cos(theta) + nz * np.sin(theta),
                nz * np.cos(theta) - p[0] * t0 * np.sin(theta),
            )
            stretch = beam.stretch(axial, moment)
            rows = stretch * np.cos(theta), stretch * np.sin(theta), beam.curvature(moment, stretch), -stretch * shear
            for i in range(4):
                out[4 * k + i] = l * rows[i] / scale[i]
        return out

    def conditions(left: np.ndarray, right: np.ndarray, p: np.ndarray) -> np.ndarray:
        ends = np.array([0.0, 0.0, span / beam.length, level / beam.length])
        held = [left[2] - angle, right[-2] - angle] if clamped else [left[3], right[-1]]
        return np.concatenate([left[:2] - ends[:2], right[-4:-2] - ends[2:], held, right[:-4] - left[4:]])

    guess = np.empty((4 * n, x.size))
    w = beam.weight * beam.length + sum(p for _, p in loads)
    for k in range(n):
        f = (knots[k] + (knots[k + 1] - knots[k]) * x) / beam.length
        guess[4 * k] = f * span / beam.length
        guess[4 * k + 1] = (f * level - w * chord / (2.0 * t0) * f * (1.0 - f)) / beam.length
        guess[4 * k + 2] = angle - w / (2.0 * t0) * (1.0 - 2.0 * f)
        guess[4 * k + 3] = 0.0
    p0 = np.array([np.cos(angle), np.sin(angle) - 0.5 * w / t0])
    found = solve_bvp(rates, conditions, x, guess, p=p0, tol=TOLERANCE, max_nodes=100_000)
    if not found.success:
        raise RuntimeError(f"boundary-value problem of the beam: {found.message}")
    return Shape(beam, found.p[0] * t0, found.p[1] * t0, tuple(loads), knots, found.sol, scale)


def _mesh(layer: float) -> np.ndarray:
    """Return points on [0, 1], dense within the bending layer at both ends."""
    half = 0.5 * np.sinh(np.linspace(0.0, np.arcsinh(1.0 / layer), 120)) * layer
    return np.concatenate([half[:-1], 1.0 - half[::-1]])


def catenary(beam: Beam, span: float, level: float, s: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return H, V and the points (2, len(s)) of the cable without bending, by quadrature of r' = λ N/|N|.

    For engineering strain it is the elastic catenary of Irvine 1981, section 1.3.
    """
    x, weights = np.polynomial.legendre.leggauss(40)

    def point(h: float, v: float, s: float) -> np.ndarray:
        pieces = np.linspace(0.0, s, 5)
        at = (0.5 * (pieces[1:] + pieces[:-1])[:, None] + 0.5 * s / 4.0 * x).ravel()
        force = np.stack([np.full(at.size, h), v + beam.weight * at])
        size = np.hypot(*force)
        return (beam.stretch(size) * force / size) @ np.tile(weights * 0.5 * s / 4.0, 4)

    t0 = chord_tension(beam, float(np.hypot(span, level)))
    angle = np.arctan2(level, span)
    goal = np.array([span, level])
    start = [np.cos(angle), np.sin(angle) - 0.5 * beam.weight * beam.length / t0]
    found = root(lambda p: (point(p[0] * t0, p[1] * t0, beam.length) - goal) / beam.length, start, tol=1e-14)
    h, v = found.x * t0
    return h, v, np.array([point(h, v, a) for a in s]).T


def cantilever(beam: Beam, force: tuple[float, float], moment: float = 0.0) -> np.ndarray:
    """Return y, z, θ of the tip of a weightless beam that starts along y: a dead tip force and a tip moment.

    N is constant; shooting on the moment at the clamp.
    """

    def rates(s: float, u: np.ndarray) -> np.ndarray:
        c, d = np.cos(u[2]), np.sin(u[2])
        stretch = float(beam.stretch(np.array(force[0] * c + force[1] * d), u[3]))
        shear = force[1] * c - force[0] * d
        return np.array([stretch * c, stretch * d, float(beam.curvature(u[3], np.array(stretch))), -stretch * shear])

    def tip(m: float) -> np.ndarray:
        return solve_ivp(rates, (0.0, beam.length), [0.0, 0.0, 0.0, m], method="DOP853", rtol=1e-13, atol=1e-13).y[
            :, -1
        ]

    reach = moment + force[1] * beam.length
    m = root(lambda m: (tip(m[0])[3] - moment) / (beam.ei / beam.length), [0.8 * reach], tol=1e-13).x[0]
    return tip(m)[:3]


def frequencies(shape: Shape, count: int, degree: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Return natural frequencies (Hz) out of plane and in plane of a pinned beam, by Rayleigh–Ritz with polynomials.

    With p = r', k = p × p' and a disturbance u out of plane, w in plane, the second variation of the energy
    (Green–Lagrange) is ∫ EA ε u'² + EI |u' p' - u'' p|² ds and ∫ EA ((p·w')² + ε |w'|²) + EI ((w' × p' + p × w'')²
    + 2 k w' × w'') ds. The trial functions are x (1 - x) P_j(2 x - 1), exact integration is by Gauss points.
    """
    beam = shape.beam
    pieces = 8
    nodes, weights = np.polynomial.legendre.leggauss(degree)
    x = ((np.arange(pieces)[:, None] + 0.5 * (nodes + 1.0)) / pieces).ravel()
    weight = np.tile(0.5 * weights / pieces, pieces) * beam.length
    f, f1, f2 = _trial_functions(x, degree)
    f1, f2 = f1 / beam.length, f2 / beam.length**2
    s = x * beam.length
    _, _, theta, moment = shape.at(s)
    stretch = shape.stretch(s)
    e, n = np.stack([np.cos(theta), np.sin(theta)]), np.stack([-np.sin(theta), np.cos(theta)])
    turn = beam.curvature(moment, stretch)
    p = stretch * e
    # λ' from the derivative of ∂W/∂λ = N·e, with dλ/ds by a central difference of the solution
    d = 1e-4 * beam.length
    ahead, behind = np.minimum(s + d, beam.length), np.maximum(s - d, 0.0)
    p1 = (shape.stretch(ahead) - shape.stretch(behind)) / (ahead - behind) * e + stretch * turn * n
    strain, k = 0.5 * (stretch**2 - 1.0), stretch**2 * turn
    mass = _gram(weight * beam.density, f, f)
    bend = [f1 * p1[i] - f2 * p[i] for i in range(2)]
    out = _gram(weight * beam.ea * strain, f1, f1) + sum(_gram(weight * beam.ei, b, b) for b in bend)
    zero = np.zeros_like(mass)
    stretching = np.concatenate([f1 * p[0], f1 * p[1]])
    bending = np.concatenate([f1 * p1[1] - f2 * p[1], f2 * p[0] - f1 * p1[0]])
    geometric = _gram(weight * beam.ea * strain, f1, f1)
    cross = _gram(weight * beam.ei * k, f1, f2)  # w' × w'' = w1' w2'' - w2' w1''
    plane = _gram(weight * beam.ea, stretching, stretching) + _gram(weight * beam.ei, bending, bending)
    plane += np.block([[geometric, cross - cross.T], [cross.T - cross, geometric]])
    both = np.block([[mass, zero], [zero, mass]])
    return _lowest(out, mass, count), _lowest(plane, both, count)


def _trial_functions(x: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x (1 - x) P_j(2 x - 1) and two derivatives by x: (degree, len(x)) each."""
    bubble = np.polynomial.Polynomial([0.25, 0.0, -0.25])
    functions = [
        np.polynomial.Legendre.basis(j) * np.polynomial.Legendre.cast(bubble) * (2.0 * j + 1.0) for j in range(degree)
    ]
    t = 2.0 * x - 1.0
    return tuple(np.array([2.0**k * (g.deriv(k) if k else g)(t) for g in functions]) for k in range(3))  # type: ignore


def _gram(weight: np.ndarray, f: np.ndarray, g: np.ndarray) -> np.ndarray:
    return (f * weight) @ g.T


def _lowest(stiffness: np.ndarray, mass: np.ndarray, count: int) -> np.ndarray:
    values = eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, count - 1))
    return np.sqrt(values) / (2.0 * np.pi)
