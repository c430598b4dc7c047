"""A point mass on a taut cable: placed at rest under its weight, and striking it.

Mass and cable are tied at a port: in every macro step the force and its slope are found with which position at the
end and time mean of the position agree on both sides. The cable is weightless (`verification/cable/taut.py`), 199.8
m on a span of 200 m.

(1) A mass of 38 kg with its weight, set on the cable at rest. Reference: modes of the tensioned beam with the mass,
a series of sines with the mass as a matrix of rank one. The load is scaled to 1 N, so that the motion stays small.
(2) A mass that strikes at 1 mm/s and sticks. Until waves come back from the supports the cable is an infinite
beam-string, whose impedance at a point is Z(p) = 2 √(ρA) √(T + 2 p √(ρA EI)) (from the roots of EI k⁴ - T k² + ρA
p² = 0), and the mass has the velocity v₀ m/(m p + Z(p)) in the Laplace domain; its integral is inverted numerically
(Talbot's contour; Weideman 2006). Heights are compared: the jump of the velocity leaves ripples of the mesh, below
1 %, in the velocity of the tied node. After 0.25 s the first, fast bending waves come back.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import eigh

from fmus.cable.module import Cable
from orchestrator.report.style import BLUE, STYLE, VERMILION
from verification.cable.setups import Settings, cable
from verification.cable.taut import SETTINGS, Taut, taut
from verification.study import Result, Row

TITLE = "A point mass on the cable"
MASS = 38.0
MESH: Settings = {"n_elements": 120, "grading": 30.0, "spectral_radius": 1.0}


class TiedMass:
    """A point mass that moves along z, tied to port 1 of a cable."""

    def __init__(self, made: Cable, s: float, mass: float, weight: float, velocity: float):
        self.cable, self.mass, self.weight = made, mass, weight
        made.table.assign(made.values, {"port[1].s": s})
        made.refresh()
        self.z, self.v = made["port[1].position.z"], velocity
        self.load = np.zeros(2)
        self.jacobian: np.ndarray | None = None

    def _cable(self, load: np.ndarray, h: float) -> np.ndarray:
        """Return end and mean of the port's height after a step from the present state under force and slope."""
        settings = {"port[1].force.z": float(load[0]), "port[1].force_rate.z": float(load[1])}
        self.cable.table.assign(self.cable.values, settings)
        self.cable.step(0.0, h)
        return np.array([self.cable["port[1].position.z"], self.cable["port[1].position_mean.z"]])

    def _mass(self, load: np.ndarray, h: float) -> np.ndarray:
        """Return end and mean of the mass's height; the force on it is -(F + F' (τ - h/2)) - weight."""
        a, rate = -(load[0] + self.weight) / self.mass, -load[1] / self.mass
        end = self.z + h * self.v + a * h**2 / 2 - rate * h**3 / 12
        return np.array([end, self.z + h * self.v / 2 + a * h**2 / 6 - rate * h**3 / 24])

    def step(self, h: float) -> None:
        """Advance both by h; Newton's method with a Jacobian made once, as the motion is small."""
        start = self.cable.state.copy()

        def gap(load: np.ndarray) -> np.ndarray:
            self.cable.state[:] = start
            return self._cable(load, h) - self._mass(load, h)

        if self.jacobian is None:
            base, units = gap(self.load), np.diag([1.0, 1.0 / h])
            self.jacobian = np.stack([(gap(self.load + u) - base) / u.max() for u in units], axis=1)
        for _ in range(20):
            step = np.linalg.solve(self.jacobian, -gap(self.load))
            self.load = self.load + step
            if np.abs(step * [1.0, h]).max() < 1e-9 * max(1e-3, np.abs(self.load[0])):
                break
        else:
            raise RuntimeError("point mass: force and motion do not agree; take a shorter macro step")
        gap(self.load)
        end = self._mass(self.load, h)[0]
        self.v -= h * (self.load[0] + self.weight) / self.mass
        self.z = end


def run_tied(settings: Settings, s: float, weight: float, velocity: float, h: float, stop: float) -> np.ndarray:
    """Return height and velocity of the mass at the ends of the macro steps: (n, 2)."""
    made = cable(settings, grading_position=s, integration_step=h / 4.0)
    tied = TiedMass(made, s, MASS, weight, velocity)
    rows = []
    for _ in range(round(stop / h)):
        tied.step(h)
        rows.append((tied.z, tied.v))
    return np.array(rows)


