"""The flat state of the cable and the workspace of a step.

The state holds q (n), v (n), two rows of accelerations (2 n) and a few sums (`N_SUMS`). The iteration matrix is kept
in the workspace, beside the state, with what it was made from.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable.assembly import HALF_BANDWIDTH, ElementWork, Model, element_work, iteration_matrix
from fmus.kernels import banded

N_PORTS = 4
N_LOSSES = 3
"""Kinds of damping whose energy is booked apart: of the material, in proportion to mass, of the air."""
DISSIPATED, LAST_INNER, LAST_MACRO, WORK = 0, N_LOSSES, N_LOSSES + 1, N_LOSSES + 2
"""Places behind the coordinates in the state: energy dissipated, by kind; the work done through each port stands last."""
N_SUMS = WORK + N_PORTS
OK, NOT_CONVERGED, NOT_FINITE, OFF_CABLE = range(4)
"""Status of a step."""


class Work(NamedTuple):
    """Workspace and cached factorisations of a cable of n coordinates."""

    element: ElementWork
    shape: np.ndarray
    section: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    residual: np.ndarray
    external: np.ndarray
    increment: np.ndarray
    band: np.ndarray
    late_band: np.ndarray
    late: np.ndarray
    matrix: np.ndarray
    mode: np.ndarray
    real_band: np.ndarray
    real_matrix: np.ndarray
    mass_band: np.ndarray
    key: np.ndarray
    load: np.ndarray
    point: np.ndarray
    start: np.ndarray
    trial: np.ndarray
    first: np.ndarray
    power: np.ndarray
    means: np.ndarray


def make_work(n: int, state_size: int) -> Work:
    """Return new workspace for n coordinates; generalized-alpha wants `factorise_mass` too."""
    width = 2 * HALF_BANDWIDTH + 1
    return Work(
        element=element_work(),
        shape=np.zeros(8),
        section=np.zeros((n // 6 + 1, 3)),
        q=np.zeros((2, n)),
        v=np.zeros((2, n)),
        a=np.zeros((2, n)),
        residual=np.zeros((2, n)),
        external=np.zeros(n),
        increment=np.zeros(n),
        band=np.zeros((n, width), dtype=np.complex128),
        late_band=np.zeros((n, width), dtype=np.complex128),
        late=np.zeros(1, dtype=np.bool_),
        matrix=np.zeros((13, 12), dtype=np.complex128),
        mode=np.zeros(n, dtype=np.complex128),
        real_band=np.zeros((n, width)),
        real_matrix=np.zeros((13, 12)),
        mass_band=np.zeros((n, width)),
        key=np.full(2 * n + 2, np.nan),
        load=np.zeros((2, 3)),
        point=np.zeros((2, 6)),
        start=np.zeros((N_PORTS, 12)),
        trial=np.zeros(state_size),
        first=np.zeros((N_PORTS, 6)),
        power=np.zeros((2, N_LOSSES)),
        means=np.zeros((N_PORTS, 12)),
    )


def factorise_mass(model: Model, q: np.ndarray, work: Work) -> None:
    """Put the factors of the mass matrix into the workspace."""
    iteration_matrix(model, q, np.zeros_like(q), 1.0, 0.0, 0.0, work.mass_band, work.real_matrix, work.element)
    banded.factorise(work.mass_band)


def state_size(n: int) -> int:
    """Return the length of the flat state of a cable of n coordinates."""
    return 4 * n + N_SUMS
