"""Static equilibrium under gravity, and the catenary that Newton's method starts from."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import (
    HALF_BANDWIDTH,
    Model,
    constrain_vector,
    dot,
    element_work,
    internal_force,
    iteration_matrix,
)
from fmus.kernels import banded
from fmus.kernels.roots import root
from fmus.module.variables import ModuleError

MAX_ITERATIONS = 300
TOLERANCE = 1e-13
"""Largest change of a coordinate, relative to the length of the cable, that ends the iteration."""


def mesh_model(
    s: np.ndarray,
    *,
    span: float,
    level_difference: float,
    ea: float,
    ei: float,
    damping: float,
    density: float,
    gravity: float,
    clamped: bool,
    mass_damping: float = 0.0,
    drag: float = 0.0,
) -> Model:
    """Return the cable with nodes at the arc lengths `s` (n + 1,), m.

    The left support is the origin, the right one (0, span, level_difference).
    """
    l = np.diff(s)
    if l.size == 0 or np.min(l) <= 0.0:
        raise ValueError("a cable needs two nodes at least, at rising arc lengths")
    weight = np.zeros(6 * s.size)
    for offset, share in ((2, l / 2), (5, l**2 / 12), (8, l / 2), (11, -(l**2) / 12)):
        np.add.at(weight, 6 * np.arange(l.size) + offset, -density * gravity * share)
    chord = np.array([0.0, span, level_difference]) / np.hypot(span, level_difference)
    free = np.outer(chord, chord) if clamped else np.eye(3)
    wind = np.zeros(3)  # still air; the drag is written for any
    return Model(s, ea, ei, damping, density, gravity, mass_damping, drag, wind, weight, np.stack([free, free]))


def catenary(model: Model, span: float, level_difference: float) -> np.ndarray:
    """Return nodal coordinates (n,) on the elastic catenary between the supports: no bending stiffness.

    Irvine, Cable Structures, 1981, section 1.3: with horizontal tension H and vertical tension V at the left end,
    y(s) = H s/EA + H/w (asinh(V/H) - asinh((V - w s)/H)), and likewise z(s). Strains here are engineering strains.
    A weightless or very taut cable is put on the straight line.
    """
    weight = model.density * model.gravity * model.s[-1]
    taut = model.ea * max(np.hypot(span, level_difference) / model.s[-1] - 1.0, 0.0)
    if weight < 1e-9 * taut or weight == 0.0:
        return _on_line(model, span, level_difference)
    h = _horizontal_tension(model, span, level_difference, 10.0 * (taut + weight))
    if h is None:
        return _on_line(model, span, level_difference)
    w, v = weight / model.s[-1], _vertical_tension(model, h, level_difference)
    q = np.zeros(6 * model.s.size)
    tension = np.hypot(h, w * model.s - v)
    stretch = 1.0 + tension / model.ea
    q[1::6] = [_reach(h, v, w, s, model.ea) for s in model.s]
    q[2::6] = [_drop(h, v, w, s, model.ea) for s in model.s]
    q[4::6] = stretch * h / tension
    q[5::6] = stretch * (w * model.s - v) / tension
    return q


def _horizontal_tension(model: Model, span: float, level_difference: float, high: float) -> float | None:
    """Return the horizontal tension with which the catenary reaches the right support, or None if there is none."""
    w, length = model.density * model.gravity, model.s[-1]

    def excess(h: float) -> float:
        return _reach(h, _vertical_tension(model, h, level_difference), w, length, model.ea) - span

    low = 1e-6 * w * length
    while excess(high) < 0.0:
        high *= 10.0
    while excess(low) > 0.0:
        low *= 0.1
        if low < 1e-15 * w * length:
            return None
    return root(excess, low, high, rtol=1e-14)


def _vertical_tension(model: Model, h: float, level_difference: float) -> float:
    """Return the vertical tension at the left end with which the catenary ends at the level of the right support."""
    w, length = model.density * model.gravity, model.s[-1]
    bound = 1e3 * (w * length + h)
    return root(lambda v: _drop(h, v, w, length, model.ea) - level_difference, -bound, bound)


def _reach(h: float, v: float, w: float, s: float, ea: float) -> float:
    return h * s / ea + h / w * (np.arcsinh(v / h) - np.arcsinh((v - w * s) / h))


def _drop(h: float, v: float, w: float, s: float, ea: float) -> float:
    return -(v * s - w * s * s / 2) / ea - h / w * (np.hypot(1.0, v / h) - np.hypot(1.0, (v - w * s) / h))


def _on_line(model: Model, span: float, level_difference: float) -> np.ndarray:
    """Return nodal coordinates (n,) on the straight line between the supports."""
    q = np.zeros(6 * model.s.size)
    f = model.s / model.s[-1]
    q[1::6], q[2::6] = f * span, f * level_difference
    q[4::6], q[5::6] = span / model.s[-1], level_difference / model.s[-1]
    return q


def equilibrium(model: Model, span: float, level_difference: float, load: np.ndarray | None = None) -> np.ndarray:
    """Return the coordinates (n,) in static equilibrium under gravity and `load`.

    The potential energy is minimised by Newton's method from the catenary. Should that fail (a slack cable in clamps,
    whose bending layer is shorter than an element), the bending stiffness is lowered to its value in steps.

    Parameters
    ----------
    model : the cable
    span, level_difference : where the right support stands, m
    load : (n,) generalised dead load besides gravity, N

    Raises
    ------
    ModuleError : no equilibrium found
    """
    external = model.weight if load is None else model.weight + load
    for stiffer in (1, 12, 40):
        q = _clamp(model, catenary(model, span, level_difference), span, level_difference)
        converged = False
        for ei in _bending_stiffnesses(model, stiffer):
            converged, q = _minimise(model._replace(ei=ei), q, external)
        if converged:
            return q
    raise ModuleError(f"cable: no static equilibrium was found; {_cure(model)}")


def _cure(model: Model) -> str:
    """Return what to do about a missing equilibrium.

    In clamps, elements much longer than the bending layer √(EI/T) cannot follow it: a slack cable then buckles there,
    on paper only, and the equilibrium in the vertical plane is not a minimum of the energy.
    """
    weight = model.density * model.gravity * model.s[-1]
    if weight == 0.0:
        return "a slack cable without gravity has none; shorten unstretched_length or set gravity"
    layer, first = np.sqrt(model.ei / weight), model.s[1]
    if np.linalg.matrix_rank(model.ends[0]) == 1 and first > layer:
        return (
            f"the cable bends in the clamps over about {layer:.2g} m, but the first element is {first:.2g} m long: "
            "set grading, e.g. 30, or more n_elements"
        )
    return "check unstretched_length, span and axial_stiffness, or take more elements"


def _bending_stiffnesses(model: Model, n: int) -> np.ndarray:
    """Return `n` falling bending stiffnesses that end with the model's; the first has a layer as long as an element."""
    weight = model.density * model.gravity * model.s[-1]
    first = weight * np.max(np.diff(model.s)) ** 2
    if n == 1 or first <= model.ei:
        return np.array([model.ei])
    return np.append(np.geomspace(first, max(model.ei, 1e-9 * first), n - 1), model.ei)


