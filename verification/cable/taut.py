"""A weightless taut cable: the case with closed-form dynamics.

Its tension is uniform, and small motion across it is that of a tensioned beam. With stretch λ and strain ε, in the
unstretched arc length s: ρA ü = EA ε u'' - EI λ² u'''' - c EI λ² u̇'''', hinged at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from verification.cable.setups import TABLE1, Settings

SETTINGS: Settings = TABLE1 | {"gravity": 0.0, "unstretched_length": 199.8, "damping_time": 0.0}


@dataclass(frozen=True)
class Taut:
    """The tensioned beam: tension-like stiffness EA ε (N), EI λ² (N m²), rhoA (kg/m), length (m), damping time (s)."""

    tension: float
    ei: float
    density: float
    length: float
    damping: float

    @property
    def wave_speed(self) -> float:
        """Return the speed (m/s) of long waves in unstretched arc length."""
        return float(np.sqrt(self.tension / self.density))

    def wave_numbers(self, count: int) -> np.ndarray:
        """Return nπ/L of the first `count` modes, 1/m."""
        return np.arange(1, count + 1) * np.pi / self.length

    def frequencies(self, count: int) -> np.ndarray:
        """Return the first `count` undamped angular frequencies, rad/s."""
        beta = self.wave_numbers(count)
        return np.sqrt((self.tension * beta**2 + self.ei * beta**4) / self.density)

    def damping_ratios(self, count: int) -> np.ndarray:
        """Return their Kelvin–Voigt damping ratios."""
        return self.damping * self.ei * self.wave_numbers(count) ** 4 / (2.0 * self.density * self.frequencies(count))


def taut(settings: Settings) -> Taut:
    """Return the tensioned beam that a weightless cable is."""
    length = float(settings["unstretched_length"])
    stretch = float(settings["span"]) / length
    return Taut(
        float(settings["axial_stiffness"]) * 0.5 * (stretch**2 - 1.0),
        float(settings["bending_stiffness"]) * stretch**2,
        float(settings["linear_density"]),
        length,
        float(settings["damping_time"]),
    )
