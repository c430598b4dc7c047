"""Does the cable's mesh resolve the landing?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from fmus.cable.mesh import SHORTEST
from fmus.cable.module import Cable

RESOLVED = 1.5
"""Longest element under a wheel, in bending layers, that resolves what the wheel does (docs/notebook/mesh.md)."""


@dataclass(frozen=True)
class Mesh:
    """The mesh of our cable, and what it has to resolve.

    Attributes
    ----------
    nodes : (n_elements + 1,) arc lengths, m
    layer : length of the bending layer under the robot's weight, m
    wheels : arc lengths at which wheels land, m
    """

    nodes: np.ndarray
    layer: float
    wheels: tuple[float, ...]

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.nodes.size - 1

    @property
    def allowed(self) -> float:
        """Length (m) of the longest element under a wheel that resolves what it does."""
        return RESOLVED * max(self.layer, SHORTEST)

    @property
    def is_coarse(self) -> bool:
        """Whether an element under a wheel is too long where it lands."""
        return bool(np.any(self.size_at(np.array(self.wheels)) > self.allowed))

    def size_at(self, s: np.ndarray) -> np.ndarray:
        """Return the length (m) of the elements at arc lengths `s`."""
        element = np.clip(np.searchsorted(self.nodes, s) - 1, 0, self.n_elements - 1)
        return np.diff(self.nodes)[element]

    def content(self) -> dict[str, float]:
        """Return what ``summary.json`` says of it."""
        size = np.diff(self.nodes)
        lengths = {"shortest_m": size.min(), "longest_m": size.max(), "bending_layer_m": self.layer}
        return {"n_elements": self.n_elements} | {name: float(value) for name, value in lengths.items()}

    def notes(self, tracks: Iterable[np.ndarray]) -> Iterator[str]:
        """Yield a line for each wheel whose place is not resolved, at its landing or along its track (n,) of arc lengths, m."""
        for k, (landed, track) in enumerate(zip(self.wheels, tracks, strict=False), start=1):
            if self.size_at(np.array([landed]))[0] > self.allowed:
                yield f"wheel {k} lands on {self._words(landed)}: {CURE_LANDING}"
                continue
            worst = float(track[np.argmax(self.size_at(track))])
            if self.size_at(np.array([worst]))[0] > self.allowed:
                yield f"wheel {k} leaves the fine part of the mesh, for {self._words(worst)}: {CURE_TRACK}"

    def _words(self, s: float) -> str:
        size = float(self.size_at(np.array([s]))[0])
        return f"an element of {size:.2g} m at arc length {s:.4g} m, where the bending layer is {self.layer:.2g} m long"


CURE_LANDING = "leave out n_elements, grading and grading_position, and the mesh is found by itself"
CURE_TRACK = "give equal elements that are short enough (n_elements), or brake the robot"


def mesh_of(cable: Cable, load: float, at: float, wheels: Iterable[float]) -> Mesh:
    """Return the mesh of an initialised cable that carries `load` (N) at the distance `at` (m), at arc lengths `wheels`."""
    return Mesh(cable.model.s, cable.line.layer(load, at), tuple(wheels))
