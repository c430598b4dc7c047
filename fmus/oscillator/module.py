"""Mass, spring and damper to the ground, and a second spring and damper to a neighbour; exact within a step.

    m x'' = -k x - d x' - k_c (x - x_n) - d_c (x' - v_n) + F,    F = force + force_rate (tau - t - h/2)

Within a step the neighbour's motion x_n, v_n is held, or it is the quadratic through its start, its end and its time
mean (`exchange`). Equations and use: README.md.
"""

from __future__ import annotations

import math

import numpy as np

from fmus.kernels.jit import kernel
from fmus.module.variables import NON_NEGATIVE, POSITIVE, Variable, VariableTable, check_bounds, parameter

TERMS = 18
"""Terms of the exponential series; with steps no longer than half the shortest time scale it is exact to round-off."""
FORCE_TWICE, FORCE_ONCE, POSITION_ONCE, X, V, LOAD, SLOPE, X_N, V_N, A_N = range(10)


@kernel
def advance(z, term, mass, stiffness, damping, coupling, coupling_damping, h):
    """Advance `z` (10,) by `h` s; `term` (10,) is workspace.

    `z` is the coupling force integrated twice and once, the position integrated once, position and velocity, the load
    and its slope, position, velocity and acceleration of the neighbour. The system is linear, so that the series of
    its exponential, scaled to short steps, solves it exactly.
    """
    speed = math.sqrt((stiffness + coupling) / mass) + (damping + coupling_damping) / mass
    n = math.ceil(2.0 * speed * h) + 1
    for _ in range(n):
        for i in range(10):
            term[i] = z[i]
        for k in range(1, TERMS + 1):
            ahead = h / (n * k)
            force = coupling * (term[X] - term[X_N]) + coupling_damping * (term[V] - term[V_N])
            pull = term[LOAD] - stiffness * term[X] - damping * term[V] - force
            term[FORCE_TWICE], term[FORCE_ONCE] = ahead * term[FORCE_ONCE], ahead * force
            term[POSITION_ONCE], term[X], term[V] = ahead * term[X], ahead * term[V], ahead * pull / mass
            term[LOAD], term[SLOPE] = ahead * term[SLOPE], 0.0
            term[X_N], term[V_N], term[A_N] = ahead * term[V_N], ahead * term[A_N], 0.0
            for i in range(10):
                z[i] += term[i]


_NEIGHBOUR = ("neighbour.position", "neighbour.velocity")
_VARIABLES = [
    parameter("mass", "kg", 1.0, "mass m", POSITIVE),
    parameter("stiffness", "N/m", 1.0, "spring to the ground k", NON_NEGATIVE),
    parameter("damping", "N.s/m", 0.0, "damper to the ground d", NON_NEGATIVE),
    parameter("coupling_stiffness", "N/m", 0.0, "spring to the neighbour k_c", NON_NEGATIVE),
    parameter("coupling_damping", "N.s/m", 0.0, "damper to the neighbour d_c", NON_NEGATIVE),
    parameter("initial_position", "m", 0.0, "position at the start"),
    parameter("initial_velocity", "m/s", 0.0, "velocity at the start"),
    Variable(
        "exchange",
        "parameter",
        "1",
        "held",
        "what the step assumes of the neighbour's motion inside it",
        kind="string",
        choices=("held", "waveform"),
    ),
    Variable("force", "input", "N", 0.0, "force on the mass, mean over the macro step"),
    Variable("force_rate", "input", "N/s", 0.0, "slope of the force within the macro step"),
    Variable("neighbour.position", "input", "m", 0.0, "position of the neighbour"),
    Variable("neighbour.velocity", "input", "m/s", 0.0, "velocity of the neighbour"),
    Variable("neighbour.position_mean", "input", "m", 0.0, "its time mean over the macro step, for waveform"),
    Variable("position", "output", "m", 0.0, "position of the mass"),
    Variable("position_mean", "output", "m", 0.0, "its time mean over the last macro step"),
    Variable("velocity", "output", "m/s", 0.0, "velocity of the mass"),
    Variable(
        "neighbour.force",
        "output",
        "N",
        0.0,
        "force on the neighbour, its mean with waveform",
        feedthrough=_NEIGHBOUR,
    ),
    Variable("neighbour.force_rate", "output", "N/s", 0.0, "its slope within the last macro step, for waveform"),
]


class Oscillator:
    """The oscillator; `state` (3,) is position and velocity, and where the neighbour was."""

    NAME = "oscillator"
    TITLE = "Mass between springs"
    table = VariableTable(_VARIABLES)

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(3)
        self._work = np.zeros((2, 10))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def initialize(self, t: float) -> None:
        """Check the parameters and start; raises `ModuleError`."""
        check_bounds(self.table, self.values, "oscillator")
        self.state[:] = self["initial_position"], self["initial_velocity"], self["neighbour.position"]
        self._write(self.state[0], self._force(), 0.0)

    def refresh(self) -> None:
        """Write the outputs from state and inputs; with `waveform` they belong to the step that was made."""
        if not self._waveform:
            self._write(self["position_mean"], self._force(), 0.0)

    def step(self, t: float, h: float) -> None:
        """Advance by `h`."""
        z, term = self._work
        names = ("mass", "stiffness", "damping", "coupling_stiffness", "coupling_damping")
        z[:] = 0.0
        z[X], z[V] = self.state[:2]
        z[LOAD], z[SLOPE] = self["force"] - 0.5 * h * self["force_rate"], self["force_rate"]
        z[X_N], z[V_N], z[A_N] = self._neighbour(h)
        if not self._waveform:  # v_n is no motion then, but a constant part of the load
            z[LOAD] += self["coupling_damping"] * self["neighbour.velocity"]
        advance(z, term, *(self[name] for name in names), h)
        self.state[:] = z[X], z[V], self["neighbour.position"]
        mean, rate = z[FORCE_ONCE] / h, 12.0 / h**3 * (0.5 * h * z[FORCE_ONCE] - z[FORCE_TWICE])
        self._write(z[POSITION_ONCE] / h, *((mean, rate) if self._waveform else (self._force(), 0.0)))

    @property
    def _waveform(self) -> bool:
        return self["exchange"] == 1.0

    def _neighbour(self, h: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration of the neighbour at the start of a step of `h` s."""
        end = self["neighbour.position"]
        if not self._waveform:
            return end, 0.0, 0.0
        start = float(self.state[2])
        b = 6.0 * (0.5 * (start + end) - self["neighbour.position_mean"])
        return start, (end - start - b) / h, 2.0 * b / h**2

    def _force(self) -> float:
        """Return the force on the neighbour at this instant, N."""
        stretch = self.state[0] - self["neighbour.position"]
        rate = self.state[1] - self["neighbour.velocity"]
        return float(self["coupling_stiffness"] * stretch + self["coupling_damping"] * rate)

    def _write(self, mean: float, force: float, rate: float) -> None:
        outputs = {"position": self.state[0], "velocity": self.state[1], "position_mean": mean}
        self.table.assign(self.values, outputs | {"neighbour.force": force, "neighbour.force_rate": rate})
