"""The set-down controller: its variable table, its parameters checked, and its steps."""

from __future__ import annotations

import numpy as np

from fmus.controller import law
from fmus.module.variables import (
    NON_NEGATIVE,
    POSITIVE,
    Bounds,
    Kind,
    ModuleError,
    Variable,
    VariableTable,
    check_bounds,
    parameter,
    vector,
)

FASTEST = 0.5
"""Largest product of natural frequency and sample time: a sampled loop that is slower than that is near the continuous one."""
_SHARE = Bounds(ge=0.0, le=1.0)
_PARAMETERS = [
    parameter("mass", "kg", 38.0, "mass of the robot", POSITIVE),
    parameter("gravity", "m/s2", 9.8, "gravitational acceleration, along -Z", NON_NEGATIVE),
    parameter("inertia.xx", "kg.m2", 5.42, "moment of inertia about the centre of mass, x", POSITIVE),
    parameter("inertia.yy", "kg.m2", 5.42, "moment of inertia about the centre of mass, y", POSITIVE),
    parameter("inertia.zz", "kg.m2", 8.5, "moment of inertia about the centre of mass, z", POSITIVE),
    parameter("sample_time", "s", 0.02, "time between two sampling instants; commands are held between them", POSITIVE),
    parameter("descent_speed", "m/s", 0.3, "speed of the way down", NON_NEGATIVE),
    parameter("heave_frequency", "rad/s", 2.0, "natural frequency of the height's loop", NON_NEGATIVE),
    parameter("heave_damping_ratio", "1", 1.0, "damping ratio of the height's loop", NON_NEGATIVE),
    parameter("attitude_frequency", "rad/s", 5.0, "natural frequency of the loops of roll, pitch, yaw", NON_NEGATIVE),
    parameter("attitude_damping_ratio", "1", 0.7, "damping ratio of the loops of roll, pitch, yaw", NON_NEGATIVE),
    parameter("max_thrust", "N", 820.0, "largest thrust of all rotors", POSITIVE),
    parameter("rotor_arm", "m", 0.31, "mean lever of the rotors of one side about x_B and y_B", NON_NEGATIVE),
    parameter("yaw_arm", "m", 0.02, "drag torque of a rotor over its thrust, about z_B", NON_NEGATIVE),
    parameter("max_torque", "N.m", 127.0, "largest control torque about any axis", NON_NEGATIVE),
    parameter("touch_share", "1", 0.1, "share of the weight with which the wheels press at touch-down", _SHARE),
    parameter("touch_delay", "s", 0.04, "time for which they press before touch-down counts", NON_NEGATIVE),
    parameter("ramp_time", "s", 5.0, "time in which the thrust goes to its last value after touch-down", NON_NEGATIVE),
    parameter("final_share", "1", 0.0, "last thrust as a share of the weight", _SHARE),
    Variable(
        "torque_after_touch",
        "parameter",
        "1",
        True,
        "roll, pitch and yaw are compensated after touch-down too, as far as the thrust lets the rotors",
        kind="boolean",
    ),
]


def _inputs() -> list[Variable]:
    wheels = range(1, law.MAX_WHEELS + 1)
    return [
        *vector("body.position", "input", "m", "position of b"),
        *vector("body.velocity", "input", "m/s", "velocity of b"),
        Variable("roll", "input", "rad", 0.0, "angle about x"),
        Variable("pitch", "input", "rad", 0.0, "angle about y"),
        Variable("yaw", "input", "rad", 0.0, "angle about z"),
        *vector("body.angular_velocity", "input", "rad/s", "angular velocity of the body, inertial components"),
        *(Variable(f"contact[{k}].normal_force", "input", "N", 0.0, f"normal force of contact {k}") for k in wheels),
    ]


def _outputs(sampled: tuple[str, ...]) -> list[Variable]:
    def out(name: str, unit: str, text: str, kind: Kind = "real") -> Variable:
        return Variable(name, "output", unit, 0.0 if kind == "real" else 0, text, kind, (), True, sampled)

    return [
        out("thrust", "N", "thrust along z_B, held until the next sampling instant"),
        *(out(f"torque.{axis}", "N.m", f"control torque in B, held likewise, {axis}") for axis in "xyz"),
        out("phase", "1", "0 approach, 1 thrust ramps down, 2 down", "integer"),
        out("touch_time", "s", "time at which touch-down was found; -1 before"),
    ]


def _table() -> VariableTable:
    inputs = _inputs()
    return VariableTable([*_PARAMETERS, *inputs, *_outputs(tuple(v.name for v in inputs))])


class Setdown:
    """The set-down controller; the equations stand in README.md of this folder."""

    NAME = "setdown"
    TITLE = "controller that brings a robot down and sets it down"
    table = _table()
    _PRM = slice(0, law.N_PARAMETERS)
    _INPUTS = slice(table.index["body.position.x"], table.index["body.position.x"] + law.N_INPUTS)

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(law.N_STATE)
        self._prm = self.values[self._PRM].copy()
        self._q = np.zeros(4)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def initialize(self, t: float) -> None:
        """Check the parameters and sample for the first time; raises `ModuleError`."""
        self.check_parameters()
        self._prm[:] = self.values[self._PRM]
        self.state[:] = 0.0
        self.state[law.TIME] = t
        self.state[law.BEFORE + law.PRESSED_SINCE] = self.state[law.BEFORE + law.TOUCH_TIME] = law.NOT_YET
        self.refresh()

    def refresh(self) -> None:
        """Write the outputs from the state and, at a sampling instant, the inputs of now."""
        law.evaluate(self._prm, self.values[self._INPUTS], self.state, self._q)
        memory = self.state[law.NOW :]
        first = self.table.index["thrust"]
        self.values[first : first + 4] = memory[law.THRUST : law.THRUST + 4]
        self.values[first + 4] = law.phase(self._prm, self.state[law.TIME], memory)
        self.values[first + 5] = memory[law.TOUCH_TIME]

    def step(self, t: float, h: float) -> None:
        """Go on from `t` to `t + h`; a sampling instant within counts at its end."""
        if not h > 0.0:
            raise ModuleError(f"setdown at t = {t:g} s: macro step {h:g} s must be positive; choose one above zero")
        law.move(self.state, t + h)
        self.refresh()

    def check_parameters(self) -> None:
        """Raise `ModuleError` naming the first parameter that makes no sense."""
        check_bounds(self.table, self.values, self.NAME)
        weight = self["mass"] * self["gravity"]
        if weight > self["max_thrust"]:
            raise ModuleError(
                f"setdown: max_thrust = {self['max_thrust']:g} N is less than the weight, {weight:g} N: "
                "the robot cannot fly; raise it, or lower mass"
            )
        for loop in ("heave", "attitude"):
            frequency = self[f"{loop}_frequency"]
            if frequency * self["sample_time"] > FASTEST:
                raise ModuleError(
                    f"setdown: {loop}_frequency = {frequency:g} rad/s is too fast for sample_time = "
                    f"{self['sample_time']:g} s: their product must not exceed {FASTEST:g}, or the sampled loop is "
                    f"another than the continuous one; take at most {FASTEST / self['sample_time']:.3g} rad/s"
                )
