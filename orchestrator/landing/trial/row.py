"""One finding of a trial, and how numbers are held against each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

Verdict = Literal["pass", "FAIL", "not testable"]
ACCURACY = 1e-3
"""What a landing asks of its motion, as a share of its range: a component may not be off by more."""
SAFETY = 2.0
"""Of an error estimate from two step sizes; of order 1 at least, so that the finer one's error is their difference."""
LARGEST = 0.1
"""An estimate beyond this share of what is measured excuses nothing."""
ROUND_OFF = 1e-12
"""Share of a number's own size that it may be off: some thousand units in the last place."""


@dataclass(frozen=True)
class Row:
    """One finding.

    Attributes
    ----------
    name : what was looked at
    expected, source : what should come out, and where that comes from
    found : what came out
    why : of a failure, what it points to; of what cannot be tested, the reason
    """

    name: str
    expected: str
    source: str
    found: str
    verdict: Verdict
    why: str = ""

    def content(self) -> dict[str, Any]:
        """Return the finding as it is written to a file."""
        return asdict(self)


def judged(name: str, expected: str, source: str, found: str, good: bool, why: str = "") -> Row:
    """Return a row that passes if `good`; `why` is kept where it fails."""
    return Row(name, expected, source, found, "pass" if good else "FAIL", "" if good else why)


def untestable(name: str, why: str, expected: str = "") -> Row:
    """Return a row that says why there is no verdict."""
    return Row(name, expected, "", "", "not testable", why)


@dataclass(frozen=True)
class Deviation:
    """What came out, held against what was expected.

    Attributes
    ----------
    size : largest deviation
    scale : of what is measured
    allowed : `ACCURACY` of the scale, and the error that the measurement itself may have
    """

    size: float
    scale: float
    allowed: float

    @property
    def good(self) -> bool:
        """Whether the deviation is within what is allowed."""
        return self.size <= self.allowed

    @property
    def share(self) -> float:
        """The deviation as a share of the scale."""
        return self.size / self.scale if self.scale > 0.0 else float(self.size > 0.0)

    def words(self) -> str:
        """Return the deviation for people."""
        return f"off by {self.share:.1e} of it, allowed {self.allowed / self.scale if self.scale else 0.0:.1e}"


def deviation(
    found: np.ndarray, expected: np.ndarray, estimate: float = 0.0, *, scale: float | None = None, at: float = 0.0
) -> Deviation:
    """Hold `found` against `expected`, arrays of one shape.

    Parameters
    ----------
    estimate : error of what is measured, from two step sizes
    scale : of what is measured; the largest number expected if none is given
    at : size of the numbers that were subtracted to get there, for their round-off
    """
    size = float(np.max(np.abs(found - expected), initial=0.0))
    scale = float(np.max(np.abs(expected), initial=0.0)) if scale is None else scale
    allowed = ACCURACY * scale + min(SAFETY * estimate, LARGEST * scale) + ROUND_OFF * max(at, scale)
    return Deviation(size, scale, allowed)


def vector(values: Sequence[float] | np.ndarray) -> str:
    """Return a vector for people, three digits each; what is below its round-off is 0."""
    numbers = np.asarray(values, dtype=float)
    small = 1e-9 * np.max(np.abs(numbers), initial=0.0)
    return "(" + ", ".join(f"{0.0 if abs(v) <= small else v:.3g}" for v in numbers) + ")"
