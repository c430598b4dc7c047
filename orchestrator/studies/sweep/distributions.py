"""What a sampled parameter may be, and how often."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator
from scipy import stats

from orchestrator.scenario.types import Section

Numbers = list[Annotated[float, Field(allow_inf_nan=False)]]
WORDS = {
    "uniform": ("lowest", "highest"),
    "normal": ("mean", "standard deviation"),
    "lognormal": ("median", "standard deviation of the natural logarithm"),
    "triangular": ("lowest", "most frequent", "highest"),
}
"""Kind → its numbers."""
NEAREST_TO_ONE = 1.0 - 2.0**-53
"""A quantile of 1 may be infinite."""


class Distribution(Section):
    """How a parameter is distributed; one of the four kinds, its numbers in `unit`.

    Attributes
    ----------
    low, high : ``from`` and ``to``: what lies beyond is left out, and the rest takes its place
    """

    model_config = Section.model_config | {"populate_by_name": True}

    uniform: Numbers | None = None
    normal: Numbers | None = None
    lognormal: Numbers | None = None
    triangular: Numbers | None = None
    low: Annotated[float | None, Field(alias="from")] = None
    high: Annotated[float | None, Field(alias="to")] = None
    unit: str = ""

    @property
    def kind(self) -> str:
        """Its name."""
        return self._given()[0]

    def values(self, share: np.ndarray) -> np.ndarray:
        """Return the values (n,) that a `share` (n,) of all does not exceed, in `unit`."""
        law = self._law()
        below, upto = (
            (0.0 if self.low is None else law.cdf(self.low)),
            (1.0 if self.high is None else law.cdf(self.high)),
        )
        inside = np.clip(below + share * (upto - below), np.finfo(float).tiny, NEAREST_TO_ONE)
        return np.asarray(law.ppf(inside), float)

    def _given(self) -> list[str]:
        return [name for name in WORDS if getattr(self, name) is not None]

    def _law(self) -> Any:
        numbers = getattr(self, self.kind)
        match self.kind:
            case "uniform":
                return stats.uniform(numbers[0], numbers[1] - numbers[0])
            case "normal":
                return stats.norm(*numbers)
            case "lognormal":
                return stats.lognorm(numbers[1], scale=numbers[0])
            case _:
                low, mode, high = numbers
                return stats.triang((mode - low) / (high - low), low, high - low)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        given = self._given()
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise ValueError(f"has {found}; give one of {', '.join(WORDS)}, for instance {{ uniform = [0.01, 0.5] }}")
        kind, numbers = given[0], getattr(self, given[0])
        if len(numbers) != len(WORDS[kind]):
            raise ValueError(f"{kind} has {len(numbers)} numbers; write [{', '.join(WORDS[kind])}]")
        self._in_order(kind, numbers)
        self._within(kind)
        return self

    def _in_order(self, kind: str, numbers: list[float]) -> None:
        if kind == "uniform" and not numbers[0] < numbers[1]:
            raise ValueError(f"uniform from {numbers[0]:g} to {numbers[1]:g}: write the lower one first")
        if kind in ("normal", "lognormal") and not numbers[1] > 0.0:
            raise ValueError(
                f"{kind}: the {WORDS[kind][1]} {numbers[1]:g} must be above 0; a value that is fixed goes to [set]"
            )
        if kind == "lognormal" and not numbers[0] > 0.0:
            raise ValueError(f"lognormal: the median {numbers[0]:g} must be above 0")
        if kind == "triangular" and not (numbers[0] <= numbers[1] <= numbers[2] and numbers[0] < numbers[2]):
            raise ValueError(f"triangular {numbers}: write lowest, most frequent, highest in that order")

    def _within(self, kind: str) -> None:
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"from {self.low:g} must lie below to {self.high:g}")
        law = self._law()
        most, least = (
            (1.0 if self.high is None else law.cdf(self.high)),
            (0.0 if self.low is None else law.cdf(self.low)),
        )
        if not most > least:
            raise ValueError(f"{kind} has nothing between its from and its to; move them")


Distributions = Mapping[str, Distribution]
