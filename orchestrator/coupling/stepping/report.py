"""What a master says of each macro step."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan


@dataclass(slots=True)
class StepReport:
    """One macro step.

    Attributes
    ----------
    time : s, its end
    iterations : times the components were stepped over it (sub-steps all counted)
    residual : largest relative interface residual it was left with
    subdivisions : sub-steps beyond the first
    rejected : sub-steps rolled back, because they did not converge or their error was too large
    columns : least-squares columns kept, 0 where there are none
    by_model : whether the iteration began from the models' free responses (of sub-steps, the last)
    converged : False if any part of it did not reach the tolerance
    estimate : a-posteriori error estimate, nan where none is made
    energy_made : J, what all booked interfaces have made of it together, nan where none is booked
    power_residual : W, largest difference of the powers on both sides of an interface, nan where none is booked
    """

    time: float
    iterations: int = 1
    residual: float = 0.0
    subdivisions: int = 0
    rejected: int = 0
    columns: int = 0
    by_model: bool = False
    converged: bool = True
    estimate: float = nan
    energy_made: float = nan
    power_residual: float = nan
