"""Test FMU with every type of variable, an algebraic output, and faults to order.

y = gain u + offset without a step; x' = u, exact for a held input. `fault` from `fault_time` on: 1 discards
steps longer than `longest_step`, 2 makes x not finite, 3 sleeps for a minute, 4 forgets x when a state is
restored, 5 logs a warning with %.
"""

import math
import pickle
import time

from pythonfmu import (
    Boolean,
    Fmi2Causality,
    Fmi2Slave,
    Fmi2Variability,
    Integer,
    Real,
    String,
)
from pythonfmu.enums import Fmi2Status

UNITS = {"u": "m", "y": "mm", "x": "m.s", "angle": "deg", "held_in": "m", "held_out": "m"}
BASE = {
    "m": {"m": "1"},
    "mm": {"m": "1", "factor": "0.001"},
    "m.s": {"m": "1", "s": "1"},
    "deg": {"rad": "1", "factor": str(math.pi / 180)},
    "N": {"kg": "1", "m": "1", "s": "-2"},
}
REALS = {"gain": 0.0, "offset": 0.0, "fault_time": 0.0, "longest_step": 1e-3, "initial": 0.0}


class OddTest(Fmi2Slave):
    """All types, all faults."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = {
            **REALS,
            "fault": 0,
            "u": 0.0,
            "held_in": 0.0,
            "count_in": 0,
            "flag_in": False,
            "note": "none",
            "heard": "",
        }
        self.values |= {"y": 0.0, "x": 0.0, "angle": 180.0, "held_out": 0.0, "count": 0, "flag": False}
        self._add(Real, REALS, "parameter")
        self._add(Integer, ["fault"], "parameter")
        self._add(String, ["note"], "parameter")
        self._add(Real, ["u"], "input")
        self._add(Real, ["held_in"], "input", "discrete")
        self._add(Integer, ["count_in"], "input")
        self._add(Boolean, ["flag_in"], "input")
        self._add(Real, ["y", "x", "angle"], "output")
        self._add(Real, ["held_out"], "output", "discrete")
        self._add(Integer, ["count"], "output")
        self._add(Boolean, ["flag"], "output")
        self._add(String, ["heard"], "input")
        self._add(String, ["said"], "output")

    def _add(self, kind, names, causality, variability=None):
        for name in names:
            default = "continuous" if kind is Real else "discrete"
            usual = "fixed" if causality == "parameter" else variability or default
            variable = kind(name, causality=Fmi2Causality[causality], variability=Fmi2Variability[usual])
            variable.getter = lambda name=name: self._get(name)
            variable.setter = lambda v, name=name: self.values.__setitem__(name, v)
            if causality != "output":
                variable.start = self.values[name]
            self.register_variable(variable, nested=False)

    def _get(self, name):
        v = self.values
        if name == "y":
            return 1000.0 * (v["gain"] * v["u"] + v["offset"])
        if name == "held_out":
            return v["x"]
        return v["note" if name == "said" else name]

    def to_xml(self, model_options=None):
        from xml.etree.ElementTree import Element, SubElement

        root = super().to_xml(model_options or {})
        units = Element("UnitDefinitions")
        for name, exponents in BASE.items():
            SubElement(SubElement(units, "Unit", name=name), "BaseUnit", exponents)
        root.insert(1, units)
        variables = list(root.find("ModelVariables"))
        names = [variable.get("name") for variable in variables]
        for variable in variables:
            if variable.get("name") in UNITS:
                variable.find("Real").set("unit", UNITS[variable.get("name")])
        for unknown in root.find("ModelStructure/Outputs"):
            own = names[int(unknown.get("index")) - 1] == "y"
            unknown.set("dependencies", str(names.index("u") + 1) if own else "")
        return root

    def exit_initialization_mode(self):
        self.values["x"] = self.values["initial"]

    def _fault(self, t):
        return self.values["fault"] if t >= self.values["fault_time"] - 1e-12 else 0

    def do_step(self, current_time, step_size):
        fault = self._fault(current_time)
        if fault == 1 and step_size > self.values["longest_step"] * (1 + 1e-9):
            self.log("the step is 100% too long", Fmi2Status.discard)
            return False
        if fault == 3:
            time.sleep(60.0)
        if fault == 5:
            self.log("all of 100%s%n", Fmi2Status.warning)
        self.values["x"] += step_size * self.values["u"]
        self.values["count"] += 1
        self.values["flag"] = not self.values["flag"]
        if fault == 2:
            self.values["x"] = math.nan
        return True

    def _get_fmu_state(self):
        return dict(self.values)

    def _set_fmu_state(self, state):
        self.values = dict(state)
        if self.values["fault"] == 4:
            self.values["x"] += 1e-3

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)
