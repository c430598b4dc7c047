"""Whether every wheel has a place on the cable where it starts: within the span, in its groove, not pressed in."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fmus.contact import places as at
from fmus.contact.law import STEEP, law_parameters, walls
from fmus.contact.module import Contact
from fmus.kernels.roots import root
from fmus.module.variables import ModuleError

PRESSED = 1e-9
"""m; a wheel that is placed to touch is pressed by less, in round-off."""


class Wheel:
    """A wheel at its start, its cable a straight line through the foot.

    Parameters
    ----------
    number : from 1
    point, tangent, centre, axle : (3,) cable point and dr/ds, wheel centre and axle
    """

    def __init__(
        self,
        number: int,
        point: np.ndarray,
        tangent: np.ndarray,
        centre: np.ndarray,
        axle: np.ndarray,
        contact: Contact,
    ):
        self.number = number
        self.motion = np.zeros(at.MOTION_SIZE)
        parts = ((at.POINT, point), (at.TANGENT, tangent), (at.CENTRE, centre), (at.AXLE, axle))
        for first, vector in parts:
            self.motion[first : first + 3] = vector
        self.prm = law_parameters(contact.values, contact.table)

    def penetration(self, lift: float) -> float:
        """Return how deep (m) a wall is pressed after the wheel is lifted by `lift` (m)."""
        motion, out = self.motion.copy(), np.zeros(at.OUT_SIZE)
        motion[at.CENTRE + 2] += lift
        status = walls(self.prm, motion, out)
        return math.inf if status == STEEP else float(out[at.DEEPEST])

    @property
    def steepness(self) -> float:
        """Angle between cable and wheel plane, rad."""
        axle, tangent = self.motion[at.AXLE : at.CENTRE_RATE], self.motion[at.TANGENT : at.POINT_RATE]
        return math.asin(min(1.0, abs(axle @ tangent) / float(np.linalg.norm(axle) * np.linalg.norm(tangent))))

    @property
    def beside(self) -> float:
        """Offset of the cable from the middle of the groove, along the axle, m."""
        axle = self.motion[at.AXLE : at.CENTRE_RATE]
        apart = self.motion[at.POINT : at.TANGENT] - self.motion[at.CENTRE : at.AXLE]
        return float(apart @ axle / np.linalg.norm(axle))


def require_groove(wheels: Sequence[Wheel]) -> None:
    """Raise `ModuleError` naming the first wheel whose groove the cable does not lie in."""
    for wheel in wheels:
        half = math.asin(wheel.prm[at.SINE])
        if wheel.steepness >= half:
            raise ModuleError(
                f"landing: wheel[{wheel.number}] stands at {math.degrees(wheel.steepness):.3g} degrees to the cable, as "
                f"steep as a wall of its groove ({math.degrees(half):.3g} degrees) or steeper: its axle lies along the "
                "cable; turn initial.yaw (or the wheel's axle_direction) until the wheel runs along it"
            )
        rim = 0.5 * wheel.prm[at.GROOVE_WIDTH]
        if abs(wheel.beside) > rim:
            raise ModuleError(
                f"landing: wheel[{wheel.number}] stands beside the cable, {1e3 * abs(wheel.beside):.3g} mm off the middle "
                f"of its groove, which is {1e3 * rim:.3g} mm wide to each side; turn initial.yaw or initial.pitch, or "
                "mount the wheels in one plane"
            )


def lift_to_touch(wheels: Sequence[Wheel]) -> float:
    """Return by how much (m) the robot must be lifted for no wheel to start pressed into the cable: 0 if none is.

    Raises
    ------
    ModuleError : no lift frees it
    """

    def deepest(lift: float) -> float:
        return max(wheel.penetration(lift) for wheel in wheels)

    if deepest(0.0) <= PRESSED:
        return 0.0
    most = 2.0 * max(float(wheel.prm[at.WHEEL_RADIUS]) for wheel in wheels)
    if not deepest(most) < 0.0:
        inside = max(wheels, key=lambda wheel: wheel.penetration(0.0))
        raise ModuleError(
            f"landing: wheel[{inside.number}] starts inside the cable, pressed by {1e3 * inside.penetration(0.0):.3g} mm, "
            "and no lift frees it; turn initial.roll, initial.pitch or initial.yaw, or check the wheel's mount"
        )
    return root(deepest, 0.0, most, xtol=1e-12)
