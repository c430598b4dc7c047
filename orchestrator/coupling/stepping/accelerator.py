"""How the unknowns are corrected from one iteration to the next: what each implicit master has of its own."""

from __future__ import annotations

import numpy as np


class Accelerator:
    """How the next iterate follows from the present one.

    Attributes
    ----------
    columns : least-squares columns used, 0 where there are none
    """

    columns = 0

    def begin(self, H: float, scale: np.ndarray) -> None:
        """Start the iteration of a step of length `H` (s); `scale` (n,) are the magnitudes of the unknowns."""

    def propose(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the next iterate from the present one and its residual, (n,) each."""
        raise NotImplementedError

    def accept(self) -> None:
        """The step has converged: keep what helps the next one."""

    def reject(self) -> None:
        """The step has not converged: forget what it brought."""

    def reset(self) -> None:
        """Forget everything."""
