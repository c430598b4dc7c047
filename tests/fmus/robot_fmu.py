"""Test FMU: a robot by other means: the contract's needed variables alone, no units, no dependencies, Runge–Kutta.

The numbers are those of `fmus/robot/catalogue/fptlir.toml`. As with many tools the outputs are known only once the
initialisation is over.
"""

import pickle

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

MASS, GRAVITY, LONGEST = 38.0, 9.8, 1e-3  # kg, m/s², longest inner step in s
TO_G, TO_WHEEL = np.array([0.0, 0.0, -0.10]), np.array([0.0, 0.0, 0.2152])  # from b, in B, m
INERTIA = np.diag([5.8, 5.8, 8.5]) - MASS * (TO_G @ TO_G * np.eye(3) - np.outer(TO_G, TO_G))  # about G, kg m²
START = [f"initial.position.{axis}" for axis in "xyz"]
LOADS = [f"wheel[1].{load}.{axis}" for load in ("force", "moment") for axis in "xyz"]
MOTION = ["wheel[1].position", "wheel[1].axle", "wheel[1].velocity", "wheel[1].angular_velocity"]
MOTION += ["body.position", "body.velocity", "body.angular_velocity"]
OUTPUTS = [*(f"{vector}.{axis}" for vector in MOTION for axis in "xyz"), "roll", "pitch", "yaw"]


def rotation(q):
    """Return R_IB of the quaternion (w, x, y, z)."""
    w, x, y, z = q
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


class RobotTest(Fmi2Slave):
    """A rigid body with one wheel."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = dict.fromkeys([*START, *LOADS, *OUTPUTS], 0.0)
        for name in self.values:
            kind = "parameter" if name in START else "input" if name in LOADS else "output"
            variability = Fmi2Variability.fixed if kind == "parameter" else Fmi2Variability.continuous
            variable = Real(name, causality=Fmi2Causality[kind], variability=variability)
            variable.start = None if kind == "output" else 0.0
            variable.getter = lambda name=name: self.values[name]
            variable.setter = lambda v, name=name: self.values.__setitem__(name, v)
            self.register_variable(variable, nested=False)

    def exit_initialization_mode(self):
        self.state = np.zeros(13)  # position of G, quaternion, velocity of G, angular velocity in I
        self.state[:3] = [self.values[name] for name in START] + TO_G
        self.state[3] = 1.0
        self._show()

    def _slope(self, state):
        q, velocity, omega = state[3:7], state[7:10], state[10:13]
        R = rotation(q)
        load = np.array([self.values[name] for name in LOADS])
        spin, torque = R.T @ omega, R.T @ (load[3:] + np.cross(R @ (TO_WHEEL - TO_G), load[:3]))
        angular = R @ np.linalg.solve(INERTIA, torque - np.cross(spin, INERTIA @ spin))
        turning = 0.5 * np.array([-omega @ q[1:], *(q[0] * omega + np.cross(omega, q[1:]))])
        return np.concatenate([velocity, turning, load[:3] / MASS - [0.0, 0.0, GRAVITY], angular])

    def do_step(self, current_time, step_size):
        n = int(np.ceil(step_size / LONGEST))
        h = step_size / n
        for _ in range(n):
            k1 = self._slope(self.state)
            k2 = self._slope(self.state + h / 2 * k1)
            k3 = self._slope(self.state + h / 2 * k2)
            k4 = self._slope(self.state + h * k3)
            self.state = self.state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            self.state[3:7] /= np.linalg.norm(self.state[3:7])
        self._show()
        return True

    def _show(self):
        center, R, velocity, omega = self.state[:3], rotation(self.state[3:7]), self.state[7:10], self.state[10:13]
        b, arm = center - R @ TO_G, R @ TO_WHEEL
        v_b = velocity - np.cross(omega, R @ TO_G)
        vectors = [b + arm, R[:, 0], v_b + np.cross(omega, arm), omega, b, v_b, omega]
        angles = np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]), np.arctan2(R[1, 0], R[0, 0])
        self.values.update(zip(OUTPUTS, np.concatenate([*vectors, angles]).tolist(), strict=True))

    def _get_fmu_state(self):
        return dict(self.values), self.state.copy()

    def _set_fmu_state(self, state):
        self.values, self.state = dict(state[0]), state[1].copy()

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)
