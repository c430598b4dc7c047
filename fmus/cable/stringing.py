"""The unstretched length of a line that is known by its sag, or by its horizontal tension, at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fmus.cable.assembly import Model, element_work, internal_force, interpolate
from fmus.cable.statics import equilibrium
from fmus.kernels.roots import root
from fmus.module.variables import ModuleError

CLOSEST = 1e-12
"""Error of the length found, by the chord: 2e-5 N of tension in a line of 20 MN."""
WIDEST = 24
"""How often a bracket is doubled before the tension wanted is out of reach."""


@dataclass(frozen=True)
class Stringing:
    """A line between its supports, whatever its length.

    Attributes
    ----------
    model : unstretched length, m → the meshed line; the mesh keeps its shares of the length, so that nothing jumps
    span, level_difference : where the right support stands, m
    """

    model: Callable[[float], Model]
    span: float
    level_difference: float

    @property
    def chord(self) -> float:
        """The distance of the supports, m."""
        return float(np.hypot(self.span, self.level_difference))

    def rest(self, length: float) -> tuple[Model, np.ndarray]:
        """Return the line of the given unstretched length, and its equilibrium (n,)."""
        model = self.model(length)
        return model, equilibrium(model, self.span, self.level_difference)

    def length_for_sag(self, wanted: float) -> float:
        """Return the unstretched length (m) with which the line has the sag `wanted`, m."""

        def excess(length: float) -> float:
            return sag(*self.rest(length), self.level_difference) - wanted

        parabola = self.chord * (1.0 + 4.0 * (wanted / self.chord) ** 2) + wanted * 0.01
        longest = min(parabola, self.chord + 2.1 * wanted)
        try:
            return root(excess, 0.99 * self.chord, longest, xtol=CLOSEST * self.chord)
        except ValueError:
            raise ModuleError(
                f"cable: sag: {wanted:g} m cannot be reached; check it against span, axial_stiffness and linear_density"
            ) from None

    def length_for_tension(self, wanted: float) -> float:
        """Return the unstretched length (m) with which the line has the horizontal tension `wanted`, N.

        The search starts from the catenary of that tension; bending and the measure of strain move it a little.
        """

        def excess(length: float) -> float:
            return wanted - horizontal_tension(*self.rest(length))

        try:
            guess = self._catenary_length(wanted)
            width = 1e-5 * self.chord
            for _ in range(WIDEST):
                if excess(guess - width) < 0.0 < excess(guess + width):
                    return root(excess, guess - width, guess + width, xtol=CLOSEST * self.chord)
                width *= 2.0
        except (ValueError, OverflowError, ModuleError):
            pass  # a root without a bracket, or a slack line that has no equilibrium
        raise ModuleError(
            f"cable: horizontal_tension: {wanted:g} N cannot be reached; "
            "check it against span, axial_stiffness and linear_density"
        )

    def _catenary_length(self, h: float) -> float:
        """Return the unstretched length (m) of the catenary of horizontal tension `h`, its mean tension taken for all of it.

        Irvine, Cable Structures, 1981, section 1.2: (2 a sinh(l/2a))² is the square of its length less that of the level
        difference, a = h/w.
        """
        model = self.model(self.chord)
        x = 0.5 * model.density * model.gravity * self.span / h
        if x > 700.0:
            raise OverflowError
        stretched = float(np.hypot(self.span * (np.sinh(x) / x if x > 0.0 else 1.0), self.level_difference))
        return stretched / (1.0 + h * stretched / (self.span * model.ea))


def sag(model: Model, q: np.ndarray, level_difference: float) -> float:
    """Return the sag (m) in the middle of the line: below half way between the supports' heights."""
    point = np.zeros(6)
    interpolate(model, q, 0.5 * model.s[-1], np.zeros(8), point)
    return float(0.5 * level_difference - point[2])


def horizontal_tension(model: Model, q: np.ndarray) -> float:
    """Return the horizontal tension (N) at rest: the pull on the left support along the span; with dead loads all along."""
    force = np.zeros(q.size)
    internal_force(model, q, np.zeros(q.size), force, element_work())
    return float(model.weight[1] - force[1])
