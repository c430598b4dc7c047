"""The contact module: its variable table, its parameters checked, and its steps."""

from __future__ import annotations

import math

import numpy as np

from fmus.contact import exchange
from fmus.contact import places as at
from fmus.contact.law import NO_AXLE, NO_TANGENT, NOT_FINITE, OPEN, STEEP, TOO_FAR, law_parameters
from fmus.contact.path import PATH_SHAPE
from fmus.contact.sampling import gauss_rule
from fmus.contact.within import N_LOOKS, groove_depth
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


_TOUCH = Bounds(ge=1.0, hint="a smaller one makes the wall infinitely stiff at touch")
_ANGLE = Bounds(gt=0.0, lt=math.pi, hint="is it given in degrees?")
_PARAMETERS = [
    parameter(
        "stiffness",
        "N/m^n",
        1e8,
        "stiffness k of one groove wall, force = k * penetration^n; n = exponent",
        POSITIVE,
    ),
    parameter("exponent", "1", 2.5, "exponent n of the penetration", _TOUCH),
    Variable(
        "damping_law",
        "parameter",
        "1",
        "hunt_crossley",
        "what damps the walls: D times the elastic force, or the coefficient of ADAMS' IMPACT function",
        kind="string",
        choices=("hunt_crossley", "impact"),
    ),
    parameter(
        "damping",
        "s/m",
        1.0,
        "Hunt-Crossley damping D, factor 1 + D * penetration rate; of damping_law hunt_crossley alone",
        NON_NEGATIVE,
    ),
    parameter(
        "damping_coefficient",
        "N.s/m",
        1e4,
        "full damping of a wall that is pressed over reference_length; of damping_law impact alone",
        NON_NEGATIVE,
    ),
    parameter(
        "damping_depth",
        "m",
        0.01,
        "penetration at which damping_coefficient is full, reached by a cubic step; of damping_law impact alone",
        POSITIVE,
    ),
    parameter(
        "friction_coefficient",
        "1",
        0.7,
        "Coulomb friction coefficient on the sum of both walls' forces",
        NON_NEGATIVE,
    ),
    parameter("wheel_radius", "m", 0.075, "radius of the wheel's rim", POSITIVE),
    parameter("groove_angle", "rad", 1.7453292519943295, "full opening angle of the groove", _ANGLE),
    parameter("groove_width", "m", 0.08, "width of the groove at the rim", POSITIVE),
    parameter("cable_diameter", "m", 0.018, "diameter of the cable", POSITIVE),
    parameter(
        "reference_length", "m", 0.06, "length l0 that stiffness is of: stiffness / l0 acts per unit length", POSITIVE
    ),
    parameter("max_contact_length", "m", 1.0, "the cable touches no farther than this from the wheel's foot", POSITIVE),
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
    Variable(
        "moving_port",
        "parameter",
        "1",
        False,
        "the cable's port moves on by cable.s_rate within the step; else it stands at cable.s",
        kind="boolean",
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
        *rows("cable.tangent_rate_mean", "1/s", "time mean of cable.tangent_rate over the macro step, for moving_port"),
    ]


def _wrench(body: str, about: str, motion: tuple[str, ...]) -> list[Variable]:
    """Return force and moment on one body, and their slopes."""
    force, moment = f"mean force on the {body}", f"mean moment on the {body} about {about}"
    return [
        *vector(f"{body}.force", "output", "N", force, feedthrough=motion),
        *vector(f"{body}.moment", "output", "N.m", moment, feedthrough=motion),
        *vector(f"{body}.force_rate", "output", "N/s", f"slope of the force on the {body}"),
        *vector(f"{body}.moment_rate", "output", "N.m/s", f"slope of the moment on the {body}"),
    ]


def _outputs(motion: tuple[str, ...]) -> list[Variable]:
    def real(name: str, unit: str, description: str, feedthrough: tuple[str, ...] = motion) -> Variable:
        return Variable(name, "output", unit, 0.0, description, feedthrough=feedthrough)

    within = "within the last macro step (exchange point: along a cubic between its ends)"
    statuses = "0 open, 1 stick, 2 slip, 3 left the groove"
    return [
        *_wrench("cable", "cable.position", motion),
        *_wrench("wheel", "wheel.position", motion),
        Variable(
            "cable.s", "output", "m", 0.0, "arc length of the contact point, at the start of a step", discrete=True
        ),
        Variable("cable.s_rate", "output", "m/s", 0.0, "rate of cable.s within the step that begins", discrete=True),
        real("normal_force", "N", "sum of the forces of both groove walls, not their resultant"),
        real("friction_force", "N", "magnitude of the friction force"),
        real("penetration", "m", "deepest penetration; negative: the gap"),
        real("slip_velocity", "m/s", "speed of the cable point relative to the wheel"),
        real("contact_length", "m", "length of the cable that touches the groove"),
        Variable("status", "output", "1", OPEN, statuses, kind="integer", feedthrough=motion),
        real("dissipated_energy", "J", "energy dissipated by walls and friction", ()),
        real("strain_energy", "J", "elastic energy of walls and friction bristle"),
        real("work_cable", "J", "work done on the cable, booked from what is exchanged", ()),
        real("work_wheel", "J", "work done on the wheel, booked from what is exchanged", ()),
        real("radial_force", "N", "resultant of both walls on the wheel, from the cable towards the axle"),
        real("lateral_force", "N", "resultant of both walls on the wheel, along its axle"),
        real("normal_force_max", "N", f"largest normal force {within}"),
        real("penetration_max", "m", f"deepest penetration {within}"),
        real("slip_velocity_max", "m/s", f"largest slip velocity while cable and wheel touch, {within}", ()),
        real("impulse", "N.s", "time integral of the normal force over the last macro step", ()),
        real("touch_time", "s", "time of the first touch; -1 before", ()),
    ]


def _table() -> VariableTable:
    inputs = _inputs()
    names = tuple(v.name for v in inputs)
    motion = names[: at.MOTION_SIZE]
    for first in (at.ROTATION, at.CURVATURE):
        motion += names[first : first + 3]
    return VariableTable([*_PARAMETERS, *inputs, *_outputs(motion)])


class Contact:
    """Contact of one grooved wheel with the cable; the equations stand in README.md of this folder."""

    NAME = "contact"
    TITLE = "contact of a grooved wheel with a cable"
    table = _table()
    _INPUTS = slice(table.index["cable.position.x"], table.index["cable.tangent_rate_mean.z"] + 1)
    _OUTPUTS = slice(table.index["cable.force.x"], table.index["touch_time"] + 1)

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(at.STATE_SIZE)

    def initialize(self, t: float) -> None:
        """Take over parameters and inputs; the bristle is relaxed, the outputs are the law's now."""
        self.check_parameters()
        self._prm = law_parameters(self.values, self.table)
        self._method = int(self._value("exchange"))
        self._moves = bool(self._value("moving_port")) and self._method != exchange.POINT
        self._nodes, self._weights, self._increments = gauss_rule(SAMPLES)
        self._path = np.zeros((2, *PATH_SHAPE))
        self._motions = np.zeros((SAMPLES + 3, at.MOTION_SIZE))
        self._samples = np.zeros((SAMPLES + 2, at.OUT_SIZE))
        self._grid = np.zeros((SAMPLES + 5, N_LOOKS))
        self._way = np.zeros(1)
        self.state = np.zeros(at.STATE_SIZE)
        inputs = self.values[self._INPUTS]
        self.state[at.LAST : at.LAST + at.MOTION_SIZE] = inputs[: at.MOTION_SIZE]
        self.state[at.LAST_CURVATURE : at.LAST_CURVATURE + 3] = inputs[at.CURVATURE : at.CURVATURE + 3]
        self.state[at.ARC] = self._value("initial.s")
        self.state[at.DEEPEST_MAX] = -math.inf
        self.state[at.TOUCH_TIME] = at.NOT_YET
        self.state[at.SENT] = exchange.what_is_sent(self._prm, inputs, at.MOTION)
        outputs = self.values[self._OUTPUTS]
        exchange.follow(self._moves, self.state, outputs, self._motions[0])
        self.refresh()
        self.state[at.STORED] = outputs[at.O_STRAIN]
        self.state[at.NORMAL_MAX], self.state[at.DEEPEST_MAX] = outputs[at.O_NORMAL], outputs[at.O_DEEPEST]
        if outputs[at.O_NORMAL] > 0.0:
            self.state[at.SLIP_MAX], self.state[at.TOUCH_TIME] = outputs[at.O_SLIP], t
            exchange.write_memory(self.state, outputs)

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
            self._moves,
            self.values[self._INPUTS],
            t,
            h,
            self._nodes,
            self._weights,
            self._increments,
            self.state,
            self._path,
            self._motions,
            self._samples,
            self._grid,
            self._way,
            self.values[self._OUTPUTS],
        )
        if status == TOO_FAR:
            raise ModuleError(self._too_far(t, h))
        self._raise(status, f" at t = {t + h:g} s")

    def _too_far(self, t: float, h: float) -> str:
        depth = groove_depth(self._prm)
        return (
            f"contact at t = {t:g} s: wheel and cable meet and move by {self._way[0]:.3g} m relative to each other "
            f"within the step of {h:.3g} s, more than the groove is deep ({depth:.3g} m); take steps of at most "
            f"{0.9 * h * depth / self._way[0]:.2g} s, or an implicit master, which divides them"
        )

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
        if status == STEEP:
            raise ModuleError(
                f"contact{when}: the cable presses on a groove wall and is steeper to the wheel's plane than the wall "
                f"({0.5 * math.degrees(self._value('groove_angle')):.3g} degrees): the axle lies along the cable, which "
                "the law does not cover; turn the robot's yaw, or stop the run earlier"
            )
        if status == NOT_FINITE:
            raise ModuleError(f"contact{when}: the motion of cable or wheel is not finite; take a smaller macro step")
