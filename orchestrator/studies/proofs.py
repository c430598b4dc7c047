"""Why no model can meet a claim: checks by name, each in numbers of the paper and of our runs.

A check that fails leaves the claim to be judged like any other, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.studies.book import Book
    from orchestrator.studies.documents import Claim

ZERO = 1e-6
"""What a symmetric model gives in place of exactly 0, in degrees: round-off of the solver."""
CLEARLY = 1.1
"""How many times a bound is passed before it counts: beyond what digits and numerical errors may do."""


@dataclass(frozen=True)
class Proof:
    """Whether a check holds, and its numbers in words."""

    holds: bool
    words: str


def symmetry(book: Book, claim: Claim) -> Proof:
    """The signal is exactly 0 in every run: by mirror symmetry nothing turns the robot that way."""
    of_angle = claim.model_copy(update={"unit": "deg"})
    values = [v for name in book.sets for v in book.measured(of_angle, name, "largest") or []]
    worst = max(values, default=math.inf)
    return Proof(worst <= ZERO, f"the largest of all our runs is {worst:.1g}°")


def overshoot(book: Book, claim: Claim) -> Proof:
    """F12: a load that is let go at rest overshoots about twice its final displacement at most; ours by the runs."""
    start, peak, end = (_paper(book, name) for name in ("F12-z0", "F12-zpeak", "F12-zend"))
    claimed = (peak - start) / (end - start)
    ours = max((v for name in book.sets for v in book.measured(claim, name, "overshoot") or []), default=math.inf)
    words = f"the paper's peak is {claimed:.1f} times its final displacement; ours is {ours:.2f} times at most"
    return Proof(claimed > CLEARLY * max(2.0, ours), words)


def deeper_at_rest(book: Book, claim: Claim) -> Proof:
    """F15: the largest depth cannot be less than that at which the robot starts, by F12 at the same point."""
    start = _paper(book, "F12-z0")
    above = [value for value in claim.values if value > start]
    return Proof(bool(above), f"F12 starts at {start:g} m at this point, below {', '.join(f'{v:g}' for v in above)} m")


def heavier_sinks_deeper(book: Book, claim: Claim) -> Proof:
    """F20: 100 kg at midspan cannot sink less than 38 kg do by F19; in ours the depth grows with the mass in every set."""
    lighter, heavier = min(_papers(book, "F19-z")), min(claim.values)
    falls = [book.measured(claim, name) for name in book.sets]
    grows = all(later < earlier for fall in falls if fall for earlier, later in pairwise(fall))
    words = f"38 kg sink {-lighter:g} m by F19, 100 kg {-heavier:g} m here; in ours the depth grows with the mass in each set"
    return Proof(grows and any(falls) and heavier > lighter, words)


def fixed_support(book: Book, claim: Claim) -> Proof:
    """F19: point 11, at 10 m a point from midspan, is the tower, where the line does not move."""
    position = 100.0 + 10.0 * (11 - 1)
    return Proof(position >= 200.0, f"point 11 is at {position:g} m of the 200 m span: the support itself")


def sudden_load(book: Book, claim: Claim) -> Proof:
    """F18: a robot that is let go presses with more than the measured peak; on a linear spring with twice its weight."""
    ours = min((v for name in book.sets for v in book.measured(claim, name) or []), default=0.0)
    words = f"let go, ours peaks at {ours:.0f} N at least, twice the weight is 745 N"
    return Proof(ours > CLEARLY * max(claim.values), words)


def slope_needs_sag(book: Book, claim: Claim) -> Proof:
    """F4: by its quadratic an end slope needs a sag, which an unstretched length equal to the span does not give."""
    needed = 200.0 * math.tan(math.radians(max(claim.values))) / 4.0
    slopes = [v for name in book.sets for v in book.measured(claim, name) or []]
    sag = 200.0 * math.tan(math.radians(max(slopes, default=90.0))) / 4.0
    words = (
        f"a parabola with that slope sags {needed:.2f} m; 200 m of line over 200 m sag {sag:.2f} m at most in our sets"
    )
    return Proof(needed > CLEARLY * sag, words)


def solid_section(book: Book, claim: Claim) -> Proof:
    """T1: the printed linear density is that of a solid rod of the printed diameter, so its stiffness is, too."""
    density = 3595.0 * math.pi * 0.018**2 / 4.0
    ours = [v for values in book.ours(claim).values() for v in values]
    ratio = claim.values[0] / ours[0]
    words = f"3595 kg/m³ over π d²/4 is {density:.3f} kg/m, as printed; the stiffness printed is {ratio:.1f} times that rod's"
    return Proof(abs(density / 0.91 - 1.0) < 0.01 and ratio > CLEARLY, words)


PROOFS: dict[str, Callable[[Book, Claim], Proof]] = {
    function.__name__: function
    for function in (
        symmetry, overshoot, deeper_at_rest, heavier_sinks_deeper, fixed_support, sudden_load, slope_needs_sag,
        solid_section,
    )
}  # fmt: skip
"""The checks by name."""


def _papers(book: Book, name: str) -> list[float]:
    return next(claim.values for claim in book.documents.claims.claim if claim.id == name)


def _paper(book: Book, name: str) -> float:
    return _papers(book, name)[0]
