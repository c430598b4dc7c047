"""Anderson acceleration of the fixed-point iteration."""

from __future__ import annotations

from typing import Any, ClassVar

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.bounds import Count, NonNegative, Positive
from orchestrator.coupling.stepping.implicit import Implicit
from orchestrator.coupling.stepping.least_squares import LeastSquares


class Anderson(Implicit):
    """Implicit; x ← x + beta r + (ΔX + beta ΔR) c, c = argmin |ΔR c + r| over the last iterations of the
    same step.

    With beta = 1 and columns of earlier steps it would be IQN-ILS.

    Order and stability: those of the exchange. When: the coupling changes so much between macro steps that
    old columns mislead. Reference: Anderson, J. ACM 12 (1965) 547-560; Walker & Ni, SIAM J. Numer. Anal. 49
    (2011) 1715-1735.

    Parameters
    ----------
    mixing : beta
    depth : iterations looked back to
    threshold : relative size of what a column must add
    options : those of `Implicit`
    """

    NAME: ClassVar[str] = "anderson"
    TITLE: ClassVar[str] = "implicit, Anderson acceleration within a macro step"

    def __init__(
        self,
        graph: Graph,
        *,
        mixing: Positive = 0.5,
        depth: Count = 12,
        threshold: NonNegative = 1e-6,
        **options: Any,
    ):
        model = LeastSquares(graph.torn.size, 0, threshold, mixing, mixing=mixing, depth=depth)
        super().__init__(graph, model, **options)
