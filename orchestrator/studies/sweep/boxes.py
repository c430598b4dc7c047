"""Boxes between the places of a sweep: which are divided to find an outline, and which part of a map a place stands for.

Places lie on a grid at first. A box of the grid is divided in the middle where its places differ, its parts likewise, until it
is as narrow as wanted. Places of one box may lie on an edge of its neighbour: they count there, too.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

Place = tuple[float, ...]
"""Values on the axes that have numbers."""
Side = tuple[float, float]
Edges = list[Side]
"""From where to where along each axis."""
ROUNDING = 1e-9
"""Of a width; a box that is wider by less is not divided."""


@dataclass(frozen=True)
class Box:
    """What lies between `low` and `high`."""

    low: Place
    high: Place

    @property
    def corners(self) -> list[Place]:
        """Its corners."""
        return list(product(*zip(self.low, self.high, strict=True)))

    def parts(self, widths: Sequence[float]) -> list[Box]:
        """Return the parts that it is divided into: in the middle of each axis along which it is wider than wanted."""
        cuts = [
            [(a, b)] if b - a <= width * (1.0 + ROUNDING) else [(a, middle(a, b)), (middle(a, b), b)]
            for a, b, width in zip(self.low, self.high, widths, strict=True)
        ]
        return [Box(*map(tuple, zip(*chosen, strict=True))) for chosen in product(*cuts)]


def middle(low: float, high: float) -> float:
    """Return the value between; digits that only rounding has made are left out."""
    return float(f"{0.5 * (low + high):.12g}")


def boxes(axes: Sequence[Sequence[float]]) -> list[Box]:
    """Return the boxes of the grid of `axes`, each of two values at least."""
    sides = [list(pairwise(sorted(axis))) for axis in axes]
    return [Box(*map(tuple, zip(*chosen, strict=True))) for chosen in product(*sides)]


def divided(
    axes: Sequence[Sequence[float]], known: Mapping[Place, Hashable | None], widths: Sequence[float]
) -> tuple[list[Box], list[Place]]:
    """Return the boxes as far as they are divided, and the places that have to be known to go on.

    Parameters
    ----------
    known : place → what differs beyond an outline; None where that could not be found out
    widths : as narrow a box is wanted along each axis; infinite: not divided
    """
    left, found, wanted = boxes(axes), list[Box](), dict[Place, None]()
    places, kinds = np.array(list(known)), np.array(_numbered(known.values()))
    while left:
        box = left.pop()
        missing = [corner for corner in box.corners if corner not in known]
        parts = box.parts(widths) if not missing and _differ(box, places, kinds) else [box]
        wanted |= dict.fromkeys(missing)
        if len(parts) > 1:
            left += parts
        else:
            found.append(box)
    return found, sorted(wanted)


def _numbered(kinds: object) -> list[int]:
    """Return a number for each kind; -1 for None."""
    numbers: dict[Hashable, int] = {None: -1}
    return [numbers.setdefault(kind, len(numbers)) for kind in kinds]  # type: ignore[attr-defined]


def _differ(box: Box, places: np.ndarray, kinds: np.ndarray) -> bool:
    """Whether the places in a box, its edges included, are of several kinds."""
    inside = np.all((places >= box.low) & (places <= box.high), axis=1) & (kinds >= 0)
    return len(np.unique(kinds[inside])) > 1


def areas(found: Sequence[Box]) -> dict[Place, list[Edges]]:
    """Return what of a map each place stands for: of every box, the part that is nearest to that corner."""
    parts: dict[Place, list[Edges]] = {}
    for box in found:
        for corner in box.corners:
            sides = [_half(*one) for one in zip(corner, box.low, box.high, strict=True)]
            parts.setdefault(corner, []).append(sides)
    return {place: _whole(some) for place, some in parts.items()}


def _half(at: float, low: float, high: float) -> Side:
    """Return the half of a side that is nearer to its end `at`."""
    return (low, middle(low, high)) if at == low else (middle(low, high), high)


def _whole(parts: list[Edges]) -> list[Edges]:
    """Return the parts as one where they fill a rectangle."""
    around = [(min(a for a, _ in sides), max(b for _, b in sides)) for sides in zip(*parts, strict=True)]
    return [around] if np.isclose(sum(map(_size, parts)), _size(around), rtol=1e-9) else parts


def _size(part: Edges) -> float:
    return float(np.prod([high - low for low, high in part]))
