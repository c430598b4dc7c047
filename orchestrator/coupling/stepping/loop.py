"""What error control needs of a coupling loop, so that neither knows the other's file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.scale import Scale


class Loop(Protocol):
    """A master whose steps can be made, tried and taken back.

    Attributes
    ----------
    scale, tolerance : magnitudes of the unknowns; largest relative residual of a converged step
    x : (n,) unknowns of the last step that was made
    """

    graph: Graph
    scale: Scale
    tolerance: float
    x: np.ndarray

    def attempt(self, t: float, H: float, report: StepReport, *, last: bool) -> bool:
        """Make one step; return whether it was made. Otherwise all is as before; the `last` resort is always made."""
        ...

    def trial(
        self, t: float, H: float, x: np.ndarray, tolerance: float, enough: Callable[[], bool], report: StepReport
    ) -> bool:
        """Make one step from the unknowns `x` (n,) on, for its outputs alone, until it converges to `tolerance` or they are
        `enough`; return whether it did. The caller takes all back."""
        ...

    def snapshot(self) -> tuple[Any, ...]:
        """Return all that a step changes, the states of the components first (to be released)."""
        ...

    def revert(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        ...