def _clamp(model: Model, q: np.ndarray, span: float, level_difference: float) -> np.ndarray:
    """Put the ends on the supports and turn clamped slopes into their direction."""
    q = q.copy()
    q[0:3], q[-6:-3] = 0.0, (0.0, span, level_difference)
    for side, o in ((0, 3), (1, q.size - 3)):
        slope = q[o : o + 3]
        projected = model.ends[side] @ slope
        q[o : o + 3] = projected * np.linalg.norm(slope) / max(np.linalg.norm(projected), 1e-12)
    return q


class _Potential:
    """Potential energy of the cable under dead loads, relative to where the search starts, with its derivatives."""

    def __init__(self, model: Model, q0: np.ndarray, external: np.ndarray):
        n = q0.size
        self.model, self.q0, self.external = model, q0.copy(), external
        self.zero, self.force = np.zeros(n), np.zeros(n)
        self.band, self.matrix = np.zeros((n, 2 * HALF_BANDWIDTH + 1)), np.zeros((13, 12))
        self.work = element_work()

    def evaluate(self, q: np.ndarray) -> tuple[float, np.ndarray]:
        """Return energy (J) and residual (n,)."""
        energy = internal_force(self.model, q, self.zero, self.force, self.work)[0]
        residual = self.force - self.external
        constrain_vector(self.model, residual)
        return energy - dot(self.external, q - self.q0), residual

    def newton_step(self, q: np.ndarray, residual: np.ndarray, shift: float) -> np.ndarray | None:
        """Return the step with the matrix shifted by `shift` mass matrices; None unless it is positive definite."""
        iteration_matrix(self.model, q, self.zero, shift, 0.0, 1.0, self.band, self.matrix, self.work)
        if banded.factorise(self.band) or np.any(self.band[:, HALF_BANDWIDTH] <= 0.0):
            return None
        step = -residual
        banded.solve(self.band, step)
        return step if np.all(np.isfinite(step)) else None