def modal_height(theory: Taut, s: float, weight: float, times: np.ndarray, count: int = 1500) -> np.ndarray:
    """Return the height of a mass set on the beam at rest, by modes of beam and mass together."""
    beta = theory.wave_numbers(count)
    shape = np.sin(beta * s)
    mass = 0.5 * theory.density * theory.length * np.eye(count) + MASS * np.outer(shape, shape)
    stiffness = 0.5 * theory.length * (theory.tension * beta**2 + theory.ei * beta**4)
    values, vectors = eigh(np.diag(stiffness), mass)
    at = shape @ vectors
    return -weight * (at**2 / values * (1.0 - np.cos(np.outer(times, np.sqrt(values))))).sum(axis=1)


def talbot(transform: Callable[[np.ndarray], np.ndarray], times: np.ndarray, n: int = 32) -> np.ndarray:
    """Return the inverse Laplace transform at `times`: trapezoidal rule on Talbot's contour (Weideman 2006)."""
    theta = (2.0 * np.arange(n) + 1.0) * np.pi / n - np.pi
    z = n * (0.5017 * theta / np.tan(0.6407 * theta) - 0.6122 + 0.2645j * theta)
    dz = n * (0.5017 / np.tan(0.6407 * theta) - 0.5017 * 0.6407 * theta / np.sin(0.6407 * theta) ** 2 + 0.2645j)
    return np.real([(np.exp(z) * transform(z / t) * dz).sum() / (1j * n * t) for t in times])


def impact_height(theory: Taut, v0: float, times: np.ndarray) -> np.ndarray:
    """Return the height of a mass that has struck an infinite beam-string and sticks to it."""

    def transform(p: np.ndarray) -> np.ndarray:
        root = np.sqrt(theory.tension + 2.0 * p * np.sqrt(theory.density * theory.ei))
        return v0 * MASS / (p * (MASS * p + 2.0 * np.sqrt(theory.density) * root))

    return talbot(transform, times)


def placed(n_elements: int, h: float, stop: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, computed and exact height of the mass set on the cable at 60 m; weight 1 N."""
    times = h * np.arange(1, round(stop / h) + 1)
    found = run_tied(SETTINGS | MESH | {"n_elements": n_elements}, 60.0, 1.0, 0.0, h, stop)[:, 0]
    return times, found, modal_height(taut(SETTINGS), 60.0, 1.0, times)


def impact(n_elements: int, h: float, stop: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, computed and exact height of the mass that strikes at midspan."""
    times, middle = h * np.arange(1, round(stop / h) + 1), 0.5 * float(SETTINGS["unstretched_length"])
    mesh = MESH | {"n_elements": n_elements, "spectral_radius": 0.9}
    found = run_tied(SETTINGS | mesh, middle, 0.0, -1e-3, h, stop)[:, 0]
    return times, found, impact_height(taut(SETTINGS), -1e-3, times)


def row(label: str, computed: np.ndarray, expected: np.ndarray, source: str, tolerance: float) -> Row:
    """Return the largest difference of two histories over the largest value."""
    error = float(np.abs(computed - expected).max() / np.abs(expected).max())
    return Row(f"{label}: largest difference, of the peak", error, 0.0, source, tolerance, relative=False)


def run(figures: Path) -> Result:
    """Compare both, and draw them."""
    modal, infinite = placed(120, 0.005, 4.0), impact(240, 0.0025, 0.25)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 2, figsize=(7.0, 2.8))
        labels = (("Height, mm", 1e3, modal), ("Height, mm", 1e3, infinite))
        for ax, (label, factor, (t, computed, exact)) in zip(axes, labels, strict=True):
            ax.plot(t, factor * exact, color=BLUE, label="reference")
            ax.plot(t, factor * computed, ":", color=VERMILION, label="cable")
            ax.set_xlabel("Time, s")
            ax.set_ylabel(label)
        axes[0].legend()
        figure.savefig(figures / "cable_point_mass.png")
        plt.close(figure)
    found = [
        row("38 kg set on the cable at 60 m, height over 4 s", *modal[1:], "modes of beam and mass", 1e-5),
        row(
            "38 kg striking at midspan, height over 0.25 s",
            *infinite[1:],
            "infinite beam-string, inverted Laplace",
            5e-5,
        ),
    ]
    return Result(found, [("cable_point_mass.png", "A mass set on the cable (left), a mass that strikes it (right)")])
