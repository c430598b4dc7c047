"""The limits of a landing: the scenario's, else the robot's own, else what follows from the geometry of robot and line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from orchestrator.catalogue.robot_spec import RobotSpec, Size
from orchestrator.coupling.errors import InputError
from orchestrator.landing import workspace
from orchestrator.landing.placement import point_at, touching_distance
from orchestrator.landing.resolve import Landing, cable_module, contact_module, robot_module
from orchestrator.landing.safety import UNITS, Limit, Limits
from orchestrator.landing.workspace import Formula, NoRoom
from orchestrator.scenario.types import LandingScenario, Provenance, Scenario

SHARE_OF_STRENGTH = 0.4
"""Of the rated tensile strength: 1 over the design factor of safety of 2.5 at the lowest point (GB 50545-2010, clause 5.0.7).

At the supports the clause lets 2.25 pass; judged is the largest tension anywhere, so that the lower share is on the safe side.
"""
BY_CODE = (
    f"{SHARE_OF_STRENGTH} of the rated strength: a factor of safety of 2.5 at the line's lowest point, "
    "GB 50545-2010, clause 5.0.7 (at supports it asks for 2.25)"
)
NOT_GIVEN = "no limit given"


def limits_of(landing: Landing) -> Limits:
    """Return the limits of a landing."""
    known, missing = dict[str, Limit](), dict[str, str]()
    for name in UNITS:
        try:
            known[name] = _limit(landing, name)
        except NoRoom as why:
            missing[name] = str(why)
    return Limits(known, missing)


def landing_only(scenario: Scenario) -> LandingScenario:
    """Return `scenario`; `InputError` if it is no landing."""
    if not isinstance(scenario, LandingScenario):
        raise InputError(f"{scenario.path}: is a graph of FMUs, which has no limits; name the scenario of a landing")
    return scenario


def roll_range(landing: Landing, limits: Limits) -> Iterator[str]:
    """Yield within which roll the robot is safe at each wheel on the line at rest, as Table 2 of the paper gives it."""
    if "roll" not in limits.known:
        return
    cable, most = cable_module(landing.cable), np.degrees(limits.known["roll"].value)
    for k, s in enumerate(landing.placement.arc_lengths, start=1):
        alpha = float(np.degrees(workspace.slope(point_at(cable, s)[None, 3:])[0]))
        yield (
            f"roll over wheel {k}, where the line at rest slopes by {alpha:.2f} deg: "
            f"{alpha - most:.2f} to {alpha + most:.2f} deg"
        )


def _limit(landing: Landing, name: str) -> Limit:
    """Return one limit; `NoRoom` says why there is none."""
    given, spec = getattr(landing.scenario.limits, name), landing.sources.spec
    said = landing.scenario.provenance.get(f"limits.{name}", Provenance())
    if given is False:
        raise NoRoom(f"switched off: {_words(said.source, said.reason)}")
    reference = REFERENCES[name](landing) if name in REFERENCES else None
    if given is not None:
        return Limit(name, float(given), UNITS[name], _words(said.source, said.reason), reference=reference)
    own = getattr(spec.limits, name, None) if spec is not None else None
    if own is not None:
        return Limit(name, own.value, UNITS[name], _words(own.source or "", own.reason or ""), reference=reference)
    if name == "tension":
        strength = landing.scenario.provenance.get("limits.rated_strength", Provenance())
        source = f"{BY_CODE}; rated strength: {_words(strength.source, strength.reason)}"
        return Limit(name, SHARE_OF_STRENGTH, UNITS[name], source, reference=reference)
    if name not in DERIVED:
        raise NoRoom(NOT_GIVEN)
    formula, source = DERIVED[name](landing)
    return Limit(
        name, formula.value, UNITS[name], f"{formula.equation} of Jia et al. 2025; {source}", formula, reference
    )


def _words(source: str, reason: str) -> str:
    return f"{source}: {reason}" if reason else source


# -- from the geometry ----------------------------------------------------------------------------------------


def _roll(landing: Landing) -> tuple[Formula, str]:
    size = _size(_spec(landing))
    _require_hanging(landing, "roll")
    arm = min(abs(height) for height in line_heights(landing))
    return workspace.roll(arm, size.along.value), "L_c from the wheel's mount and groove, D_Ry of the robot's size"


def _yaw(landing: Landing) -> tuple[Formula, str]:
    names = ("groove_width", "cable_diameter", "wheel_radius")
    if landing.contact.foreign is not None and any(name not in landing.contact.settings for name in names):
        raise NoRoom("the contact's FMU does not say how wide the groove is; give limits.yaw")
    contact = contact_module(landing.contact, 0.0)
    width, diameter, radius = contact.values[contact.table.indices(names)]
    return workspace.yaw(width, diameter, 2.0 * radius), "groove, wheel and cable of the contact"


def _pitch(landing: Landing) -> tuple[Formula, str]:
    spec = _spec(landing)
    _require_hanging(landing, "pitch")
    if spec.rotors is None:
        raise NoRoom(f"robot {spec.name} does not say its largest thrust; give [rotors] max_thrust, or limits.pitch")
    mass, gravity = _robot_values(landing, "mass", "gravity")
    return workspace.pitch(mass, gravity, spec.rotors.max_thrust.value), "F_z,max of the robot's rotors"


def pitch_by_mass(landing: Landing) -> dict[str, float] | None:
    """Return what the limit of pitch follows from beside the mass: gravity (m/s²) and largest thrust (N).

    None where it does not: it is given, or nothing gives it.
    """
    spec = landing.sources.spec
    if (
        landing.scenario.limits.pitch is not None
        or spec is None
        or spec.limits.pitch is not None
        or spec.rotors is None
    ):
        return None
    try:
        _require_hanging(landing, "pitch")
    except NoRoom:
        return None
    return {"gravity": _robot_values(landing, "gravity")[0], "thrust": spec.rotors.max_thrust.value}


def _z(landing: Landing) -> tuple[Formula, str]:
    limits = landing.scenario.limits
    if limits.conductor_spacing is None or limits.safe_clearance is None:
        raise NoRoom("no line below is known; give limits.conductor_spacing and limits.safe_clearance, or limits.z")
    size = _size(_spec(landing))
    height = size.height if size.below_line is None else size.below_line
    found = workspace.z(limits.conductor_spacing, height.value, limits.safe_clearance)
    return found, "D_12 and D_E of the scenario's limits, D_Rz of the robot's size"


DERIVED: Mapping[str, Callable[[Landing], tuple[Formula, str]]] = {"roll": _roll, "yaw": _yaw, "pitch": _pitch, "z": _z}
"""Limit → the formula that gives it, and where its numbers come from."""


def _spec(landing: Landing) -> RobotSpec:
    if landing.sources.spec is None:
        raise NoRoom("a robot that comes as an FMU does not say its size and thrust; give the limit in [limits]")
    return landing.sources.spec


def _size(spec: RobotSpec) -> Size:
    if spec.size is None:
        raise NoRoom(f"robot {spec.name} does not say its size; give its [size], or the limit in [limits]")
    return spec.size


def _require_hanging(landing: Landing, name: str) -> None:
    """Raise `NoRoom` for a robot whose centre of mass is above the line: it topples from any angle, no angle is safe."""
    above = _robot_values(landing, "center_of_mass.z")[0] - max(line_heights(landing))
    if above > 0.0:
        raise NoRoom(
            f"its centre of mass is {above:.3g} m above the line: it topples from any angle; give limits.{name}"
        )


def line_heights(landing: Landing) -> list[float]:
    """Return how high (m) the line is over the rotor plane where it lies in the groove of each wheel; negative: below it."""
    mounts = _robot_values(landing, *(f"wheel[{k + 1}].mount.z" for k in range(landing.n_wheels)))
    distance = touching_distance(contact_module(landing.contact, 0.0))
    return [mount - distance for mount in mounts]


def _robot_values(landing: Landing, *names: str) -> list[float]:
    robot = robot_module(landing.robot, landing.n_wheels)
    return [float(value) for value in robot.values[robot.table.indices(names)]]


# -- what signals are counted by ------------------------------------------------------------------------------


def _touching_height(landing: Landing) -> float:
    """Return the height (m) of the robot where it touches the line at rest."""
    return float(landing.placement.initial["initial.position.z"]) - landing.scenario.landing.height


def _strength(landing: Landing) -> float:
    """Return the rated tensile strength (N) of the conductor."""
    strength = landing.scenario.limits.rated_strength
    if strength is None:
        raise NoRoom(
            "the conductor's rated tensile strength is not known; give limits.rated_strength, or a conductor with one"
        )
    return strength


REFERENCES: Mapping[str, Callable[[Landing], float]] = {"z": _touching_height, "tension": _strength}
