"""TITLE: a rigid robot for landings on a line, as an FMU (FMI 2.0, co-simulation, pythonfmu).

State: position of the centre of mass G, attitude (a quaternion w, x, y, z), velocity of G, angular velocity; all inertial.
Loads within a macro step [t, t + H] are `load + load_rate (tau - t - H/2)`. Beside the state, four integrals a wheel are
carried along, of its position, axle, angular velocity, and of the angle turned: what means and rotations are made of.
"""

import pickle
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

LONGEST = 1e-3  # s, longest inner step
AXLE = np.array([1.0, 0.0, 0.0])  # of all wheels, in the body's frame B
MOUNTS = [MOUNTS_PYTHON]  # wheels' centres from b, the centre of the rotor plane, in B, m


def vector(name):
    """Return the three components of a vector by name."""
    return [f"{name}.{axis}" for axis in "xyz"]


WHEELS = [f"wheel[{k}]" for k in range(1, len(MOUNTS) + 1)]
PARAMETERS = {
    "mass": 38.0,
    "inertia.xx": 5.42,  # about G
    "inertia.yy": 5.42,
    "inertia.zz": 8.5,
    "inertia.xy": 0.0,
    "inertia.xz": 0.0,
    "inertia.yz": 0.0,
    "gravity": 9.8,
    **dict(zip(vector("center_of_mass"), [0.0, 0.0, -0.1])),  # from b, in B
    **dict.fromkeys([*vector("initial.position"), *vector("initial.velocity")], 0.0),  # of b
    **dict.fromkeys(["initial.roll", "initial.pitch", "initial.yaw"], 0.0),
}
for wheel, mount in zip(WHEELS, MOUNTS):
    PARAMETERS.update(zip(vector(f"{wheel}.mount"), mount))
LOADS = ["thrust", *vector("torque")]  # thrust at b along z_B, torque in B
for wheel in WHEELS:
    LOADS += [*vector(f"{wheel}.force"), *vector(f"{wheel}.moment")]  # inertial, at the wheel's centre
OUTPUTS = [*vector("body.position"), *vector("body.velocity"), *vector("body.angular_velocity"), "roll", "pitch", "yaw"]
OUTPUTS += ["kinetic_energy", "gravitational_energy"]
for wheel in WHEELS:
    for motion in ("position", "axle", "velocity", "angular_velocity"):
        OUTPUTS += vector(f"{wheel}.{motion}")
    for of_step in ("position_mean", "axle_mean", "rotation", "rotation_mean"):
        OUTPUTS += vector(f"{wheel}.{of_step}")


def rate_name(load):
    """Return the name of a load's slope: `force_rate.x` of `force.x`."""
    stem, dot, axis = load.rpartition(".")
    return f"{stem}_rate.{axis}" if dot else f"{axis}_rate"


RATES = [rate_name(load) for load in LOADS]


UNITS = {
    "mass": "kg",
    "inertia": "kg.m2",
    "gravity": "m/s2",
    "force": "N",
    "thrust": "N",
    "moment": "N.m",
    "torque": "N.m",
    "force_rate": "N/s",
    "thrust_rate": "N/s",
    "moment_rate": "N.m/s",
    "torque_rate": "N.m/s",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
    "rotation": "rad",
    "rotation_mean": "rad",
    "axle": "1",
    "axle_mean": "1",
    "kinetic_energy": "J",
    "gravitational_energy": "J",
}
BASE = {
    "kg": "kg",
    "kg.m2": "kg m2",
    "m/s2": "m s-2",
    "N": "kg m s-2",
    "N.m": "kg m2 s-2",
    "N/s": "kg m s-3",
    "N.m/s": "kg m2 s-3",
    "m/s": "m s-1",
    "rad/s": "rad s-1",
    "rad": "rad",
    "1": "",
    "J": "kg m2 s-2",
    "m": "m",
}


