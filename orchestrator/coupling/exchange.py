"""The exchange: what crosses an interface within a macro step.

A table says what two components may assume of one another between two communication points (`EXCHANGES`), and names say
which variable is what. A *load* X comes with its slope over the step, ``X_rate``; a *motion* X, given at the end of the step,
with its time mean, ``X_mean``; both are *companions* of X, the suffix stands before the axis: ``force_rate.x``. A load does
work on the motion of the same place (`LOADS`). The `names` that are asked for below are those that an FMU means so
(`Fmu.vocabulary`): what has such a name by chance, and another unit, is not among them.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

# -- what is assumed ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Exchange:
    """What components assume of one another within a macro step.

    Attributes
    ----------
    name : value of an FMU's parameter of the name `PARAMETER`
    slopes, means : whether loads come with slopes, motions with time means
    holds : whether an FMU that could take means takes its inputs as they are all the same
    order : of the error where the motion is smooth and the master implicit
    order_of_estimates : the order that is reckoned with, since touch, lift-off or slip may fall inside a step
    instead : the exchange for components that have no slopes or no means, if this one needs them
    """

    name: str
    slopes: bool
    means: bool
    order: int
    order_of_estimates: int
    instead: str = ""
    holds: bool = False

    def possible(self, *, slopes: bool, means: bool) -> Exchange:
        """Return this one, or the best one for components that have `slopes`, that have `means`."""
        if (self.slopes and not slopes) or (self.means and not means):
            return EXCHANGES[self.instead].possible(slopes=slopes, means=means)
        return self

    def inner_step(self, macro_step: float) -> float:
        """Return the longest inner step (s) of an expensive component: its error falls as that of the exchange does.

        Inner steps h have order 3, an exchange of order 4 allows h ~ H^(4/3): four of them in a macro step H of up to 10 ms,
        three at 20 ms, two at 40 ms (docs/notebook/decisions.md). One of order 2 needs no more than one.
        """
        if self.order < 4:
            return macro_step
        return float(np.clip(INNER * (macro_step / AT) ** (4.0 / 3.0), 0.25 * macro_step, 0.5 * macro_step))


INNER, AT = 1.25e-3, 5e-3
"""s; the inner step that leaves less than half of the flagship's error over 25 s, at this macro step."""
EXCHANGES = {
    row.name: row
    for row in (
        Exchange("held", False, False, order=2, order_of_estimates=2, holds=True),
        Exchange("point", False, False, order=2, order_of_estimates=2),
        Exchange("hermite", True, False, order=4, order_of_estimates=2, instead="point"),
        Exchange("waveform", True, True, order=4, order_of_estimates=3, instead="hermite"),
    )
}
"""What there is, from the coarsest to the finest (docs/concepts/exchange.md)."""
OTHER = Exchange("", True, True, order=2, order_of_estimates=2)
"""Of an FMU that says nothing or has an exchange of its own: whatever it has variables for."""
EXPLICIT_ORDER = 1
"""Order of the error of an explicit master, at least, whatever the exchange."""
PARAMETER = "exchange"
"""The FMU's parameter that chooses."""
MOVING = "moving_port"
"""The contact's parameter that says that the cable's port moves on within a step."""
Choice = Literal["point", "hermite", "waveform"]
"""What can be asked for as a whole; `held` is left to FMUs whose own parameter has it."""


def exchange_named(name: str) -> Exchange:
    """Return the row of the table, `OTHER` if there is none of that name."""
    return EXCHANGES.get(name, OTHER)


def coarsest(names: Iterable[str]) -> str:
    """Return the coarsest of several exchanges: what limits the whole. One that is not in the table counts if all are so."""
    given = [name for name in names if name]
    return min((n for n in given if n in EXCHANGES), key=list(EXCHANGES).index, default=next(iter(given), ""))


def suited_to(*, implicit: bool) -> Choice:
    """Return what suits a master best: one that goes back can make slopes and means consistent."""
    return "waveform" if implicit else "point"


# -- what is what, by name ----------------------------------------------------------------------------------------

RATE, MEAN = "_rate", "_mean"
"""Suffixes of companions."""


@dataclass(frozen=True)
class Load:
    """A load, and the motion of the same place that it does work on.

    Attributes
    ----------
    from_start : whether the motion is counted from the start of the macro step
    """

    motion: str
    from_start: bool = False


LOADS = {"force": Load("position"), "moment": Load("rotation", from_start=True)}
"""By the last part of a variable's name."""
VELOCITIES = {"position": "velocity", "rotation": "angular_velocity"}
"""Motions whose rate has a name of its own; that of any other X is ``X_rate``."""
ALONG = {"position": "tangent", "tangent": "curvature"}
"""Motions of a place on a line, with what they change by along it, per unit of arc length."""
FROM_START = tuple(load.motion for load in LOADS.values() if load.from_start)
MOMENTS = ("moment", "torque")
"""Loads that act through a force at the same place and its lever."""


