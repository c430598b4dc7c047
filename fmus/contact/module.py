"""The contact module: its variable table, its parameters checked, and its steps."""

from __future__ import annotations

import math

import numpy as np

from fmus.contact import exchange
from fmus.contact import places as at
from fmus.contact.law import NO_AXLE, NO_TANGENT, NOT_FINITE, OPEN, law_parameters
from fmus.contact.path import PATH_SHAPE
from fmus.contact.sampling import gauss_rule
from fmus.module.variables import (
    NON_NEGATIVE,
    POSITIVE,
    Bounds,
    ModuleError,
    Variable,
    VariableTable,
    check_bounds,
    parameter,
    vector,
)

SAMPLES = 8
"""Gauss points of a macro step, in time (see README)."""


def _parameters() -> list[Variable]:
    touch = Bounds(ge=1.0, hint="a smaller one makes the wall infinitely stiff at touch")
    angle = Bounds(gt=0.0, lt=math.pi, hint="is it given in degrees?")

    return [
        parameter(
            "stiffness",
            "N/m^n",
            1e8,
            "stiffness k of one groove wall, force = k * penetration^n; n = exponent",
            POSITIVE,
        ),
        parameter("exponent", "1", 2.5, "exponent n of the penetration", touch),
        parameter("damping", "s/m", 1.0, "Hunt-Crossley damping D, factor 1 + D * penetration rate", NON_NEGATIVE),
        parameter(
            "friction_coefficient",
            "1",
            0.7,
            "Coulomb friction coefficient on the sum of both walls' forces",
            NON_NEGATIVE,
        ),
        parameter("wheel_radius", "m", 0.075, "radius of the wheel's rim", POSITIVE),
        parameter("groove_angle", "rad", 1.7453292519943295, "full opening angle of the groove", angle),
        parameter("groove_width", "m", 0.08, "width of the groove at the rim", POSITIVE),
        parameter("cable_diameter", "m", 0.018, "diameter of the cable", POSITIVE),
        parameter(
            "max_contact_length", "m", 0.06, "longest contact length l0; stiffness / l0 acts per unit length", POSITIVE
        ),
        parameter("tangential_stiffness", "N/m", 1e6, "stiffness of the friction bristle before it slides", POSITIVE),
        parameter(
            "tangential_damping",
            "N.s/m",
            1e3,
            "damping of the friction bristle before it slides",
            NON_NEGATIVE,
        ),
        parameter(
            "initial.s",
            "m",
            0.0,
            "arc length of the contact point on the unstretched cable at the start",
        ),
        Variable(
            "exchange",
            "parameter",
            "1",
            "waveform",
            "what the step assumes of the motion inside it",
            kind="string",
            choices=("point", "waveform", "hermite"),
        ),
    ]


def _inputs() -> list[Variable]:
    def rows(name: str, unit: str, text: str, start: tuple[float, float, float] = (0.0, 0.0, 0.0)):
        return vector(name, "input", unit, text, start)

    along, above, across = (0.0, 1.0, 0.0), (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)
    return [
        *rows("cable.position", "m", "cable point at cable.s"),
        *rows("cable.tangent", "1", "cable tangent dr/ds", along),
        *rows("cable.velocity", "m/s", "velocity of the cable point"),
        *rows("cable.tangent_rate", "1/s", "rate of the cable tangent"),
        *rows("wheel.position", "m", "wheel centre", above),
        *rows("wheel.axle", "1", "unit vector of the axle", across),
        *rows("wheel.velocity", "m/s", "velocity of the wheel centre"),
        *rows("wheel.angular_velocity", "rad/s", "angular velocity of the wheel"),
        *rows("cable.position_mean", "m", "time mean of the cable point over the macro step"),
        *rows("cable.tangent_mean", "1", "time mean of the tangent over the macro step", along),
        *rows("wheel.position_mean", "m", "time mean of the wheel centre over the macro step", above),
        *rows("wheel.axle_mean", "1", "time mean of the axle over the macro step", across),
        *rows("wheel.rotation", "rad", "integral of the wheel's angular velocity over the macro step"),
        *rows("wheel.rotation_mean", "rad", "time mean of that running integral"),
        *rows("cable.curvature", "1/m", "d²r/ds² of the cable at cable.s; zero: it counts as straight"),
    ]


