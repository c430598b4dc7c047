"""Types of options that have bounds, for the signatures of the masters."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt

Positive = Annotated[float, Gt(0.0)]
NonNegative = Annotated[float, Ge(0.0)]
PositiveCount = Annotated[int, Gt(0)]
Count = Annotated[int, Ge(0)]
