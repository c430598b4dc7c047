"""When wheels were off the cable."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.run.results import Table

CLOSED = (1.0, 2.0)
"""Values of a contact's ``status``: sticking, slipping. Open is 0."""
SLIPPING = 2.0
LEFT_THE_GROOVE = 3.0
"""Value of a contact's ``status`` when the cable has left the groove."""


@dataclass(frozen=True)
class Flight:
    """When wheels were off the cable after the first touch, to the macro step.

    Attributes
    ----------
    time : (n,) s
    wheels : contact → (n,) bool, whether it was open
    airborne : (n,) bool, whether all were, since the first touch
    """

    time: np.ndarray
    wheels: Mapping[str, np.ndarray]
    airborne: np.ndarray

    @property
    def total(self) -> float:
        """Time without any contact, s."""
        return _duration(self.time, self.airborne)

    @property
    def spans(self) -> list[tuple[float, float]]:
        """Start and end (s) of each span without any contact; it begins and ends in the middle of a macro step."""
        return spans(self.time, self.airborne)

    @property
    def of_wheels(self) -> dict[str, float]:
        """Time of each wheel without contact since it first touched, s."""
        return {name: _duration(self.time, since_touch(is_open)) for name, is_open in self.wheels.items()}


def flight(table: Table) -> Flight | None:
    """Return when the robot of a landing was in the air; None where it has no contacts, or has not touched."""
    wheels = open_wheels(table)
    if not wheels or all(is_open.all() for is_open in wheels.values()):
        return None
    return Flight(table["time"], wheels, since_touch(np.all(list(wheels.values()), axis=0)))


def open_wheels(table: Table) -> dict[str, np.ndarray]:
    """Return contact → (n,) bool, whether it was open."""
    names = [m[1] for name in table if (m := re.fullmatch(r"(contact\d+)\.status", name))]
    return {name: ~np.isin(table[f"{name}.status"], CLOSED) for name in names}


def left_the_groove(table: Table) -> list[str]:
    """Return the contacts that the cable has left."""
    return [
        name.removesuffix(".status")
        for name, values in table.items()
        if name.startswith("contact") and name.endswith(".status") and np.any(values == LEFT_THE_GROOVE)
    ]


def since_touch(is_open: np.ndarray) -> np.ndarray:
    """Return `is_open` (n,) with False before the first touch."""
    return is_open & (np.cumsum(~is_open) > 0)


def spans(time: np.ndarray, flags: np.ndarray) -> list[tuple[float, float]]:
    """Return start and end (s) of each span in which `flags` (n,) hold; both in the middle of a macro step."""
    edges = np.diff(np.concatenate([[False], flags, [False]]).astype(int))
    middle = np.concatenate([time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]])
    return list(zip(middle[edges == 1].tolist(), middle[edges == -1].tolist(), strict=True))


def time_off(time: np.ndarray, is_open: np.ndarray) -> np.ndarray:
    """Return for how long (n,) s a wheel has been off the line again; where it touches anew, for how long it was."""
    found = np.zeros(len(time))
    for start, end in spans(time, since_touch(is_open)):
        during = (time > start) & (time < end)
        found[during] = time[during] - start
        found[min(int(np.searchsorted(time, end)), len(time) - 1)] = end - start
    return found


def _duration(time: np.ndarray, flags: np.ndarray) -> float:
    """Return for how long `flags` (n,) hold; a macro step in which they change counts half."""
    return float(np.diff(time) @ (0.5 * (flags[1:].astype(float) + flags[:-1])))
