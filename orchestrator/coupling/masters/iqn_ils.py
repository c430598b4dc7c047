"""IQN-ILS: interface quasi-Newton with an inverse Jacobian from least squares."""

from __future__ import annotations

from typing import Any, ClassVar

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.bounds import Count, NonNegative, Positive
from orchestrator.coupling.stepping.implicit import Implicit
from orchestrator.coupling.stepping.least_squares import LeastSquares


class IqnIls(Implicit):
    """Implicit; the inverse interface Jacobian is built by least squares from the iterations, also of
    earlier steps.

    With the differences of residual and result to the iteration before, V = [Δr …], W = [ΔS …], newest first,
    x ← S(x) + W c, c = argmin |V c + r|, solved by QR; a column that adds less than `threshold` of its norm
    to the newer ones is dropped.

    Order: that of the exchange (2 with values held at the mean of both ends, 4 with `waveform`). Stability:
    that of the exchange. When: stiff interfaces between FMUs that can be rolled back, however many unknowns.
    Reference: Degroote, Bathe & Vierendeels, Computers & Structures 87 (2009) 793-801; filtering: Haelterman
    et al., Computers & Structures 171 (2016) 9-17.

    Parameters
    ----------
    reuse : macro steps whose columns are kept
    threshold : relative size of what a column must add
    relaxation : of the first iterations, as long as no column is known
    options : those of `Implicit`
    """

    TITLE: ClassVar[str] = "implicit, interface quasi-Newton (least squares), columns reused"
    NAME: ClassVar[str] = "iqn_ils"

    def __init__(
        self,
        graph: Graph,
        *,
        reuse: Count = 8,
        threshold: NonNegative = 1e-6,
        relaxation: Positive = 0.1,
        **options: Any,
    ):
        super().__init__(graph, LeastSquares(graph.torn.size, reuse, threshold, relaxation), **options)
