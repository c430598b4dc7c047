"""Fixed-point iteration with constant relaxation."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.accelerator import Accelerator
from orchestrator.coupling.stepping.bounds import Positive
from orchestrator.coupling.stepping.implicit import Implicit


class FixedPoint(Implicit):
    """Implicit; x ← x + omega (S(x) - x), Gauss–Seidel iterated.

    Order: that of the exchange. Stability: that of the exchange where the iteration converges, that is for
    omega < 2/(1 + g) with -g the largest negative gain of the loop (stiffness times compliance over a step,
    g ~ k H²/m); else the step is sub-divided until it does. When: soft coupling; as a yardstick. Reference:
    Kübler & Schiehlen, Multibody System Dynamics 4 (2000) 107-127; Küttler & Wall, Computational Mechanics
    43 (2008) 61-72.

    Parameters
    ----------
    relaxation : omega
    options : those of `Implicit`
    """

    NAME: ClassVar[str] = "fixed_point"
    TITLE: ClassVar[str] = "implicit, fixed-point iteration, constant relaxation"

    def __init__(self, graph: Graph, *, relaxation: Positive = 0.7, **options: Any):
        super().__init__(graph, Constant(relaxation), **options)


class Constant(Accelerator):
    """Constant relaxation."""

    def __init__(self, relaxation: float):
        self.relaxation = relaxation

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the next iterate."""
        return x + self.relaxation * r
