"""Which of two beginnings of an iteration has been nearer to what was found: that of models, or that of the polynomial.

Hard impacts and long steps are the polynomial's; wherever a free response is smooth, the models are far ahead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FORGET = 0.8  # weight of the past, as in the record of the polynomial's orders
PROBE = 8  # steps after which the models are asked again where they had lost; twice as many each time they lose again
NEARER = 0.5  # of the polynomial's distance: an iteration ends sooner where its beginning is much nearer, not a little
PAYS = 8.0  # what costs solves is done where it may save so many times as many


@dataclass
class Record:
    """Of steps of one length.

    Attributes
    ----------
    model, polynomial : distances of the guesses to what was found, the past fading
    steps, iterations : steps made, and how many iterations they need, the past fading
    pause, asked : steps until the models are asked again, and the step when they were
    """

    model: float = np.inf
    polynomial: float = 0.0
    steps: int = 0
    iterations: float = 1.0
    pause: int = PROBE
    asked: int = 0

    @property
    def models_win(self) -> bool:
        """Whether the models were nearer lately."""
        return self.model < NEARER * self.polynomial

    @property
    def asks(self) -> bool:
        """Whether the models shall be asked in the next step."""
        return self.models_win or np.isinf(self.model) or self.steps >= self.asked + self.pause

    def note(self, polynomial: float, model: float | None, iterations: int) -> None:
        """Remember the distances in a step that converged; None where the models were not asked."""
        self.steps += 1
        self.iterations = FORGET * self.iterations + (1.0 - FORGET) * iterations
        if model is not None:
            self.asked, self.pause = self.steps, PROBE if self.models_win else 2 * self.pause
            past = 0.0 if np.isinf(self.model) else FORGET
            self.model = (past * self.model if past else 0.0) + (1.0 - past) * model
            self.polynomial = past * self.polynomial + (1.0 - past) * polynomial

    def pays(self, cost: float, remaining: float) -> bool:
        """Return whether `cost` solves are worth while: as many could have been saved so far, and many times as many will be.

        `remaining` : steps to the end of the run; nan where nobody knows
        """
        saved = self.iterations - 1.0
        return self.models_win and self.steps * saved >= cost and not remaining * saved < PAYS * cost
