"""Which of two beginnings of an iteration leaves the smaller residual: that of models, or that of the polynomial.

Hard impacts and long steps are the polynomial's; wherever a free response is smooth, the models are far ahead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FORGET = 0.8  # weight of the past, as in the record of the polynomial's orders
PROBE = 8  # steps after which the models are tried again where they had lost; twice as many each time they lose again
WORTH = 0.5  # digits by which the models must be better: an iteration ends no sooner for less
PAYS = 8.0  # what costs solves is done where it may save so many times as many
LEAST, LARGEST = 1e-15, 1e3  # residuals between which digits count


@dataclass
class Record:
    """Of steps of one length.

    Attributes
    ----------
    model, polynomial : digits of the residuals that iterations began with, the past fading; nan: not tried yet
    steps, iterations : steps made, and how many iterations they need, the past fading
    pause : steps until the models are tried again
    tried, left : the last steps that began from the models, and from the polynomial
    """

    model: float = np.nan
    polynomial: float = np.nan
    steps: int = 0
    iterations: float = 1.0
    pause: int = PROBE
    tried: int = 0
    left: int = 0

    @property
    def models_win(self) -> bool:
        """Whether the models were better lately."""
        return self.model < self.polynomial - WORTH

    @property
    def asks_models(self) -> bool:
        """Whether the next step shall begin from the models."""
        return np.isnan(self.model) or self.models_win or self.steps >= self.tried + self.pause

    def note(self, *, by_model: bool, residual: float, iterations: int) -> None:
        """Remember the residual that a step began with, and the iterations it took."""
        self.steps += 1
        self.iterations = FORGET * self.iterations + (1.0 - FORGET) * iterations
        if residual <= LEAST:  # in the air there is nothing to foretell: good for both, and soon no longer true
            return
        digits = float(np.log10(np.clip(residual, LEAST, LARGEST)))
        if not by_model:
            self.polynomial, self.left = _faded(self.polynomial, digits, self.steps - self.left), self.steps
            return
        self.model = _faded(self.model, digits, self.steps - self.tried)
        self.tried, self.pause = self.steps, PROBE if self.models_win else 2 * self.pause

    def pays(self, cost: float, remaining: float) -> bool:
        """Return whether `cost` solves are worth while: as many could have been saved so far, and many times as many will be.

        `remaining` : steps to the end of the run; nan where nobody knows
        """
        saved = self.iterations - 1.0
        return self.models_win and self.steps * saved >= cost and not remaining * saved < PAYS * cost


def _faded(past: float, value: float, age: int) -> float:
    """Return the mean of a `value` and of the `past`, that is so many steps old."""
    weight = 0.0 if np.isnan(past) else FORGET**age
    return value + weight * (past - value) if weight else value