def unit(name):
    """Return the unit of a variable: that of its last part, m for what is not named."""
    parts = [
        part
        for part in name.split(".")
        if part not in ("x", "y", "z") and part not in ("xx", "yy", "zz", "xy", "xz", "yz")
    ]
    return UNITS.get(parts[-1], "m")


def rotation(q):
    """Return R_IB (3, 3) of a quaternion."""
    w, x, y, z = q / np.linalg.norm(q)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def quaternion(roll, pitch, yaw):
    """Return the quaternion of Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll / 2, pitch / 2, yaw / 2]), np.sin([roll / 2, pitch / 2, yaw / 2])
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


class CLASS(Fmi2Slave):
    """A rigid body with wheels that are fixed to it."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = {**PARAMETERS, **dict.fromkeys([*LOADS, *RATES, *OUTPUTS], 0.0)}
        self.state, self.running = np.zeros(13), False
        for name in self.values:
            self._register(name)

    def _register(self, name):
        kind = "parameter" if name in PARAMETERS else "output" if name in OUTPUTS else "input"
        variability = Fmi2Variability.fixed if kind == "parameter" else Fmi2Variability.continuous
        variable = Real(name, causality=Fmi2Causality[kind], variability=variability)
        variable.start = None if kind == "output" else self.values[name]
        variable.getter = lambda: self._get(name)
        variable.setter = lambda value: self.values.__setitem__(name, value)
        self.register_variable(variable, nested=False)

    def _get(self, name):
        if not self.running and name in OUTPUTS:  # before the start they follow the parameters
            self._start()
        return self.values[name]

    def to_xml(self, model_options={}):
        """Return the description; pythonfmu leaves out units and which variables are known after the start."""
        root = super().to_xml(model_options)
        definitions = Element("UnitDefinitions")
        for name, base in BASE.items():
            exponents = {
                "".join(filter(str.isalpha, b)): b.strip("abcdefghijklmnopqrstuvwxyz") or "1" for b in base.split()
            }
            SubElement(SubElement(definitions, "Unit", name=name), "BaseUnit", exponents)
        root.insert(1, definitions)
        for variable in root.find("ModelVariables"):
            variable.find("Real").set("unit", unit(variable.get("name")))
        parameters = [str(i) for i, name in enumerate(self.values, start=1) if name in PARAMETERS]
        initial = SubElement(root.find("ModelStructure"), "InitialUnknowns")
        for output in root.find("ModelStructure/Outputs"):
            output.set("dependencies", "")  # nothing acts without a step
            SubElement(initial, "Unknown", index=output.get("index"), dependencies=" ".join(parameters))
        return root

    def _array(self, names):
        return np.array([self.values[name] for name in names])

    # -- start ------------------------------------------------------------------------------------------------

    def exit_initialization_mode(self):
        self._start()
        self.running = True

    def _start(self):
        xx, yy, zz, xy, xz, yz = self._array([f"inertia.{i}" for i in ("xx", "yy", "zz", "xy", "xz", "yz")])
        self.mass, self.gravity = self.values["mass"], np.array([0.0, 0.0, -self.values["gravity"]])
        self.inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        self.to_b = -self._array(vector("center_of_mass"))
        self.arms = np.array([self._array(vector(f"{wheel}.mount")) + self.to_b for wheel in WHEELS])
        q = quaternion(*self._array(["initial.roll", "initial.pitch", "initial.yaw"]))
        center = self._array(vector("initial.position")) - rotation(q) @ self.to_b
        self.state = np.concatenate([center, q, self._array(vector("initial.velocity")), np.zeros(3)])
        self._show()
        for wheel in WHEELS:  # before the first step, means are the values
            for motion in ("position", "axle"):
                self.values.update(zip(vector(f"{wheel}.{motion}_mean"), self._array(vector(f"{wheel}.{motion}"))))

    # -- a step -----------------------------------------------------------------------------------------------

    def do_step(self, current_time, step_size):
        n = int(np.ceil(step_size / LONGEST * (1.0 - 1e-9)))
        h = step_size / n
        y = np.concatenate([self.state, np.zeros(12 * len(WHEELS))])
        for i in range(n):
            since_middle = i * h - step_size / 2
            k1 = self._slope(y, since_middle)
            k2 = self._slope(y + h / 2 * k1, since_middle + h / 2)
            k3 = self._slope(y + h / 2 * k2, since_middle + h / 2)
            k4 = self._slope(y + h * k3, since_middle + h)
            y = y + h / 6 * (k1 + 2 * (k2 + k3) + k4)
            y[3:7] /= np.linalg.norm(y[3:7])
        if not np.all(np.isfinite(y)):
            return False  # a discard: the master may try a shorter step
        self.state = y[:13]
        self._show()
        for wheel, integrals in zip(WHEELS, y[13:].reshape(-1, 4, 3)):
            position, axle, turned, turned_mean = integrals
            self.values.update(zip(vector(f"{wheel}.position_mean"), position / step_size))
            self.values.update(zip(vector(f"{wheel}.axle_mean"), axle / step_size))
            self.values.update(zip(vector(f"{wheel}.rotation"), turned))
            self.values.update(zip(vector(f"{wheel}.rotation_mean"), turned_mean / step_size))
        return True

    def _slope(self, y, since_middle):
        """Return the time derivative of state and integrals."""
        q, velocity, omega = y[3:7], y[7:10], y[10:13]
        R = rotation(q)
        loads = self._array(LOADS) + self._array(RATES) * since_middle
        thrust, torque, wrenches = R @ [0.0, 0.0, loads[0]], R @ loads[1:4], loads[4:].reshape(-1, 2, 3)
        arms = self.arms @ R.T
        force = thrust + wrenches[:, 0].sum(axis=0)
        moment = np.cross(R @ self.to_b, thrust) + torque
        moment = moment + np.cross(arms, wrenches[:, 0]).sum(axis=0) + wrenches[:, 1].sum(axis=0)
        spin = R.T @ omega
        turning = R @ np.linalg.solve(self.inertia, R.T @ moment - np.cross(spin, self.inertia @ spin))
        attitude = 0.5 * np.array([-omega @ q[1:], *(q[0] * omega + np.cross(omega, q[1:]))])
        integrals = np.empty((len(WHEELS), 4, 3))
        integrals[:, 0], integrals[:, 1], integrals[:, 2] = y[:3] + arms, R @ AXLE, omega
        integrals[:, 3] = y[13:].reshape(-1, 4, 3)[:, 2]
        return np.concatenate([velocity, attitude, force / self.mass + self.gravity, turning, integrals.ravel()])

    def _show(self):
        """Write the outputs from the state."""
        center, R, velocity, omega = self.state[:3], rotation(self.state[3:7]), self.state[7:10], self.state[10:13]
        spin = R.T @ omega
        shown = {
            "roll": np.arctan2(R[2, 1], R[2, 2]),
            "pitch": -np.arcsin(np.clip(R[2, 0], -1.0, 1.0)),
            "yaw": np.arctan2(R[1, 0], R[0, 0]),
            "kinetic_energy": 0.5 * self.mass * velocity @ velocity + 0.5 * spin @ self.inertia @ spin,
            "gravitational_energy": -self.mass * self.gravity @ center,
        }
        for place, arm in zip(["body", *WHEELS], [self.to_b, *self.arms]):
            shown.update(zip(vector(f"{place}.position"), center + R @ arm))
            shown.update(zip(vector(f"{place}.velocity"), velocity + np.cross(omega, R @ arm)))
            shown.update(zip(vector(f"{place}.angular_velocity"), omega))
        for wheel in WHEELS:
            shown.update(zip(vector(f"{wheel}.axle"), R @ AXLE))
        self.values.update((name, float(value)) for name, value in shown.items())

    # -- the complete state, for masters that go back ---------------------------------------------------------

    def _get_fmu_state(self):
        return dict(self.values), self.state.copy()

    def _set_fmu_state(self, state):
        self.values, self.state = dict(state[0]), state[1].copy()

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(data):
        return pickle.loads(data)
