"""Where the robot starts: over its landing point, its wheels just touching the cable at rest, then lifted.

The cable is looked at in the vertical plane through its supports, in which it hangs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.cable.assembly import interpolate
from fmus.cable.module import Cable
from fmus.contact import places as at
from fmus.contact.law import law_parameters
from fmus.contact.module import Contact
from fmus.kernels.roots import root
from fmus.kernels.rotations import from_euler, rotate
from fmus.module.variables import ModuleError
from fmus.robot.module import Robot, axle_in_body
from orchestrator.landing.seat import Wheel, lift_to_touch, require_groove

Foot = tuple[float, float, float]
"""Arc length, distance (negative under the cable) and y of the cable's point nearest to a wheel centre."""


@dataclass(frozen=True)
class Placement:
    """Where the robot starts, on the cable at rest.

    Attributes
    ----------
    initial : parameters ``initial.*`` of the robot
    arc_lengths : unstretched arc length under each wheel, m
    cable_length : unstretched length of the cable, m
    """

    initial: dict[str, float]
    arc_lengths: list[float]
    cable_length: float


def touching_distance(contact: Contact) -> float:
    """Return the distance (m) of wheel centre and centreline at which both walls touch: R_b + d_c / (2 sin(θ/2))."""
    prm = law_parameters(contact.values, contact.table)
    return float(prm[at.APEX] + 0.5 * prm[at.CABLE_DIAMETER] / prm[at.SINE])


def place(
    cable: Cable, robot: Robot, contact: Contact, position: float, height: float = 0.0, velocity: float = 0.0
) -> Placement:
    """Return the start of the robot over the cable at rest.

    Parameters
    ----------
    position : horizontal distance of the landing point (middle of the wheels) from the left support, m
    height : lift above touching, m
    velocity : sinking speed at the start, m/s

    Roll is turned so that all wheels touch where there are several; other angles, and the roll of a robot with one
    wheel, are its parameters ``initial.*``. A robot turned in yaw, or a wheel whose axle is, touches the walls of its groove
    higher: no wheel starts pressed into the cable.

    Raises
    ------
    ModuleError : the landing point or a wheel is off the span, or the cable does not lie in the groove of a wheel
    """
    span = cable["span"]
    if not 0.0 < position < span:
        raise ModuleError(f"landing.position = {position:g} m is off the span; choose one between 0 and {span:g} m")
    angles = _angles(robot)
    mounts = np.array([_vector(robot, k, "mount") for k in range(robot.n_wheels)])
    distance = touching_distance(contact)

    def centres(unknown: np.ndarray) -> np.ndarray:
        q = np.zeros(4)
        from_euler(angles[0] + unknown[2], angles[1], angles[2], q)
        arms = np.array([rotate(q, *mount) for mount in mounts])
        return np.array([0.0, unknown[0], unknown[1]]) + arms

    point = point_at(cable, arc_length_at(cable, position))
    normal = np.array([-point[5], point[4]]) / np.hypot(*point[4:6])
    above = point[1:3] + distance * normal  # where the centre of a wheel over the landing point is
    if robot.n_wheels == 1:
        found = np.array([*(above - centres(np.zeros(3))[0, 1:]), 0.0])
    else:
        found = _all_touching(cable, centres, distance, position, above[1] - np.mean(mounts[:, 2]))
    lateral = float(np.mean(centres(found)[:, 0]))
    touching = centres(found) - [lateral, 0.0, 0.0]
    feet = [_foot(cable, centre) for centre in touching]
    _require_span(cable, touching, feet)
    wheels = _wheels(cable, robot, contact, np.array([angles[0] + found[2], *angles[1:]]), touching, feet)
    require_groove(wheels)
    initial = {
        "initial.position.x": -lateral,
        "initial.position.y": float(found[0]),
        "initial.position.z": float(found[1] + lift_to_touch(wheels) + height),
        "initial.velocity.z": -velocity,
        "initial.roll": float(angles[0] + found[2]),
    }
    return Placement(initial, [foot[0] for foot in feet], cable["unstretched_length"])


def wheels_along(robot: Robot) -> np.ndarray:
    """Return how far along the span the wheels are from their middle (n_wheels,), m, at the robot's initial angles."""
    q = np.zeros(4)
    from_euler(*_angles(robot), q)
    along = np.array([rotate(q, *_vector(robot, k, "mount"))[1] for k in range(robot.n_wheels)])
    return along - np.mean(along)