def _outputs(motion: tuple[str, ...]) -> list[Variable]:
    def wrench(body: str, about: str) -> list[Variable]:
        return [
            *vector(f"{body}.force", "output", "N", f"mean force on the {body}", feedthrough=motion),
            *vector(
                f"{body}.moment",
                "output",
                "N.m",
                f"mean moment on the {body} about {about}",
                feedthrough=motion,
            ),
            *vector(f"{body}.force_rate", "output", "N/s", f"slope of the force on the {body}"),
            *vector(f"{body}.moment_rate", "output", "N.m/s", f"slope of the moment on the {body}"),
        ]

    def real(name: str, unit: str, description: str, feedthrough: tuple[str, ...] = motion) -> Variable:
        return Variable(name, "output", unit, 0.0, description, feedthrough=feedthrough)

    return [
        *wrench("cable", "cable.position"),
        *wrench("wheel", "wheel.position"),
        Variable("cable.s", "output", "m", 0.0, "arc length of the contact point", discrete=True),
        real("normal_force", "N", "sum of the forces of both groove walls"),
        real("friction_force", "N", "magnitude of the friction force"),
        real("penetration", "m", "deepest penetration; negative: the gap"),
        real("slip_velocity", "m/s", "speed of the cable point relative to the wheel"),
        real("contact_length", "m", "length of the cable that touches the groove"),
        Variable(
            "status",
            "output",
            "1",
            OPEN,
            "0 open, 1 stick, 2 slip, 3 left the groove",
            kind="integer",
            feedthrough=motion,
        ),
        real("dissipated_energy", "J", "energy dissipated by walls and friction", ()),
        real("strain_energy", "J", "elastic energy of walls and friction bristle"),
        real("work_cable", "J", "work done on the cable, booked from what is exchanged", ()),
        real("work_wheel", "J", "work done on the wheel, booked from what is exchanged", ()),
    ]


def _table() -> VariableTable:
    inputs = _inputs()
    names = tuple(v.name for v in inputs)
    motion = names[: at.MOTION_SIZE]
    for first in (at.ROTATION, at.CURVATURE):
        motion += names[first : first + 3]
    return VariableTable([*_parameters(), *inputs, *_outputs(motion)])


class Contact:
    """Contact of one grooved wheel with the cable; the equations stand in README.md of this folder."""

    NAME = "contact"
    TITLE = "Hunt-Crossley contact of a grooved wheel with a cable"
    table = _table()
    _INPUTS = slice(table.index["cable.position.x"], table.index["cable.curvature.z"] + 1)
    _OUTPUTS = slice(table.index["cable.force.x"], table.index["work_wheel"] + 1)

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(at.STATE_SIZE)

    def initialize(self, t: float) -> None:
        """Take over parameters and inputs; the bristle is relaxed, the outputs are the law's now."""
        self.check_parameters()
        self._prm = law_parameters(self.values, self.table)
        self._method = int(self._value("exchange"))
        self._nodes, self._weights, self._increments = gauss_rule(SAMPLES)
        self._path = np.zeros(PATH_SHAPE)
        self._motions = np.zeros((SAMPLES + 2, at.MOTION_SIZE))
        self._samples = np.zeros((SAMPLES + 1, at.OUT_SIZE))
        self.state = np.zeros(at.STATE_SIZE)
        inputs = self.values[self._INPUTS]
        self.state[at.LAST : at.LAST + at.MOTION_SIZE] = inputs[: at.MOTION_SIZE]
        self.state[at.LAST_CURVATURE : at.LAST_CURVATURE + 3] = inputs[at.CURVATURE : at.CURVATURE + 3]
        self.state[at.ARC] = self._value("initial.s")
        self.refresh()
        outputs = self.values[self._OUTPUTS]
        self.state[at.STORED] = outputs[at.O_STRAIN]

    def refresh(self) -> None:
        """Write the outputs at the instant of the inputs, with the state as it is."""
        status = exchange.refresh(
            self._prm,
            self.values[self._INPUTS],
            self.state,
            self._motions,
            self._samples,
            self.values[self._OUTPUTS],
        )
        self._raise(status)

    def step(self, t: float, h: float) -> None:
        """Advance from t to t + h; the inputs hold the motion at t + h and the means over the step."""
        if not h > 0.0:
            raise ModuleError(f"contact at t = {t:g} s: macro step {h:g} s must be positive; choose one above zero")
        status = exchange.step(
            self._prm,
            self._method,
            self.values[self._INPUTS],
            h,
            self._nodes,
            self._weights,
            self._increments,
            self.state,
            self._path,
            self._motions,
            self._samples,
            self.values[self._OUTPUTS],
        )
        self._raise(status, f" at t = {t + h:g} s")

    def _value(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def check_parameters(self) -> None:
        """Raise `ModuleError` naming the first parameter that makes no sense."""
        check_bounds(self.table, self.values, "contact")
        depth = 0.5 * self._value("groove_width") / math.tan(0.5 * self._value("groove_angle"))
        if depth >= self._value("wheel_radius"):
            raise ModuleError(
                f"contact: wheel_radius = {self._value('wheel_radius'):g} m is not more than the"
                f" groove's depth, {depth:g} m; enlarge it, or take a narrower groove or a wider angle"
            )

    def _raise(self, status: int, when: str = "") -> None:
        if status == NO_TANGENT:
            raise ModuleError(f"contact{when}: cable.tangent has no length; connect it to the cable's port")
        if status == NO_AXLE:
            raise ModuleError(f"contact{when}: wheel.axle has no length; connect it to the robot's wheel")
        if status == NOT_FINITE:
            raise ModuleError(f"contact{when}: the motion of cable or wheel is not finite; take a smaller macro step")
