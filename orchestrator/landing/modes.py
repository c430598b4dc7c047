"""Small vibrations of a cable about its static equilibrium: natural frequencies, damping ratios, shapes.

M ü + C u̇ + K u = 0 is assembled by the cable's own kernels. The equilibrium lies in the vertical plane of the supports,
so that motion out of that plane and motion in it do not couple; the two problems are solved apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh

from fmus.cable.assembly import HALF_BANDWIDTH, Model, element_work, interpolate, iteration_matrix
from fmus.cable.module import Cable
from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import InputError
from orchestrator.landing.line_state import parameters_now
from orchestrator.scenario.types import GraphScenario, Scenario

N_POINTS = 201
DENSE = 400
"""Unknowns up to which all modes are calculated; above, only those wanted are, by shift and invert."""


@dataclass(frozen=True)
class Modes:
    """Modes in ascending order.

    Attributes
    ----------
    frequency : (count,) natural frequencies of the undamped cable, Hz
    damping_ratio : (count,) c_i / (2 m_i omega_i) of the material damping
    shape : (count, n) nodal coordinates, of unit modal mass (kg)
    """

    frequency: np.ndarray
    damping_ratio: np.ndarray
    shape: np.ndarray

    def columns(self) -> tuple[tuple[np.ndarray, str], ...]:
        """Return what a table shows of the modes, with formats."""
        return (self.frequency, ".6g"), (self.damping_ratio, ".3g")


@dataclass(frozen=True)
class CableModes:
    """The equilibrium (N_POINTS, 3), and the modes out of the vertical plane and in it."""

    model: Model
    equilibrium: np.ndarray
    out_of_plane: Modes
    in_plane: Modes


def of_scenario(scenario: Scenario, count: int) -> CableModes:
    """Return the first `count` modes of either kind of the scenario's cable, without the robot."""
    if count < 1:
        raise InputError(f"--count {count}: must be 1 or more")
    if isinstance(scenario, GraphScenario):
        raise InputError(f"{scenario.path}: cable: there is none; modes are those of a landing's cable")
    if scenario.cable.fmu is not None:
        raise InputError(f"{scenario.path}: cable.fmu: the modes of a foreign cable are not known; leave `fmu` out")
    cable = Cable()
    try:
        given = scenario.cable.parameters
        cable.table.assign(cable.values, {**given, **parameters_now(scenario, given)})
        cable.initialize(0.0)
    except ModuleError as error:
        raise InputError(f"{scenario.path}: {error}") from None
    return modes(cable, count)


def modes(cable: Cable, count: int) -> CableModes:
    """Return the first `count` modes of either kind about the state of an initialised cable at rest."""
    model = cable.model
    q = cable.state[: model.weight.size].copy()
    mass, damping, stiffness = (banded_matrix(model, q, np.zeros_like(q), *factors) for factors in np.eye(3))
    found = []
    for basis in free_directions(model):
        reduced = [basis.T @ matrix @ basis for matrix in (mass, damping, stiffness)]
        found.append(_lowest(reduced, basis, count))
    return CableModes(model, sample(model, q), *found)


def sample(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the field with nodal values `x` at equally spaced arc lengths: (N_POINTS, 3)."""
    shape, point = np.zeros(8), np.zeros(6)
    rows = np.zeros((N_POINTS, 3))
    for row, s in zip(rows, np.linspace(0.0, model.s[-1], N_POINTS), strict=True):
        interpolate(model, x, s, shape, point)
        row[:] = point[:3]
    return rows


def banded_matrix(model: Model, q: np.ndarray, v: np.ndarray, cm: float, cv: float, cq: float) -> csc_array:
    """Return cm M + cv C + cq K (n, n) at coordinates `q` and velocities `v` (n,), the supports applied."""
    n, width = q.size, 2 * HALF_BANDWIDTH + 1
    band = np.zeros((n, width))
    iteration_matrix(model, q, v, cm, cv, cq, band, np.zeros((13, 12)), element_work())
    row = np.repeat(np.arange(n), width)
    column = row + np.tile(np.arange(width) - HALF_BANDWIDTH, n)
    inside = (column >= 0) & (column < n)
    return csc_array((band.ravel()[inside], (row[inside], column[inside])), shape=(n, n))


def free_directions(model: Model) -> tuple[csc_array, csc_array]:
    """Return orthonormal columns (n, m) of what the supports leave free, out of the vertical plane and in it."""
    n = model.weight.size
    ends = [np.linalg.eigh(p) for p in model.ends]
    slopes = [vectors[:, values > 0.5] for values, vectors in ends]
    out, plane = [], []
    for node in range(n // 6):
        side = {0: 0, n // 6 - 1: 1}.get(node)
        blocks = [(3, slopes[side])] if side is not None else [(0, np.eye(3)), (3, np.eye(3))]
        for offset, directions in blocks:
            for d in directions.T:
                (out if abs(d[0]) > 0.5 else plane).append((6 * node + offset, d))
    return _columns(out, n), _columns(plane, n)


def _columns(directions: list[tuple[int, np.ndarray]], n: int) -> csc_array:
    row = np.concatenate([offset + np.arange(3) for offset, _ in directions])
    column = np.repeat(np.arange(len(directions)), 3)
    return csc_array((np.concatenate([d for _, d in directions]), (row, column)), shape=(n, len(directions)))


def _lowest(matrices: Sequence[csc_array], basis: csc_array, count: int) -> Modes:
    """Return the modes of lowest frequency of mass, damping and stiffness in the coordinates of `basis` (n, m)."""
    mass, damping, stiffness = matrices
    size = len(mass.indptr) - 1
    count = min(count, size)
    if size <= DENSE or count >= size - 1:
        values, vectors = eigh(stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1))
    else:
        values, vectors = eigsh(stiffness, count, mass, sigma=0.0)
    order = np.argsort(values)
    omega, vectors = np.sqrt(np.maximum(values[order], 0.0)), vectors[:, order]
    diagonal = np.einsum("im,im->m", vectors, damping @ vectors)
    ratio = diagonal / (2.0 * np.where(omega > 0.0, omega, np.inf))
    return Modes(omega / (2.0 * np.pi), ratio, (basis @ vectors).T)
