"""Static equilibrium under gravity, and the catenary that Newton's method starts from."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fmus import banded
from fmus.cable.assembly import (
    HALF_BANDWIDTH,
    Model,
    constrain_vector,
    dot,
    element_work,
    internal_force,
    iteration_matrix,
)
from fmus.cable.mesh import nodes
from fmus.variables import ModuleError

MAX_ITERATIONS = 300
TOLERANCE = 1e-13
"""Largest change of a coordinate, relative to the length of the cable, that ends the iteration."""


def mesh_model(
    *,
    span: float,
    level_difference: float,
    unstretched_length: float,
    n_elements: int,
    grading: float,
    grading_position: float,
    ea: float,
    ei: float,
    damping: float,
    density: float,
    gravity: float,
    clamped: bool,
) -> Model:
    """Return the meshed cable; the left support is the origin, the right one (0, span, level_difference)."""
    s = nodes(unstretched_length, n_elements, grading, grading_position)
    weight = np.zeros(6 * s.size)
    l = np.diff(s)
    for offset, share in ((2, l / 2), (5, l**2 / 12), (8, l / 2), (11, -(l**2) / 12)):
        np.add.at(weight, 6 * np.arange(n_elements) + offset, -density * gravity * share)
    chord = np.array([0.0, span, level_difference]) / np.hypot(span, level_difference)
    free = np.outer(chord, chord) if clamped else np.eye(3)
    return Model(s, ea, ei, damping, density, gravity, weight, np.stack([free, free]))


def catenary(model: Model, span: float, level_difference: float) -> np.ndarray:
    """Return nodal coordinates (n,) on the elastic catenary between the supports: no bending stiffness.

    Irvine, Cable Structures, 1981, section 1.3: with the horizontal tension H and the vertical tension V at the left end,
    y(s) = H s/EA + H/w (asinh(V/H) - asinh((V - w s)/H)), and likewise z(s). Strains here are engineering strains.
    A weightless or taut cable tends to the straight line, on which the unknown V is found for a given H.
    """
    length, w = model.s[-1], model.density * model.gravity
    chord = np.hypot(span, level_difference)
    taut = model.ea * max(chord / length - 1.0, 0.0)
    if w * length < 1e-9 * max(taut, 1e-300) or w == 0.0:
        return _on_line(model, span, level_difference)

    def ends(h: float) -> tuple[float, float]:
        v = brentq(
            lambda v: _drop(h, v, w, length, model.ea) - level_difference,
            -1e3 * w * length - 1e3 * h,
            1e3 * w * length + 1e3 * h,
        )
        return v, _reach(h, v, w, length, model.ea) - span

    low, high = 1e-6 * w * length, 10.0 * (taut + w * length)
    while ends(high)[1] < 0.0:
        high *= 10.0
    while ends(low)[1] > 0.0 and low > 1e-14 * w * length:
        low *= 0.1
    if ends(low)[1] > 0.0:
        return _on_line(model, span, level_difference)
    h = brentq(lambda h: ends(h)[1], low, high, rtol=1e-14)
    v = ends(h)[0]
    q = np.zeros(6 * model.s.size)
    tension = np.hypot(h, w * model.s - v)
    stretch = 1.0 + tension / model.ea
    q[1::6] = [_reach(h, v, w, s, model.ea) for s in model.s]
    q[2::6] = [_drop(h, v, w, s, model.ea) for s in model.s]
    q[4::6] = stretch * h / tension
    q[5::6] = stretch * (w * model.s - v) / tension
    return q


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

    The potential energy is minimised by Newton's method from the catenary: each step is shortened until the energy falls, and
    the matrix is shifted by a multiple of the mass matrix as long as it is not positive definite. Should that fail (a slack
    cable in clamps, whose bending layer is shorter than an element), the bending stiffness is lowered to its value in steps.

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
        for ei in _bending_stiffnesses(model, stiffer):
            converged, q = _minimise(model._replace(ei=ei), q, external)
        if converged:
            return q
    raise ModuleError(f"cable: no static equilibrium was found; {_cure(model)}")


def _cure(model: Model) -> str:
    """Return what to do about a missing equilibrium.

    In clamps, elements much longer than the bending layer √(EI/T) cannot follow it: a slack cable then buckles there, on paper
    only, and the equilibrium in the vertical plane is not a minimum of the energy.
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
    """Return `n` falling bending stiffnesses that end with the model's; the first makes a layer of an element's length."""
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


def _minimise(model: Model, q: np.ndarray, external: np.ndarray) -> tuple[bool, np.ndarray]:
    """Minimise the potential energy from `q`; return whether the last steps were below the tolerance, and the result."""
    n = q.size
    zero, force, axial = np.zeros(n), np.zeros(n), np.zeros(model.s.size - 1)
    band, matrix, work = np.zeros((n, 2 * HALF_BANDWIDTH + 1)), np.zeros((13, 12)), element_work()

    def potential(x: np.ndarray) -> tuple[float, np.ndarray]:
        energy = internal_force(model, x, zero, force, axial, work)[0]
        residual = force - external
        constrain_vector(model, residual)
        return energy - dot(external, x - q0), residual

    q0 = q.copy()
    shift = 0.0
    unit = 1e-6 * model.ea / (model.density * model.s[-1] ** 2)
    energy, residual = potential(q)
    small = 0
    for _ in range(MAX_ITERATIONS):
        iteration_matrix(model, q, zero, shift, 0.0, 1.0, band, matrix, work)
        step = -residual
        failed = banded.factorise(band) or np.any(band[:, HALF_BANDWIDTH] <= 0.0)
        if not failed:
            banded.solve(band, step)
            failed = not np.all(np.isfinite(step))
        if failed:
            shift = max(4.0 * shift, unit)
            continue
        change = max(np.max(np.abs(step[k::6])) for k in range(3))
        accepted, fraction = False, min(1.0, 0.1 * model.s[-1] / max(change, 1e-300))
        slope = dot(residual, step)
        for _ in range(30):
            trial_energy, trial_residual = potential(q + fraction * step)
            round_off = 1e-13 * (abs(trial_energy) + abs(energy))
            if trial_energy <= energy + 1e-4 * fraction * slope + round_off:
                accepted = True
                break
            fraction *= 0.5
        if not accepted:
            shift = max(4.0 * shift, unit)
            continue
        q, energy, residual = q + fraction * step, trial_energy, trial_residual
        shift = 0.25 * shift if shift > unit else 0.0
        small = small + 1 if change * fraction < TOLERANCE * model.s[-1] * 100 and shift == 0.0 else 0
        if small >= 2 or (shift == 0.0 and change < TOLERANCE * model.s[-1]):
            return True, q
    return False, q