def _angles(robot: Robot) -> np.ndarray:
    """Return the initial roll, pitch and yaw (3,), rad."""
    return robot.values[robot.table.indices(f"initial.{a}" for a in ("roll", "pitch", "yaw"))]


def _all_touching(
    cable: Cable, centres: Callable[[np.ndarray], np.ndarray], distance: float, position: float, height: float
) -> np.ndarray:
    """Return y, z and turn in roll (3,) with which several wheels touch, their middle over `position`."""
    from scipy.optimize import least_squares  # the import takes as long as all else that a short run imports

    def misfit(unknown: np.ndarray) -> np.ndarray:
        feet = [_foot(cable, centre) for centre in centres(unknown)]
        middle = np.mean([foot[2] for foot in feet]) - position
        return np.array([*(foot[1] - distance for foot in feet), middle])

    start = np.array([position, height, 0.0])
    found = least_squares(misfit, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=[1.0, 1.0, 0.1]).x
    if len(centres(found)) > 2:  # roll and height cannot make all of them touch: no wheel may start pressed in
        found[1] -= min(_foot(cable, centre)[1] - distance for centre in centres(found))
    return found


def _vector(robot: Robot, k: int, name: str) -> np.ndarray:
    """Return a parameter (3,) of wheel k, counted from 0."""
    return robot.values[robot.table.indices(f"wheel[{k + 1}].{name}.{axis}" for axis in "xyz")]


def _wheels(
    cable: Cable, robot: Robot, contact: Contact, angles: np.ndarray, centres: np.ndarray, feet: Sequence[Foot]
) -> list[Wheel]:
    """Return the wheels of the robot at `centres` (n, 3), turned by roll, pitch and yaw, each over its foot."""
    q, wheels = np.zeros(4), []
    from_euler(angles[0], angles[1], angles[2], q)
    for k in range(robot.n_wheels):
        point, axle_B = point_at(cable, feet[k][0]), axle_in_body(robot.values, robot.table, f"wheel[{k + 1}]")
        axle = np.array(rotate(q, *axle_B))
        wheels.append(Wheel(k + 1, point[:3], point[3:], centres[k], axle, contact))
    return wheels


def _require_span(cable: Cable, centres: np.ndarray, feet: Sequence[Foot]) -> None:
    """Raise `ModuleError` naming the first wheel that stands beyond a support: its foot is an end of the cable."""
    span, length = cable["span"], float(cable.model.s[-1])
    for k, (s, _, _) in enumerate(feet):
        if not 0.0 < s < length:
            side = "left" if s <= 0.0 else "right"
            raise ModuleError(
                f"landing: wheel[{k + 1}] stands at y = {centres[k, 1]:.4g} m, beyond the {side} support (the span is 0 to "
                f"{span:g} m): every wheel needs cable under it; move landing.position towards the middle"
            )


def point_at(cable: Cable, s: float) -> np.ndarray:
    """Return position and tangent (6,) of the cable at arc length `s`."""
    out = np.zeros(6)
    interpolate(cable.model, cable.state[: cable.model.weight.size], s, np.zeros(8), out)
    return out


def arc_length_at(cable: Cable, y: float) -> float:
    """Return the unstretched arc length at the horizontal position `y` of the cable at rest."""
    length = float(cable.model.s[-1])
    return root(lambda s: float(point_at(cable, s)[1]) - y, 0.0, length, xtol=1e-12 * length)


def _foot(cable: Cable, centre: np.ndarray) -> Foot:
    """Return arc length, distance (negative under the cable) and y of the cable's point nearest to `centre` (3,).

    All in the plane of the cable, y and z.
    """
    s = arc_length_at(cable, float(np.clip(centre[1], 1e-6, cable["span"] - 1e-6)))
    length = float(cable.model.s[-1])
    for _ in range(20):
        point = point_at(cable, s)
        ds = float((centre[1:] - point[1:3]) @ point[4:6] / (point[4:6] @ point[4:6]))
        s = min(max(s + ds, 0.0), length)
        if abs(ds) < 1e-13 * length:
            break
    point = point_at(cable, s)
    apart = centre[1:] - point[1:3]
    side = np.sign(point[4] * apart[1] - point[5] * apart[0])
    return s, float(side * np.hypot(*apart)), float(point[1])
