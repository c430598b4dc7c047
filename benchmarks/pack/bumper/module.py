"""A massless Hunt–Crossley contact between two masses on one axis; law and exchanges: README.md."""

from __future__ import annotations

import math

import numpy as np

from fmus.kernels.jit import kernel
from fmus.module.variables import NON_NEGATIVE, POSITIVE, Variable, VariableTable, check_bounds, parameter

GAUSS = 8
MOTION = tuple(f"{side}.{what}" for side in ("left", "right") for what in ("position", "velocity"))


@kernel
def law(delta, rate, stiffness, exponent, damping):
    """Return the force (N) at an approach `delta` (m) and its rate (m/s)."""
    if delta <= 0.0:
        return 0.0
    return max(0.0, stiffness * delta**exponent * (1.0 + damping * rate))


@kernel
def crossings(start, a, b, out):
    """Write 0, the roots of start + a s + b s² within (0, 1) in order, and 1 into `out` (4,); return how many."""
    n, out[0] = 1, 0.0
    root = a * a - 4.0 * b * start
    if root > 0.0:
        q = -0.5 * (a + math.copysign(math.sqrt(root), a))
        first, second = start / q if q != 0.0 else -1.0, q / b if b != 0.0 else -1.0
        for s in (min(first, second), max(first, second)):
            if 0.0 < s < 1.0:
                out[n] = s
                n += 1
    out[n] = 1.0
    return n + 1


@kernel
def projected(start, a, b, h, prm, nodes, weights, cuts, out):
    """Write mean (N) and slope (N/s) of the force along delta(s) = start + a s + b s², s = 0 … 1 over `h` s, to `out` (2,)."""
    out[:] = 0.0
    for i in range(crossings(start, a, b, cuts) - 1):
        width = cuts[i + 1] - cuts[i]
        for j in range(nodes.size):
            s = cuts[i] + width * nodes[j]
            force = law(start + s * (a + s * b), (a + 2.0 * b * s) / h, prm[0], prm[1], prm[2])
            out[0] += width * weights[j] * force
            out[1] += width * weights[j] * force * (s - 0.5) * 12.0 / h


_VARIABLES = [
    parameter("stiffness", "N/m^n", 1e6, "stiffness k", POSITIVE),
    parameter("exponent", "1", 1.5, "exponent n", POSITIVE),
    parameter("damping", "s/m", 0.0, "damping D", NON_NEGATIVE),
    parameter("gap", "m", 0.0, "distance of the positions at touch"),
    Variable(
        "exchange",
        "parameter",
        "1",
        "point",
        "what the step assumes of the motion inside it",
        kind="string",
        choices=("point", "waveform"),
    ),
    *(
        Variable(f"{side}.{name}", "input", unit, 0.0, f"{text} of the {side} mass")
        for side in ("left", "right")
        for name, unit, text in (
            ("position", "m", "position"),
            ("velocity", "m/s", "velocity"),
            ("position_mean", "m", "time mean of the position"),
        )
    ),
    *(
        Variable(f"{side}.{name}", "output", unit, 0.0, f"{text} on the {side} mass", feedthrough=needs)
        for side in ("left", "right")
        for name, unit, text, needs in (
            ("force", "N", "force, its mean with waveform,", MOTION),
            ("force_rate", "N/s", "its slope within the last macro step, for waveform,", ()),
        )
    ),
    Variable("approach", "output", "m", 0.0, "approach of the masses beyond the gap", feedthrough=MOTION),
]


class Bumper:
    """The bumper; `state` (1,) is the approach at the last communication point."""

    NAME = "bumper"
    TITLE = "Bumper between two masses"
    table = VariableTable(_VARIABLES)

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(1)
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
        self._nodes, self._weights = 0.5 * (1.0 + nodes), 0.5 * weights
        self._cuts, self._force = np.zeros(4), np.zeros(2)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def initialize(self, t: float) -> None:
        """Check the parameters and start; raises `ModuleError`."""
        check_bounds(self.table, self.values, self.NAME)
        self.state[0] = self._approach("position") - self["gap"]
        self._write(self._now(), 0.0)

    def refresh(self) -> None:
        """Write the outputs from the inputs; with `waveform` they belong to the step that was made."""
        if not self._waveform:
            self._write(self._now(), 0.0)

    def step(self, t: float, h: float) -> None:
        """Advance by `h`."""
        start, end = float(self.state[0]), self._approach("position") - self["gap"]
        self.state[0] = end
        if not self._waveform:
            self._write(self._now(), 0.0)
            return
        b = 6.0 * (0.5 * (start + end) - (self._approach("position_mean") - self["gap"]))
        projected(start, end - start - b, b, h, self._law(), self._nodes, self._weights, self._cuts, self._force)
        self._write(*self._force)

    @property
    def _waveform(self) -> bool:
        return self["exchange"] == 1.0

    def _law(self) -> np.ndarray:
        return self.values[:3]

    def _approach(self, what: str) -> float:
        return self[f"left.{what}"] - self[f"right.{what}"]

    def _now(self) -> float:
        """Return the force at this instant, N."""
        return float(law(self._approach("position") - self["gap"], self._approach("velocity"), *self._law()))

    def _write(self, force: float, rate: float) -> None:
        outputs = {"left.force": -force, "left.force_rate": -rate, "right.force": force, "right.force_rate": rate}
        self.table.assign(self.values, outputs | {"approach": self._approach("position") - self["gap"]})
