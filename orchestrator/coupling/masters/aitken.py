"""Fixed-point iteration with Aitken's relaxation."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.accelerator import Accelerator
from orchestrator.coupling.stepping.bounds import Positive
from orchestrator.coupling.stepping.implicit import Implicit


class Aitken(Implicit):
    """Implicit; x ← x + omega_k r_k, omega_k = -omega_{k-1} r_{k-1}·(r_k - r_{k-1}) / |r_k - r_{k-1}|².

    The residuals are scaled by the magnitudes of the unknowns. The first omega of a step is the last one of
    the step before, within [-1, 1].

    Order and stability: those of the exchange. When: one dominant interface direction (a single mass on a
    single spring: then it is the secant method). Reference: Küttler & Wall, Computational Mechanics 43
    (2008) 61-72.

    Parameters
    ----------
    relaxation : the very first omega
    options : those of `Implicit`
    """

    NAME: ClassVar[str] = "aitken"
    TITLE: ClassVar[str] = "implicit, fixed-point iteration, Aitken's relaxation"

    def __init__(self, graph: Graph, *, relaxation: Positive = 0.5, **options: Any):
        super().__init__(graph, Dynamic(relaxation), **options)


class Dynamic(Accelerator):
    """Aitken's relaxation factor."""

    def __init__(self, relaxation: float):
        self.first = self.relaxation = relaxation
        self.last: np.ndarray | None = None

    def reset(self) -> None:
        """Forget the last factor."""
        self.relaxation = self.first

    def reject(self) -> None:
        """Begin anew."""
        self.relaxation = self.first

    def begin(self, H: float, scale: np.ndarray) -> None:
        """Start a step."""
        self.scale, self.last = scale.copy(), None
        self.relaxation = float(np.clip(self.relaxation, -1.0, 1.0)) or self.first

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the next iterate."""
        scaled = r / self.scale
        if self.last is not None:
            change = scaled - self.last
            square = float(change @ change)
            if square > 0.0:
                self.relaxation *= -float(self.last @ change) / square
        self.last = scaled
        return x + self.relaxation * r
