"""Test FMU whose names tell nothing, or something: what looks like a slope, differences of temperature, the times of steps.

`flow_rate` is in the unit of `flow`, so it is no slope; `heat_rate` (W) is that of `heat` (J) by its unit; `stroke_rate`,
without a unit, is declared to be that of `stroke`. What stood in each of them in the last step comes back as an output.
`ramp.*` are t, in the unit of the input that they feed. `behind` is the latest end of a step less the stop time.
With `only` above zero no other step is taken.
"""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

UNITS = {
    "flow": "m3/s", "flow_rate": "m3/s", "heat": "J", "heat_rate": "W", "stroke": "", "stroke_rate": "",
    "seen.flow_rate": "m3/s", "seen.heat_rate": "W", "seen.stroke_rate": "",
    "ramp.flow": "m3/s", "ramp.heat": "J", "ramp.stroke": "",
    "absolute_in": "degC", "difference_in": "degC", "unsaid_in": "degC", "absolute": "K", "difference": "K",
    "behind": "s", "end": "s", "only": "s",
}  # fmt: skip
INPUTS = [
    "flow",
    "flow_rate",
    "heat",
    "heat_rate",
    "stroke",
    "stroke_rate",
    "absolute_in",
    "difference_in",
    "unsaid_in",
]
START = {"flow_rate": 5.0, "absolute": 300.0, "difference": 10.0, "behind": -1e9}
RELATIVE = ["difference", "difference_in"]
BASE = {
    "m3/s": {"m": "3", "s": "-1"},
    "J": {"kg": "1", "m": "2", "s": "-2"},
    "W": {"kg": "1", "m": "2", "s": "-3"},
    "K": {"K": "1"},
    "degC": {"K": "1", "offset": "273.15"},
    "s": {"s": "1"},
}


class PlantTest(Fmi2Slave):
    """Slopes by name, by unit and by declaration."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = {name: START.get(name, 0.0) for name in UNITS}
        self.stop = None
        for name in UNITS:
            kind = "parameter" if name == "only" else "input" if name in INPUTS else "output"
            variability = Fmi2Variability.fixed if kind == "parameter" else Fmi2Variability.continuous
            variable = Real(name, causality=Fmi2Causality[kind], variability=variability)
            variable.getter = lambda name=name: self.values[name]
            variable.setter = lambda v, name=name: self.values.__setitem__(name, v)
            if kind != "output":
                variable.start = self.values[name]
            self.register_variable(variable, nested=False)

    def to_xml(self, model_options=None):
        from xml.etree.ElementTree import Element, SubElement

        root = super().to_xml(model_options or {})
        units = Element("UnitDefinitions")
        for name, exponents in BASE.items():
            SubElement(SubElement(units, "Unit", name=name), "BaseUnit", exponents)
        root.insert(1, units)
        names = list(UNITS)
        for variable in root.find("ModelVariables"):
            name, real = variable.get("name"), variable.find("Real")
            if UNITS[name]:
                real.set("unit", UNITS[name])
            if name in RELATIVE:
                real.set("relativeQuantity", "true")
            if name == "stroke_rate":
                real.set("derivative", str(names.index("stroke") + 1))
        for unknown in root.find("ModelStructure/Outputs"):
            unknown.set("dependencies", "")
        return root

    def setup_experiment(self, start_time, stop_time, tolerance):
        self.stop = stop_time

    def do_step(self, current_time, step_size):
        end, only = current_time + step_size, self.values["only"]
        if only and abs(step_size - only) > 1e-9:
            self.log(f"this controller is sampled at {only:g} s", Fmi2Status.discard)
            return False
        for name in ("flow_rate", "heat_rate", "stroke_rate"):
            self.values[f"seen.{name}"] = self.values[name]
        for name in ("flow", "heat", "stroke"):
            self.values[f"ramp.{name}"] = end
        self.values["end"] = end
        if self.stop is not None:
            self.values["behind"] = max(self.values["behind"], end - self.stop)
        return True

    def _get_fmu_state(self):
        return dict(self.values)

    def _set_fmu_state(self, state):
        behind = self.values["behind"]  # of the steps that are taken back too
        self.values = dict(state) | {"behind": behind}
