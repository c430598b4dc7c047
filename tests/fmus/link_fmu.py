"""Test FMU: a mass on a spring to ground, coupled by another spring to its left neighbour; exact inside a
step.

m x'' = -k0 x - c0 x' - f + F, with f = k (x - x_left) + c (x' - v_left) the force on the left neighbour and
F = force + force_rate (tau - t - h/2). Without WAVE `left.position` and `left.velocity` are held during
a step and `left.force` is f at its end; with WAVE the left neighbour moves on the quadratic through
the start, the end and the mean of its position, and `left.force`, `left.force_rate` are the mean and the
slope of f.
"""

import pickle

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from scipy.linalg import expm

WAVE = False  # the build makes a second FMU, WaveTest, by turning this to True
PARAMETERS = ["mass", "ground_stiffness", "ground_damping", "stiffness", "damping"]
PARAMETERS += ["initial_position", "initial_velocity"]
INPUTS = ["left.position", "left.velocity", "force", "force_rate"]
OUTPUTS = ["position", "velocity", "position_mean", "left.force"]
UNITS = ["kg", "N/m", "N.s/m", "N/m", "N.s/m", "m", "m/s", "m", "m/s", "N", "N/s", "m", "m/s", "m", "N"]
NAMES = PARAMETERS + INPUTS + OUTPUTS
_, K0, C0, K, C, X0, V0, XL, VL, F, FR, X, V, XM, LF = range(len(NAMES))
if WAVE:
    NAMES += ["left.position_mean", "left.force_rate"]
    UNITS += ["m", "N/s"]
    INPUTS.append("left.position_mean")
    OUTPUTS.append("left.force_rate")
XLM, LFR = 15, 16
BASE = {"kg": {"kg": 1}, "N/m": {"kg": 1, "s": -2}, "N.s/m": {"kg": 1, "s": -1}, "m": {"m": 1}}
BASE |= {
    "1": {},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/s": {"kg": 1, "m": 1, "s": -3},
}


class LinkTest(Fmi2Slave):
    """One link of a chain of masses."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = [1.0] + [0.0] * (len(NAMES) - 1)
        self.cache = {}
        self.left = 0.0
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
            SubElement(SubElement(units, "Unit", name=name), "BaseUnit", {k: str(v) for k, v in exponents.items()})
        root.insert(1, units)
        for variable, unit in zip(root.find("ModelVariables"), UNITS, strict=True):
            variable.find("Real").set("unit", unit)
        for unknown in root.find("ModelStructure/Outputs"):
            name = NAMES[int(unknown.get("index")) - 1]
            depends = ["left.position", "left.velocity"] if name == "left.force" else []
            unknown.set("dependencies", " ".join(str(NAMES.index(n) + 1) for n in depends))
        return root

    def get_real(self, vrs):
        if LF in vrs and not WAVE:
            self._reaction()
        return [self.values[i] for i in vrs]

    def set_real(self, vrs, values):
        for i, value in zip(vrs, values, strict=True):
            self.values[i] = value

    def _reaction(self):
        v = self.values
        v[LF] = v[K] * (v[X] - v[XL]) + v[C] * (v[V] - v[VL])

    def enter_initialization_mode(self):
        v = self.values
        v[X], v[V], v[XM] = v[X0], v[V0], v[X0]

    def exit_initialization_mode(self):
        self._reaction()
        self.left = self.values[XL]

    def _matrix(self, h):
        """exp(h A) for the state (iint f, int f, int x, x, v, F, dF/dt, left position and its two
        derivatives)."""
        m, k0, c0, k, c = self.values[:5]
        key = (h, m, k0, c0, k, c)
        if key not in self.cache:
            A = np.zeros((10, 10))
            A[0, 1] = A[2, 3] = A[3, 4] = A[5, 6] = A[7, 8] = A[8, 9] = 1.0
            A[1, [3, 4, 7, 8]] = k, c, -k, -c
            A[4] = -A[1] / m
            A[4, [3, 4]] -= k0 / m, c0 / m
            A[4, 5] = 1.0 / m
            self.cache[key] = expm(h * A)
        return self.cache[key]

    def do_step(self, current_time, step_size):
        h, v = step_size, self.values
        start = np.array([0.0, 0.0, 0.0, v[X], v[V], v[F] - v[FR] * h / 2, v[FR], *self._left_motion(h)])
        end = self._matrix(h) @ start
        v[XM], v[X], v[V] = end[2] / h, end[3], end[4]
        if WAVE:
            v[LF], v[LFR] = end[1] / h, 12 / h**3 * (h / 2 * end[1] - end[0])
            self.left = v[XL]
        return True

    def _left_motion(self, h):
        """Position, velocity and acceleration of the left neighbour at the start of the step."""
        v = self.values
        if not WAVE:
            return v[XL] + (v[C] / v[K] if v[K] else 0.0) * v[VL], 0.0, 0.0
        b = 6 * ((self.left + v[XL]) / 2 - v[XLM])
        a = v[XL] - self.left - b
        return self.left, a / h, 2 * b / h**2

    def _get_fmu_state(self):
        return (list(self.values), self.left)

    def _set_fmu_state(self, state):
        self.values, self.left = list(state[0]), state[1]

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)
