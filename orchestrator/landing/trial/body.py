"""A rigid body with wheels by Newton and Euler, in plain NumPy: what a robot is held against.

Written anew, without the kernels of our own robot: the two are held against each other by the trial of our robots.
Vectors are inertial unless a name ends in ``_B``; the start is at rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Wrench:
    """Loads on a robot, held in the inertial frame.

    Attributes
    ----------
    force, moment : (n_wheels, 3), N and N m, at the centres of the wheels
    thrust, torque : (3,), N at point b, and N m, on the body
    """

    force: np.ndarray
    moment: np.ndarray
    thrust: np.ndarray = field(default_factory=lambda: np.zeros(3))
    torque: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Body:
    """A rigid body as it stands at the start.

    Attributes
    ----------
    mass : kg
    inertia : (3, 3), kg m², about the centre of mass, wheels included
    arms : (n_wheels + 1, 3), m, from the centre of mass to the wheels' centres, then to point b
    axles : (n_wheels, 3), unit vectors
    spin_inertia : (n_wheels,), kg m², of the wheels that are free to spin; 0 where a wheel is fixed
    """

    mass: float
    inertia: np.ndarray
    arms: np.ndarray
    axles: np.ndarray
    spin_inertia: np.ndarray

    @property
    def n_wheels(self) -> int:
        """Number of wheels."""
        return len(self.axles)

    @property
    def gyration(self) -> float:
        """Radius of gyration, m."""
        return float(np.sqrt(np.trace(self.inertia) / 3 / self.mass))

    def accelerations(self, wrench: Wrench, R: np.ndarray, w: np.ndarray, spins: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return dv_G, dw and the wheels' spin accelerations, without gravity.

        Parameters
        ----------
        R : (3, 3), turn since the start
        w : (3,), angular velocity, rad/s
        spins : (n_wheels,), of the wheels relative to the body, rad/s
        """
        arms, axles, J = self.arms[:-1] @ R.T, self.axles @ R.T, R @ self.inertia @ R.T
        free = self.spin_inertia > 0.0
        torque = np.where(free, np.sum(wrench.moment * axles, axis=1), 0.0)
        momentum = J @ w + (self.spin_inertia * spins) @ axles
        moment = np.sum(np.cross(arms, wrench.force) + wrench.moment, axis=0) - torque @ axles - np.cross(w, momentum)
        moment = moment + np.cross(R @ self.arms[-1], wrench.thrust) + wrench.torque
        dw = np.linalg.solve(J - (axles.T * self.spin_inertia) @ axles, moment)
        spin = np.where(free, torque / np.where(free, self.spin_inertia, 1.0) - axles @ dw, 0.0)
        return (np.sum(wrench.force, axis=0) + wrench.thrust) / self.mass, dw, spin

    def response(self, wrench: Wrench) -> np.ndarray:
        """Return the accelerations (2 n_wheels + 2, 3) at the start: of the points of `arms`, then of the turning of the
        wheels and of the body."""
        still = np.zeros(3)
        dv, dw, spin = self.accelerations(wrench, np.eye(3), still, np.zeros(self.n_wheels))
        turning = dw + spin[:, None] * self.axles
        return np.vstack([dv + np.cross(dw, self.arms), turning, dw])

    def ride(self, wrench: Wrench, gravity: np.ndarray, duration: float, n: int) -> np.ndarray:
        """Return the velocities (2 n_wheels + 2, 3), as in `response`, and the points' displacements (n_wheels + 1, 3)
        after `duration` (s), by n steps of Runge and Kutta."""
        size = self.n_wheels
        y = np.concatenate([np.zeros(6), np.eye(3).ravel(), np.zeros(3 + size)])

        def slope(y: np.ndarray) -> np.ndarray:
            R, w, spins = y[6:15].reshape(3, 3), y[15:18], y[18:]
            dv, dw, spin = self.accelerations(wrench, R, w, spins)
            return np.concatenate([y[3:6], dv + gravity, np.cross(w, R.T).T.ravel(), dw, spin])

        h = duration / n
        for _ in range(n):
            k1 = slope(y)
            k2 = slope(y + h / 2 * k1)
            k3 = slope(y + h / 2 * k2)
            k4 = slope(y + h * k3)
            y = y + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        R, w = y[6:15].reshape(3, 3), y[15:18]
        arms, turning = self.arms @ R.T, w + y[18:, None] * (self.axles @ R.T)
        return np.vstack([y[3:6] + np.cross(w, arms), turning, w, y[:3] + arms - self.arms])
