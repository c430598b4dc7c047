"""Inputs of one FMU that follow courses over time, set for every step it makes, whoever asks for the step."""

from __future__ import annotations

from collections.abc import Collection, Container, Mapping
from typing import Protocol

import numpy as np

from orchestrator.coupling.course import Course
from orchestrator.coupling.exchange import MEAN, RATE, exchange_named, is_load, is_motion, suffixed
from orchestrator.coupling.fmu.description import Port
from orchestrator.coupling.fmu.group import Group, Owner


class Fmu(Owner, Protocol):
    """What is asked of the FMU."""

    ports: dict[str, Port]
    vocabulary: frozenset[str]

    @property
    def exchange(self) -> str:
        """What the FMU assumes of the motion inside a step."""
        ...


class Driven:
    """The inputs of an FMU that follow courses.

    A continuous input is given the mean over the step, and its slope where the FMU has an input ``_rate`` for it that is free;
    a motion, and what stands beside motions in an FMU that takes their means, its value at the end of the step (and its mean);
    a discrete one, and a tunable parameter, the value at the start.

    Parameters
    ----------
    courses : input or tunable parameter → its course over time
    taken : inputs of the FMU that something else sets: no slope or mean is written there

    Attributes
    ----------
    shown : whether an output depends on one of the inputs without a step, so that it is wanted at the end of the step, too

    Raises
    ------
    ValueError : one of them is no input and no tunable parameter, or cannot follow such a course
    """

    def __init__(self, fmu: Fmu, courses: Mapping[str, Course], taken: Collection[str] = ()):
        for name, course in courses.items():
            _require_possible(fmu, name, course)
        self.courses, self.taken, self.shown = dict(courses), taken, False
        self.ends = [name for name in courses if _is_at_end(fmu, name)]
        self.starts = [name for name in courses if _is_discrete(fmu.ports[name])]
        free = [n for n, p in fmu.ports.items() if _is_free(p) and n not in taken and n not in courses]
        rates, means = (self._companions(fmu, suffix, free) for suffix in (RATE, MEAN))
        self.rates, self.means = list(rates), list(means)
        self.group = Group(fmu, [*courses, *rates.values(), *means.values()])
        self.instants = Group(fmu, list(courses))

    def _companions(self, fmu: Fmu, suffix: str, free: Container[str]) -> dict[str, str]:
        """Return the inputs that have a companion which is free, with it."""
        found = {name: suffixed(name, suffix) for name in self.courses if name not in self.starts}
        return {n: other for n, other in found.items() if other in fmu.vocabulary and other in free}

    @property
    def without_slope(self) -> list[str]:
        """The inputs of which the FMU is told the mean over a step alone."""
        held = {*self.rates, *self.ends, *self.starts}
        return [name for name, course in self.courses.items() if name not in held and not course.stepwise]

    def sets(self, name: str) -> bool:
        """Return whether the input `name` is among those set here, slopes and means too."""
        return name in self.group.names

    def set_step(self, t: float, h: float) -> None:
        """Give the FMU what it needs for the step from `t` to `t + h` (s)."""
        over = {name: course.over(t, h) for name, course in self.courses.items()}
        at = {name: self.courses[name].before(t + h) for name in self.ends}
        at |= {name: self.courses[name].reached(t) for name in self.starts}
        values = [at.get(name, over[name][0]) for name in self.courses]
        self.group.values[:] = values + [over[name][1] for name in self.rates] + [over[name][0] for name in self.means]
        self.group.set()

    def set_instant(self, t: float) -> None:
        """Give the FMU the values at `t` (s)."""
        self.instants.values[:] = [course.reached(t) for course in self.courses.values()]
        self.instants.set()


def _require_possible(fmu: Fmu, name: str, course: Course) -> None:
    port = fmu.port(name)
    if port.causality != "input" and not _is_tunable(port):
        what = f"a {port.variability} parameter" if port.causality == "parameter" else port.causality
        raise ValueError(
            f"{fmu.name}.{name}: is no input but {what}; only inputs and tunable parameters follow a course over time"
        )
    if port.kind == "string":
        raise ValueError(f"{fmu.name}.{name}: is a string, which has no course over time; give one value")
    if port.kind == "real":
        return
    if not course.stepwise:
        raise ValueError(
            f'{fmu.name}.{name}: is of type {port.kind} and can only go in steps; add interpolation = "step"'
        )
    if not course.is_whole() or (port.kind == "boolean" and not set(np.unique(course.value)) <= {0.0, 1.0}):
        raise ValueError(f"{fmu.name}.{name}: is of type {port.kind}; its values must be such")


def _is_free(port: Port) -> bool:
    return port.causality == "input" and port.kind == "real" and port.vr >= 0


def _is_tunable(port: Port) -> bool:
    return port.causality == "parameter" and port.variability == "tunable"


def _is_discrete(port: Port) -> bool:
    return port.kind != "real" or port.variability == "discrete" or _is_tunable(port)


def _is_at_end(fmu: Fmu, name: str) -> bool:
    """Return whether a continuous input is a value at the end of the step, from which its course is rebuilt."""
    if _is_discrete(fmu.ports[name]):
        return False
    known = fmu.vocabulary.intersection(n for n, port in fmu.ports.items() if port.causality == "input")
    if is_motion(name, known):
        return True
    told = any(is_motion(n, known) for n in known) and not exchange_named(fmu.exchange).holds
    return told and not is_load(name, known)
