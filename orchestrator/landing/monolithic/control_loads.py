"""Thrust, torque and drive torques over time, in the places of the kernels' loads."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fmus.robot import rigid_body as rb
from fmus.robot.module import Robot
from orchestrator.coupling.course import Course


class ControlLoads:
    """The robot's control inputs: held at their values, or along their courses.

    Attributes
    ----------
    values : (2, 4 + 7 n_wheels) loads where a time begins within which they are straight, and their rates
    last : loads that a controller leaves in the end, by their names
    """

    def __init__(self, robot: Robot, courses: Mapping[str, Course]):
        places = self.places = places_of(robot.n_wheels)
        self.last: dict[str, float] = {}
        self.values = np.zeros((2, rb.BODY_LOADS + rb.WHEEL_LOADS * robot.n_wheels))
        self.courses = {places[name]: course for name, course in courses.items() if name in places}
        for name, place in places.items():
            self.values[0, place] = robot.values[robot.table.index[name]]

    @property
    def in_the_end(self) -> np.ndarray:
        """The loads that stay when all courses are over: (4 + 7 n_wheels,)."""
        found = self.values[0].copy()
        for place, course in self.courses.items():
            found[place] = course.value[-1]
        for name, value in self.last.items():
            found[self.places[name]] = value
        return found

    def kinks(self, start: float, end: float) -> list[float]:
        """Return the times within (`start`, `end`) at which one of the loads is not straight."""
        return sorted({t for course in self.courses.values() for t in course.kinks(start, end)})

    def set(self, start: float, end: float) -> None:
        """Write the loads at `start` and their rates until `end` (s), no kink being in between."""
        for place, course in self.courses.items():
            first = course.after(start)
            rise = course.before(end) - first if end > start else 0.0
            self.values[:, place] = first, rise / (end - start) if rise else 0.0


def places_of(n_wheels: int) -> dict[str, int]:
    """Return the place of each control input among the loads."""
    found = {"thrust": rb.THRUST} | {f"torque.{axis}": rb.TORQUE + i for i, axis in enumerate("xyz")}
    for k in range(n_wheels):
        found[f"wheel[{k + 1}].drive_torque"] = rb.BODY_LOADS + rb.WHEEL_LOADS * k + rb.DRIVE
    return found
