"""A controller beside the monolithic solver: it samples the state, and its commands are held until it does so again.

It is the module of the FMU, stepped from one time to the next with what robot and contacts show there; so both see one law.
"""

from __future__ import annotations

import math
import re
from typing import Protocol

import numpy as np

from fmus.cable.state import Work
from fmus.contact import places as at
from fmus.kernels.rotations import follow_euler
from fmus.module.recipe import Module
from fmus.module.variables import VariableTable
from fmus.robot import dynamics
from fmus.robot import rigid_body as rb
from fmus.robot.module import Robot
from orchestrator.landing.monolithic.contacts import settle
from orchestrator.landing.monolithic.control_loads import ControlLoads
from orchestrator.landing.monolithic.state import Space, State, System

SAME_TIME = 1e-9
"""Part of the sample time within which an instant and a time are the same."""
FORCE = re.compile(r"contact\[(\d+)\]\.normal_force")


class Motion(Protocol):
    """What a controller sees of the solver, and the loads that it writes."""

    system: System
    state: State
    space: Space
    work: Work
    loads: ControlLoads


class Pilot:
    """The controller of a problem.

    Attributes
    ----------
    period : s, between its sampling instants
    outputs : names of what it shows
    """

    def __init__(self, controller: Module, robot: Robot, one: Motion):
        self.controller, self.one = controller, one
        table = controller.table
        inputs, self.outputs = table.names("input"), table.names("output")
        self.period = float(controller.values[table.index["sample_time"]])
        self._shown = table.indices(self.outputs)
        self._memory = robot.state.copy()
        self._motion = np.zeros(dynamics.BODY_OUTPUTS + dynamics.WHEEL_OUTPUTS * robot.n_wheels)
        self._of_robot = _shared(inputs, robot.table.names("output"), table)
        self._felt = [(table.index[m[0]], int(m[1]) - 1) for name in inputs if (m := FORCE.fullmatch(name))]
        self._commands = {one.loads.places[n]: table.index[n] for n in self.outputs if n in one.loads.places}
        one.loads.last = _last(controller, [n for n in self.outputs if n in one.loads.places])
        self._time = 0.0

    def start(self, t: float) -> None:
        """Sample for the first time, at `t` (s)."""
        self._time = t
        self._look()
        self.controller.initialize(t)
        self._command()

    def reach(self, t: float) -> None:
        """Look at the state that the solver has come to at `t` (s), and command; it samples if an instant has come."""
        if t <= self._time:
            return
        self._look()
        self.controller.step(self._time, t - self._time)
        self._time = t
        self._command()

    def instants(self, start: float, end: float) -> list[float]:
        """Return the sampling instants within (`start`, `end`), s."""
        first = math.floor(start / self.period + SAME_TIME) + 1
        last = math.ceil(end / self.period - SAME_TIME)
        return [k * self.period for k in range(first, last)]

    def values(self) -> np.ndarray:
        """Return what it shows, (len(outputs),)."""
        return self.controller.values[self._shown]

    def _look(self) -> None:
        """Write pose, velocities and contact forces into the controller's inputs."""
        one, memory, values = self.one, self._memory, self.controller.values
        memory[: rb.RIGID] = one.state.robot
        follow_euler(one.state.robot[rb.ATTITUDE : rb.VELOCITY], memory[dynamics.ANGLES : dynamics.CONTROL_WORK])
        dynamics.outputs(one.system.robot, memory, self._motion)
        places, outputs = self._of_robot
        values[places] = self._motion[outputs]
        settle(one.system, one.state, False, one.space, one.work)
        for place, k in self._felt:
            values[place] = one.space.out[0][k, at.NORMAL] if k < one.space.out.shape[1] else 0.0

    def _command(self) -> None:
        """Hold what it commands from now on."""
        for load, place in self._commands.items():
            self.one.loads.values[:, load] = self.controller.values[place], 0.0


def _last(controller: Module, commands: list[str]) -> dict[str, float]:
    """Return the commands when all is over: no torque, and the last share of the weight for the thrust."""
    table, names = controller.table, ("final_share", "mass", "gravity")
    known = all(name in table.index for name in names)
    share = float(np.prod(controller.values[table.indices(names)])) if known else 0.0
    return {name: share if name == "thrust" else 0.0 for name in commands}


def _shared(inputs: list[str], outputs: list[str], table: VariableTable) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the inputs that are outputs of the robot, and which of its outputs they are."""
    both = [name for name in inputs if name in outputs]
    return table.indices(both), np.array([outputs.index(name) for name in both], dtype=np.int64)
