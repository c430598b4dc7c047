"""Mass, spring and damper under a held force: every kind of variable, and a solution in closed form.

``m x'' + d x' + k x = F``, underdamped. ``exact`` advances by the closed-form solution, ``euler`` by
`substeps` steps of the semi-implicit Euler method.
"""

from __future__ import annotations

import math

import numpy as np

from fmus.kernels.jit import kernel
from fmus.module.variables import ModuleError, Variable, VariableTable


@kernel
def advance_exactly(prm: np.ndarray, x: np.ndarray, force: float, h: float) -> None:
    """Advance ``x = (position, velocity)`` by `h` (underdamped); ``prm = (mass, damping, stiffness)``."""
    decay = prm[1] / (2.0 * prm[0])
    omega = math.sqrt(prm[2] / prm[0] - decay * decay)
    rest = force / prm[2]
    a, b = x[0] - rest, (x[1] + decay * (x[0] - rest)) / omega
    c, s, e = math.cos(omega * h), math.sin(omega * h), math.exp(-decay * h)
    x[0] = rest + e * (a * c + b * s)
    x[1] = e * (omega * (b * c - a * s) - decay * (a * c + b * s))


def _variables(n_forces: int) -> list[Variable]:
    forces = [f"force[{k}]" for k in range(1, n_forces + 1)]
    return [
        Variable("mass", "parameter", "kg", 1.0, "mass"),
        Variable("damping", "parameter", "N.s/m", 0.2, "damper constant"),
        Variable("stiffness", "parameter", "N/m", 4.0, "spring constant"),
        Variable("initial_position", "parameter", "m", 1.0, "position at the start"),
        Variable("substeps", "parameter", "1", 4, "steps of the Euler method", kind="integer"),
        Variable("locked", "parameter", "1", False, "the mass cannot move", kind="boolean"),
        Variable("method", "parameter", "1", "exact", "how to advance", "string", ("exact", "euler")),
        *(Variable(name, "input", "N", 0.0, "force on the mass, held") for name in forces),
        Variable("offset", "input", "m", 0.0, "position of the spring's foot", discrete=True),
        Variable("position", "output", "m", 0.0, "position of the mass"),
        Variable("velocity", "output", "m/s", 0.0, "velocity of the mass"),
        Variable("acceleration", "output", "m/s2", 0.0, "its acceleration", feedthrough=(*forces, "offset")),
        Variable("n_steps", "output", "1", 0, "steps taken", kind="integer"),
        Variable("moves_up", "output", "1", False, "the velocity is positive", kind="boolean"),
        Variable("n_forces", "output", "1", n_forces, "number of forces", kind="integer"),
    ]


class Oscillator:
    """A mass on a spring with `n_forces` forces on it."""

    NAME = "oscillator"
    TITLE = "Damped oscillator"

    def __init__(self, n_forces: int = 1):
        self.table = VariableTable(_variables(n_forces))
        self.values = self.table.defaults()
        self.state = np.zeros(3)
        self._forces = self.table.indices(f"force[{k}]" for k in range(1, n_forces + 1))
        self._parameters = np.zeros(3)

    def __getitem__(self, name: str) -> float:
        return self.values[self.table.index[name]]

    def initialize(self, t: float) -> None:
        if self["mass"] <= 0.0:
            raise ModuleError(f"oscillator: mass is {self['mass']:g} kg; 100 % of it must be positive")
        if self["damping"] < 0.0:
            raise ValueError("an unforeseen error, 100 % of the time")
        self._parameters = np.array([self["mass"], self["damping"], self["stiffness"]])
        self.state[:] = self["initial_position"], 0.0, 0.0
        self.refresh()

    def refresh(self) -> None:
        if self["offset"] > 1e3:
            raise ModuleError("oscillator: the foot is out of reach")
        m, d, k = self._parameters
        x, v, n = self.state
        force = self.values[self._forces].sum() + k * self["offset"]
        outputs = {"position": x, "velocity": v, "acceleration": (force - d * v - k * x) / m, "n_steps": n}
        self.table.assign(self.values, {**outputs, "moves_up": v > 0.0})

    def step(self, t: float, h: float) -> None:
        self.state[2] += 1.0
        if h > 1e3:
            raise ValueError("a step of 100 % too much")
        force = self.values[self._forces].sum() + self._parameters[2] * self["offset"]
        if not self["locked"] and self.table["method"].decode(self["method"]) == "exact":
            advance_exactly(self._parameters, self.state, force, h)
        elif not self["locked"]:
            self._euler(force, h / self["substeps"])
        self.refresh()

    def _euler(self, force: float, h: float) -> None:
        m, d, k = self._parameters
        for _ in range(int(self["substeps"])):
            self.state[1] += h * (force - d * self.state[1] - k * self.state[0]) / m
            self.state[0] += h * self.state[1]
