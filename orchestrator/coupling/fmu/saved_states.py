"""Which saved states of an FMU can still be restored: FMI wants to know before a step whether any lies before it."""

from __future__ import annotations

from itertools import count

from orchestrator.coupling.fmu.binding import SavedState

Point = tuple[int, float]
"""Where an FMU stands: a number of its own for each step that led there, and the time, s. Rounding moves the time alone."""


class SavedStates:
    """The states that are kept, and the point that each belongs to."""

    def __init__(self) -> None:
        self._numbers = count(1)
        self._now: Point = (0, 0.0)
        self._kept: dict[int | None, Point] = {}

    def none_before(self, t: float) -> bool:
        """Return whether no state from before the present point, `t` (s), is kept: ``noSetFMUStatePriorToCurrentPoint``."""
        return not any(number != self._now[0] and time < t for number, time in self._kept.values())

    def saved(self, state: SavedState) -> None:
        """Note that the present state was saved."""
        self._kept[state.value] = self._now

    def restored(self, state: SavedState) -> None:
        """Note that a saved state is the present one again."""
        self._now = self._kept[state.value]

    def released(self, state: SavedState) -> None:
        """Note that a saved state is kept no longer."""
        self._kept.pop(state.value, None)

    def stepped(self, t: float) -> None:
        """Note that a step has led to `t`, s."""
        self._now = next(self._numbers), t
