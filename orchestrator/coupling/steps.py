"""How many steps a run makes; no more than anybody can wait for."""

from __future__ import annotations

MOST = 10**9
"""Steps of a run."""


def number_of(span: float, step: float) -> int:
    """Return the number of steps nearest to `span` / `step` (s), at least one; `ValueError` where there are too many."""
    if not span / step <= MOST:
        raise ValueError(f"{span / step:.3g} steps are more than {MOST:.0e}; take a longer step, or an earlier stop")
    return max(1, round(span / step))
