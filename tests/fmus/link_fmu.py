"""Test FMU: a mass on a spring to ground, coupled by another spring to its left neighbour; exact inside a
step.

m x'' = -k0 x - c0 x' - f + F, with f = k (x - x_left) + c (x' - v_left) the force on the left neighbour and
F = force + force_rate (tau - t - h/2). `left.position` and `left.velocity` are held during a step.
"""

import pickle

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from scipy.linalg import expm

PARAMETERS = [
    "mass",
    "ground_stiffness",
    "ground_damping",
    "stiffness",
    "damping",
    "initial_position",
    "initial_velocity",
]
INPUTS = ["left.position", "left.velocity", "force", "force_rate"]
OUTPUTS = ["position", "velocity", "position_mean", "left.force"]
NAMES = PARAMETERS + INPUTS + OUTPUTS
UNITS = ["kg", "N/m", "N.s/m", "N/m", "N.s/m", "m", "m/s", "m", "m/s", "N", "N/s", "m", "m/s", "m", "N"]
BASE = {"kg": {"kg": 1}, "N/m": {"kg": 1, "s": -2}, "N.s/m": {"kg": 1, "s": -1}, "m": {"m": 1}}
BASE |= {"m/s": {"m": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2}, "N/s": {"kg": 1, "m": 1, "s": -3}}


class LinkTest(Fmi2Slave):
    """One link of a chain of masses."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = [1.0] + [0.0] * (len(NAMES) - 1)
        self.cache = {}
        for i, name in enumerate(NAMES):
            kind = "parameter" if name in PARAMETERS else "input" if name in INPUTS else "output"
            variability = Fmi2Variability.fixed if kind == "parameter" else Fmi2Variability.continuous
            start = None if kind == "output" else self.values[i]
            variable = Real(name, causality=Fmi2Causality[kind], variability=variability, start=start)
            variable.getter = lambda i=i: self.values[i]
            variable.setter = lambda v, i=i: self.values.__setitem__(i, v)
            self.register_variable(variable, nested=False)

    def to_xml(self, model_options=None):
        from xml.etree.ElementTree import Element, SubElement

        root = super().to_xml(model_options or {})
        units = Element("UnitDefinitions")
        for name, exponents in BASE.items():
            SubElement(
                SubElement(units, "Unit", name=name), "BaseUnit", {k: str(v) for k, v in exponents.items()}
            )
        root.insert(1, units)
        for variable, unit in zip(root.find("ModelVariables"), UNITS, strict=True):
            variable.find("Real").set("unit", unit)
        for unknown in root.find("ModelStructure/Outputs"):
            name = NAMES[int(unknown.get("index")) - 1]
            depends = ["left.position", "left.velocity"] if name == "left.force" else []
            unknown.set("dependencies", " ".join(str(NAMES.index(n) + 1) for n in depends))
        return root

    def get_real(self, vrs):
        if NAMES.index("left.force") in vrs:
            self._reaction()
        return [self.values[i] for i in vrs]

    def set_real(self, vrs, values):
        for i, value in zip(vrs, values, strict=True):
            self.values[i] = value

    def _reaction(self):
        _, _, _, k, c, _, _, xl, vl, _, _, x, v, _, _ = self.values
        self.values[14] = k * (x - xl) + c * (v - vl)

    def exit_initialization_mode(self):
        pass

    def enter_initialization_mode(self):
        self.values[11], self.values[12] = self.values[5], self.values[6]
        self.values[13] = self.values[11]

    def _matrix(self, h):
        """exp(h A) for the state (integral of x, x, v, F, dF/dt, 1), which holds the inputs too."""
        m, k0, c0, k, c = self.values[:5]
        key = (h, m, k0, c0, k, c)
        if key not in self.cache:
            A = np.zeros((6, 6))
            A[0, 1] = A[1, 2] = A[3, 4] = 1.0
            A[2, 1], A[2, 2], A[2, 3], A[2, 5] = -(k0 + k) / m, -(c0 + c) / m, 1.0 / m, 1.0 / m
            self.cache[key] = expm(h * A)
        return self.cache[key]

    def do_step(self, current_time, step_size):
        h, v = step_size, self.values
        pull = v[3] * v[7] + v[4] * v[8]
        start = np.array([0.0, v[11], v[12], v[9] - v[10] * h / 2, v[10], pull])
        end = self._matrix(h) @ start
        v[13], v[11], v[12] = end[0] / h, end[1], end[2]
        return True

    def _get_fmu_state(self):
        return list(self.values)

    def _set_fmu_state(self, state):
        self.values = list(state)

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)