def _minimise(model: Model, q: np.ndarray, external: np.ndarray) -> tuple[bool, np.ndarray]:
    """Minimise the potential energy from `q`; return whether the last steps were below the tolerance, and the result.

    Newton's method: each step is shortened until the energy falls, and the matrix is shifted by a multiple of the mass
    matrix as long as it is not positive definite.
    """
    potential = _Potential(model, q, external)
    shift, unit = 0.0, 1e-6 * model.ea / (model.density * model.s[-1] ** 2)
    energy, residual = potential.evaluate(q)
    small = 0
    for _ in range(MAX_ITERATIONS):
        step = potential.newton_step(q, residual, shift)
        found = None if step is None else _line_search(potential, q, step, energy, residual)
        if step is None or found is None:
            shift = max(4.0 * shift, unit)
            continue
        fraction, energy, residual = found
        q = q + fraction * step
        change = _largest(step) if fraction == 1.0 else np.inf
        small = small + 1 if change < 100.0 * TOLERANCE * model.s[-1] and shift == 0.0 else 0
        if small >= 2 or (small and change < TOLERANCE * model.s[-1]):
            return True, q
        shift = 0.25 * shift if shift > unit else 0.0
    return False, q


def _line_search(
    potential: _Potential, q: np.ndarray, step: np.ndarray, energy: float, residual: np.ndarray
) -> tuple[float, float, np.ndarray] | None:
    """Return the part of `step` that lowers the energy enough (Armijo), with energy and residual there, or None.

    Near the solution the gain is lost in the round-off of the energy; there the residual has to fall.
    """
    length = potential.model.s[-1]
    if _largest(step) < 100.0 * TOLERANCE * length:  # the energy cannot tell such steps apart
        return 1.0, *potential.evaluate(q + step)
    fraction = min(1.0, 0.1 * length / max(_largest(step), 1e-300))
    slope = dot(residual, step)
    for _ in range(30):
        trial, there = potential.evaluate(q + fraction * step)
        round_off = 1e-13 * (abs(trial) + abs(energy))
        if trial <= energy + 1e-4 * fraction * slope + round_off or (fraction == 1.0 and _halves(residual, there)):
            return fraction, trial, there
        fraction *= 0.5
    return None


def _halves(residual: np.ndarray, there: np.ndarray) -> bool:
    """Return whether the residual falls to half: near the minimum it says more than the energy, which is round-off."""
    return bool(np.max(np.abs(there)) <= 0.5 * np.max(np.abs(residual)))


def _largest(step: np.ndarray) -> float:
    """Return the largest change of a node's position, m."""
    return float(max(np.max(np.abs(step[k::6])) for k in range(3)))
