"""Mass, spring and damper to the ground, and a second spring and damper to a neighbour; exact within a step.

    m x'' = -k x - d x' - k_c (x - x_n) - d_c (x' - v_n) + F,    F = force + force_rate (tau - t - h/2)

The neighbour's motion x_n, v_n is held during a step. Equations and use: README.md.
"""

from __future__ import annotations

import math

import numpy as np

from fmus.jit import kernel
from fmus.variables import ModuleError, Variable, VariableTable

TERMS = 18
"""Terms of the exponential series; with steps no longer than half the shortest time scale it is exact to round-off."""


@kernel
def advance(x, mass, stiffness, damping, force, rate, h):
    """Advance ``x = (position, velocity)`` (2,) by `h` s under the load ``force + rate tau``.

    The system is linear, so that the series of its exponential, scaled to short steps, solves it exactly.
    """
    speed = math.sqrt(stiffness / mass) + damping / mass
    n = math.ceil(2.0 * speed * h) + 1
    dt = h / n
    load = force
    for _ in range(n):
        dx, dv, df, slope = x[0], x[1], load, rate
        for k in range(1, TERMS + 1):
            ahead = dt / k
            dx, dv, df, slope = ahead * dv, ahead * (df - stiffness * dx - damping * dv) / mass, ahead * slope, 0.0
            x[0] += dx
            x[1] += dv
        load += rate * dt


def _variables() -> list[Variable]:
    neighbour = ("neighbour.position", "neighbour.velocity")
    return [
        Variable("mass", "parameter", "kg", 1.0, "mass m"),
        Variable("stiffness", "parameter", "N/m", 1.0, "spring to the ground k"),
        Variable("damping", "parameter", "N.s/m", 0.0, "damper to the ground d"),
        Variable("coupling_stiffness", "parameter", "N/m", 0.0, "spring to the neighbour k_c"),
        Variable("coupling_damping", "parameter", "N.s/m", 0.0, "damper to the neighbour d_c"),
        Variable("initial_position", "parameter", "m", 0.0, "position at the start"),
        Variable("initial_velocity", "parameter", "m/s", 0.0, "velocity at the start"),
        Variable("force", "input", "N", 0.0, "force on the mass, mean over the macro step"),
        Variable("force_rate", "input", "N/s", 0.0, "slope of the force within the macro step"),
        Variable("neighbour.position", "input", "m", 0.0, "position of the neighbour"),
        Variable("neighbour.velocity", "input", "m/s", 0.0, "velocity of the neighbour"),
        Variable("position", "output", "m", 0.0, "position of the mass"),
        Variable("velocity", "output", "m/s", 0.0, "velocity of the mass"),
        Variable("neighbour.force", "output", "N", 0.0, "force on the neighbour", feedthrough=neighbour),
    ]


class Oscillator:
    """The oscillator; `state` (2,) is position and velocity."""

    NAME = "oscillator"
    TITLE = "Mass between springs"
    table = VariableTable(_variables())

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(2)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def initialize(self, t: float) -> None:
        """Check the parameters and start; raises `ModuleError`."""
        if not self["mass"] > 0.0:
            raise ModuleError(f"oscillator: mass = {self['mass']:g} kg must be positive")
        for name in ("stiffness", "damping", "coupling_stiffness", "coupling_damping"):
            if not self[name] >= 0.0:
                raise ModuleError(f"oscillator: {name} = {self[name]:g} must not be negative")
        self.state[:] = self["initial_position"], self["initial_velocity"]
        self.refresh()

    def refresh(self) -> None:
        """Write the outputs from state and inputs."""
        stretch = self.state[0] - self["neighbour.position"]
        rate = self.state[1] - self["neighbour.velocity"]
        force = self["coupling_stiffness"] * stretch + self["coupling_damping"] * rate
        outputs = {"position": self.state[0], "velocity": self.state[1], "neighbour.force": force}
        self.table.assign(self.values, outputs)

    def step(self, t: float, h: float) -> None:
        """Advance by `h` with the neighbour held."""
        k, d = self["coupling_stiffness"], self["coupling_damping"]
        pull = k * self["neighbour.position"] + d * self["neighbour.velocity"]
        force = self["force"] + pull - 0.5 * h * self["force_rate"]
        total = self["stiffness"] + k, self["damping"] + d
        advance(self.state, self["mass"], *total, force, self["force_rate"], h)
        self.refresh()
