"""Typical magnitudes of the interface unknowns: what a residual is measured by."""

from __future__ import annotations

import numpy as np

from orchestrator.coupling.exchange import force_beside, stems, vectors
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.kernel import kernel
from orchestrator.coupling.stepping.interpolation import Loads


class Scale:
    """Magnitudes of the unknowns, so that N, N.m and N/s can be compared.

    The largest magnitude that a converged step has had, or the present iterate has, of the vector an unknown belongs to
    (x, y, z together). A moment is measured by `lever` times the force at the same place as well: a relative error
    below the tolerance then shifts that force's line of action by less than tolerance times lever, however small the
    moment itself is. A load's slope is measured by what it changes in the load within half a step.

    Iterates that are thrown away leave no trace: one wild guess would loosen the tolerance for the rest of the run.

    Parameters
    ----------
    absolute : magnitude of an unknown, in its unit, that is added
    lever : m

    Attributes
    ----------
    values : (n,) the scale of every unknown, as of the last call
    """

    def __init__(self, graph: Graph, loads: Loads, absolute: float, lever: float = 0.0):
        names = [graph.input_names[i] for i in graph.torn]
        self.vector = vectors(names)
        number = {stem: i for i, stem in enumerate(stems(names))}
        self.force = np.array([number.get(force_beside(stem), i) for stem, i in number.items()], dtype=np.intp)
        where = {int(place): i for i, place in enumerate(graph.torn)}
        self.load = np.arange(len(names))
        for load, rate in loads.fed.tolist():
            if load in where and rate in where:
                self.load[where[rate]] = where[load]
        self.absolute, self.lever = absolute, lever
        self.kept, self.largest = np.zeros(len(number)), np.zeros(len(number))
        self.values = np.ones(len(names))
        self._zero = np.zeros(len(names))

    def reset(self) -> None:
        """Forget all magnitudes."""
        self.kept[:] = 0.0

    def accept(self, x: np.ndarray) -> None:
        """Remember the unknowns `x` (n,) of a step that is kept."""
        np.maximum.at(self.kept, self.vector, np.abs(x))

    def update(self, x: np.ndarray, H: float) -> np.ndarray:
        """Return the scale of every unknown, (n,), with `x` (n,) taken into account."""
        self.norm(self._zero, x, H)
        return self.values

    def norm(self, r: np.ndarray, x: np.ndarray, H: float) -> float:
        """Return the largest of the residuals `r` (n,) of the iterate `x` (n,), relative to the scale of x + r."""
        return relative_residual(
            r, x, H, self.vector, self.force, self.load, self.kept, self.absolute, self.lever, self.largest, self.values
        )


@kernel
def relative_residual(r, x, H, vector, force, load, kept, absolute, lever, largest, values):
    """Write the scales to `values` (n,); return max |r| / values, infinite where that is no number.

    Parameters
    ----------
    vector, load : (n,) int, number of the vector of an unknown; place of the load it is the slope of, or its own
    force : (m,) int, number of the force that belongs to a vector, or its own
    kept, largest : (m,) magnitudes so far, and with x + r
    """
    for i in range(kept.size):
        largest[i] = kept[i]
    for i in range(x.size):
        largest[vector[i]] = max(largest[vector[i]], abs(x[i] + r[i]))
    worst = 0.0
    for i in range(x.size):
        j = vector[load[i]]
        values[i] = max(largest[j], lever * largest[force[j]] if force[j] != j else 0.0) + absolute
        if load[i] != i:
            values[i] *= 2.0 / H
        ratio = abs(r[i]) / values[i]
        if not ratio <= worst:
            worst = ratio if ratio == ratio else np.inf
    return worst
