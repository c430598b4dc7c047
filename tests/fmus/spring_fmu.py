"""Test FMU: a spring between two points a and b, with the energy-conjugate exchange.

f = stiffness d^exponent (1 + damping d') on a along -1, on b along +1, with d = a.position - b.position -
gap; without `two_sided` it acts for d > 0 alone and never pulls. The motion inside a step is the quadratic
through start, end and mean; out come mean and slope of the force.
"""

import pickle

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

PARAMETERS = {"stiffness": 1.0, "exponent": 1.0, "damping": 0.0, "gap": 0.0, "two_sided": 1.0}
INPUTS = ["a.position", "a.position_mean", "b.position", "b.position_mean"]
OUTPUTS = ["a.force", "a.force_rate", "b.force", "b.force_rate"]
NAMES = [*PARAMETERS, *INPUTS, *OUTPUTS]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
SIGMA, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


class SpringTest(Fmi2Slave):
    """Spring, linear or Hunt-Crossley."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = [*PARAMETERS.values(), *[0.0] * (len(INPUTS) + len(OUTPUTS))]
        self.start = 0.0
        self.stepped = False
        for i, name in enumerate(NAMES):
            kind = "parameter" if name in PARAMETERS else "input" if name in INPUTS else "output"
            variability = Fmi2Variability.fixed if kind == "parameter" else Fmi2Variability.continuous
            start = None if kind == "output" else self.values[i]
            variable = Real(name, causality=Fmi2Causality[kind], variability=variability, start=start)
            variable.getter = lambda i=i: self.values[i]
            variable.setter = lambda v, i=i: self.values.__setitem__(i, v)
            self.register_variable(variable, nested=False)

    def to_xml(self, model_options=None):
        root = super().to_xml(model_options or {})
        positions = f"{NAMES.index('a.position') + 1} {NAMES.index('b.position') + 1}"
        for unknown in root.find("ModelStructure/Outputs"):
            name = NAMES[int(unknown.get("index")) - 1]
            unknown.set("dependencies", "" if name.endswith("rate") else positions)
        return root

    def get_real(self, vrs):
        return [self.values[i] for i in vrs]

    def set_real(self, vrs, values):
        for i, value in zip(vrs, values, strict=True):
            self.values[i] = value

    def _distance(self):
        return self.values[5] - self.values[7] - self.values[3]

    def _law(self, d, rate):
        k, n, c, _, two_sided = self.values[:5]
        if two_sided:
            return k * np.sign(d) * np.abs(d) ** n + c * rate
        return k * np.maximum(d, 0.0) ** n * np.maximum(1.0 + c * rate, 0.0)

    def exit_initialization_mode(self):
        self.start = self._distance()
        self._write(float(self._law(np.array([self.start]), np.zeros(1))[0]), 0.0)

    def _write(self, force, rate):
        self.values[9:13] = [-force, -rate, force, rate]

    def do_step(self, current_time, step_size):
        end, mean = self._distance(), self.values[6] - self.values[8] - self.values[3]
        b = 6 * ((self.start + end) / 2 - mean)
        a = end - self.start - b
        f = self._law(self.start + a * SIGMA + b * SIGMA**2, (a + 2 * b * SIGMA) / step_size)
        self._write(float(WEIGHTS @ f), float(12 / step_size * (WEIGHTS * f) @ (SIGMA - 0.5)))
        self.start = end
        return True

    def _get_fmu_state(self):
        return (list(self.values), self.start)

    def _set_fmu_state(self, state):
        self.values, self.start = list(state[0]), state[1]

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)