def split(name: str) -> tuple[str, str, str]:
    """Return place, last part and axis of a name: ``port[1].``, ``force``, ``.x``; the first and the last may be empty."""
    stem = re.sub(r"\.[xyz]$", "", name)
    place, dot, last = stem.rpartition(".")
    return place + dot, last, name[len(stem) :]


def suffixed(name: str, suffix: str) -> str:
    """Return ``force_rate.x`` for ``force.x`` and ``_rate``: the suffix goes before the axis."""
    place, last, axis = split(name)
    return f"{place}{last}{suffix}{axis}"


def base_of(name: str, suffix: str) -> str | None:
    """Return ``force.x`` for ``force_rate.x`` and ``_rate``; None if the name has no such suffix."""
    place, last, axis = split(name)
    return f"{place}{last.removesuffix(suffix)}{axis}" if last.endswith(suffix) and last != suffix else None


def is_companion(name: str) -> bool:
    """Return whether `name` is that of a slope or of a mean."""
    return split(name)[1].endswith((RATE, MEAN))


def is_motion(name: str, names: Container[str]) -> bool:
    """Return whether one of `names` is a motion: its time mean is among them."""
    return suffixed(name, MEAN) in names


def is_load(name: str, names: Container[str]) -> bool:
    """Return whether one of `names` is a load: its slope is among them, and no mean. The rate of a motion is no slope."""
    return suffixed(name, RATE) in names and not is_motion(name, names)


def is_rate_of_motion(name: str, names: Container[str]) -> bool:
    """Return whether one of `names` is the rate of a motion: a value at an instant, no slope over the step."""
    base = base_of(name, RATE)
    return base is not None and is_motion(base, names)


def is_from_start(name: str) -> bool:
    """Return whether `name` is that of a motion counted from the start of the macro step."""
    return split(name)[1] in FROM_START


def is_slope_of_load(name: str) -> bool:
    """Return whether `name` is that of the slope of one of the `LOADS`."""
    return split(name)[1] in {load + RATE for load in LOADS}


def is_of_step(name: str) -> bool:
    """Return whether an output speaks of the whole step, not of its end: a mean, or a motion counted from the start."""
    return split(name)[1].endswith(MEAN) or is_from_start(name)


def only_couples(name: str) -> bool:
    """Return whether a component of a vector is there for the coupling alone: a companion, or a motion counted from the
    start of the step."""
    return split(name)[2] != "" and (is_companion(name) or is_from_start(name))


def motion_of(load: str) -> tuple[str, bool]:
    """Return the motion that a load does work on, ``port[1].position.x`` for ``port[1].force.x``, and whether it is counted
    from the start of the step."""
    place, last, axis = split(load)
    return f"{place}{LOADS[last].motion}{axis}", LOADS[last].from_start


def tangent_of(moment: str) -> str:
    """Return the tangent that a moment turns where no rotation is shown, ``port[1].tangent.x`` for ``port[1].moment.x``; empty
    for any other load."""
    place, last, axis = split(moment)
    return f"{place}tangent{axis}" if last == "moment" else ""


def rate_of(motion: str) -> str:
    """Return the name that the rate of a motion has, ``port[1].velocity.x`` for ``port[1].position.x``."""
    place, last, axis = split(motion)
    return f"{place}{VELOCITIES.get(last, last + RATE)}{axis}"


def along(motion: str) -> tuple[str, str]:
    """Return what a motion of a place changes by along the line that it is on, and the rate at which the place moves along.

    ``port[1].tangent.x`` and ``port[1].s_rate`` for ``port[1].position.x``; empty for any other motion. The place is ``s`` at
    the start of a step and ``s + s_rate h`` at its end; the rate of the motion, ``velocity``, is that of the material.
    """
    place, last, axis = split(motion)
    return (f"{place}{ALONG[last]}{axis}", f"{place}s_rate") if last in ALONG else ("", "")


def force_beside(moment: str) -> str:
    """Return the force at the place of a moment; any other name as it is."""
    place, last, axis = split(moment)
    return f"{place}force{axis}" if last in MOMENTS else moment


def vectors(names: Sequence[str]) -> np.ndarray:
    """Return for each name the number of the vector it is a component of, (len(names),) int: x, y, z have one."""
    number = {stem: i for i, stem in enumerate(stems(names))}
    return np.array([number[_stem(name)] for name in names], dtype=np.intp)


def stems(names: Sequence[str]) -> list[str]:
    """Return the names of those vectors, in the order of their numbers: without the axis."""
    return list(dict.fromkeys(map(_stem, names)))


def _stem(name: str) -> str:
    place, last, _ = split(name)
    return place + last
