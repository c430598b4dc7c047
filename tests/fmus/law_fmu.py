"""Test FMU: a force between two points a and b over a macro step, by every exchange.

With d = a.position - b.position - gap the force k |d|^n sign(d) (1 + D d') + c d' acts on a along -1, on b along +1;
without `two_sided` it acts for d > 0 alone and never pulls. Beside it a bristle of stiffness `tangential` holds the two
points together with at most `limit`. `exchange`: 0 waveform, 1 hermite, 2 point (force at the end, rate 0).
`law_work` is the work of the law along the path it was sampled on, by the samples; `stored` what it can give back.
"""

import pickle

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

PARAMETERS = {"stiffness": 1.0, "exponent": 1.0, "damping": 0.0, "hunt_crossley": 0.0, "gap": 0.0, "two_sided": 1.0}
PARAMETERS |= {"tangential": 0.0, "limit": 0.0, "exchange": 0.0}
INPUTS = [f"{side}.{name}" for side in "ab" for name in ("position", "velocity", "position_mean")]
OUTPUTS = ["a.force", "a.force_rate", "b.force", "b.force_rate", "law_work", "stored"]
NAMES = [*PARAMETERS, *INPUTS, *OUTPUTS]
K, N, C, D, GAP, TWO_SIDED, TANGENTIAL, LIMIT, EXCHANGE = range(9)
XA, VA, MA, XB, VB, MB, FA, RA, FB, RB, WORK, STORED = range(9, 21)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
SIGMA, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


class LawTest(Fmi2Slave):
    """Spring, damper, wall and friction between two points."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = [*PARAMETERS.values(), *[0.0] * (len(INPUTS) + len(OUTPUTS))]
        self.start = (0.0, 0.0, 0.0)  # distance, its rate, elongation of the bristle
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
        motion = " ".join(str(i + 1) for i in (XA, VA, XB, VB))
        for unknown in root.find("ModelStructure/Outputs"):
            place = int(unknown.get("index")) - 1
            unknown.set("dependencies", motion if place in (FA, FB) else "")
        return root

    def get_real(self, vrs):
        return [self.values[i] for i in vrs]

    def set_real(self, vrs, values):
        for i, value in zip(vrs, values, strict=True):
            self.values[i] = value

    def _now(self):
        v = self.values
        return v[XA] - v[XB] - v[GAP], v[VA] - v[VB], v[MA] - v[MB] - v[GAP]

    def _law(self, d, rate):
        v = self.values
        if v[TWO_SIDED]:
            return v[K] * np.sign(d) * np.abs(d) ** v[N] * (1 + v[D] * rate) + v[C] * rate
        return v[K] * np.maximum(d, 0.0) ** v[N] * np.maximum(1 + v[D] * rate, 0.0)

    def _friction(self, distances):
        """Return the bristle's force at each of the distances in turn, and its elongation in the end."""
        v, z, last = self.values, self.start[2], self.start[0]
        forces = np.zeros(len(distances))
        for i, d in enumerate(distances):
            reach = v[LIMIT] / v[TANGENTIAL] if v[TANGENTIAL] else 0.0
            z, last = min(max(z + d - last, -reach), reach), d
            forces[i] = v[TANGENTIAL] * z
        return forces, z

    def _write(self, force, rate):
        self.values[FA : RB + 1] = [-force, -rate, force, rate]

    def _store(self, d, z):
        v = self.values
        length = abs(d) if v[TWO_SIDED] else max(d, 0.0)
        v[STORED] = v[K] / (v[N] + 1) * length ** (v[N] + 1) + 0.5 * v[TANGENTIAL] * z**2

    def exit_initialization_mode(self):
        d, rate, _ = self._now()
        self.start = (d, rate, 0.0)
        self._write(float(self._law(np.array([d]), np.array([rate]))[0]), 0.0)
        self._store(d, 0.0)

    def _coefficients(self, h):
        d0, r0, _ = self.start
        d1, r1, mean = self._now()
        if self.values[EXCHANGE] == 1:
            a, e = h * r0, d1 - d0
            return d0, a, 3 * e - 2 * a - h * r1, a + h * r1 - 2 * e
        b = 6 * ((d0 + d1) / 2 - mean)
        return d0, d1 - d0 - b, b, 0.0

    def do_step(self, current_time, step_size):
        h, v = step_size, self.values
        end, rate, _ = self._now()
        if v[EXCHANGE] == 2:
            friction, z = self._friction([end])
            force = float(self._law(np.array([end]), np.array([rate]))[0] + friction[0])
            self._write(force, 0.0)
            v[WORK] += force * (end - self.start[0])
        else:
            c0, c1, c2, c3 = self._coefficients(h)
            d = c0 + SIGMA * (c1 + SIGMA * (c2 + SIGMA * c3))
            speed = (c1 + SIGMA * (2 * c2 + SIGMA * 3 * c3)) / h
            friction, z = self._friction([*d, end])
            f = self._law(d, speed) + friction[:-1]
            self._write(float(WEIGHTS @ f), float(12 / h * (WEIGHTS * f) @ (SIGMA - 0.5)))
            v[WORK] += h * float((WEIGHTS * f) @ speed)
        self.start = (end, rate, z)
        self._store(end, z)
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
