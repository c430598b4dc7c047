"""The room that a robot has on a line, from the geometry of both: physics, no files.

Jia et al. 2025, Appl. Sci. 15(4), 1863, section 2.3: eqs. 1 to 5 and Table 2. Angles in rad, lengths in m, forces in N.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


class NoRoom(ValueError):
    """A formula has no answer for these numbers; the message says why."""


@dataclass(frozen=True)
class Formula:
    """A limit that follows from geometry.

    Attributes
    ----------
    equation : its number in the paper
    text, filled : the formula in symbols, and with its numbers
    value : in `unit`
    """

    equation: str
    text: str
    filled: str
    value: float
    unit: str


def roll(arm: float, width: float) -> Formula:
    """Return at which roll against the line (rad) the rim of the rotor plane meets it: eq. 1.

    Parameters
    ----------
    arm : L_c, distance of line and rotor plane; whether the plane is below the line or above it
    width : D_Ry, of the rotor plane along the line
    """
    if not arm > 0.0:
        raise NoRoom("the line lies in the rotor plane")
    filled = f"arctan(2 · {arm:.4g} m / {width:.4g} m)"
    return Formula("eq. 1", "arctan(2 L_c / D_Ry)", filled, math.atan2(2.0 * arm, width), "rad")


def yaw(groove_width: float, cable_diameter: float, wheel_diameter: float) -> Formula:
    """Return at which yaw against the line (rad) the cable may leave the groove: eq. 3, eq. 2 on the safe side."""
    free = groove_width - 2.0 * cable_diameter
    if not free > 0.0:
        raise NoRoom(f"eq. 3 has no answer: the groove, {groove_width:.4g} m, is no wider than two cables")
    filled = f"arctan(({groove_width:.4g} m - 2 · {cable_diameter:.4g} m) / {wheel_diameter:.4g} m)"
    return Formula("eq. 3", "arctan((B - 2 d) / D)", filled, math.atan2(free, wheel_diameter), "rad")


def yaw_before_simplifying(groove_width: float, cable_diameter: float, wheel_diameter: float) -> float:
    """Return the yaw (rad) of eq. 2, tan(Ψ) = (B - d / cos(Ψ)) / D; that is D sin(Ψ) = B cos(Ψ) - d."""
    hypotenuse = math.hypot(groove_width, wheel_diameter)
    return math.acos(cable_diameter / hypotenuse) - math.atan2(wheel_diameter, groove_width)


def pitch(mass: float, gravity: float, thrust: float) -> Formula:
    """Return at which tilt (rad) the largest thrust F_z,max just carries the weight: eq. 4, its fraction inverted.

    As printed, F_z,max / (m g), it has no answer for a robot that can fly.
    """
    weight = mass * gravity
    if not thrust > weight:
        raise NoRoom(f"the largest thrust, {thrust:.4g} N, does not carry its weight of {weight:.4g} N")
    filled = f"arccos({mass:.4g} kg · {gravity:.4g} m/s2 / {thrust:.4g} N)"
    return Formula("eq. 4", "arccos(m g / F_z,max)", filled, math.acos(weight / thrust), "rad")


def z(spacing: float, height: float, clearance: float) -> Formula:
    """Return how far (m) the robot may sink before its insulation clearance to the line below is used up: eq. 5.

    Parameters
    ----------
    spacing : D_12, from this line to the one below it
    height : D_Rz, of the robot, as far as it is below the line
    clearance : D_E, that must stay
    """
    filled = f"{spacing:.4g} m - {height:.4g} m - {clearance:.4g} m"
    return Formula("eq. 5", "D_12 - D_Rz - D_E", filled, spacing - height - clearance, "m")


def slope(tangent: np.ndarray) -> np.ndarray:
    """Return the slope α (n,) rad of the line: positive where it rises along +Y, in the sense of roll.

    Parameters
    ----------
    tangent : (n, 3), of any length, along the line
    """
    return np.arctan2(tangent[:, 2], tangent[:, 1])


def heading(tangent: np.ndarray) -> np.ndarray:
    """Return the heading (n,) rad of the line about the vertical: zero along +Y, in the sense of yaw; `tangent` (n, 3)."""
    return np.arctan2(-tangent[:, 0], tangent[:, 1])


# -- Table 2 --------------------------------------------------------------------------------------------------

LINE_SLOPE, SHIFT = math.radians(5.1), math.radians(5.4)
"""Largest slope of the 200 m line by the text; the shift between the ranges of roll in Table 2."""


@dataclass(frozen=True)
class Row:
    """A range of Table 2.

    Attributes
    ----------
    what : it limits
    filled : the formula with its numbers
    ours, printed : both ends, in `unit` (deg or m)
    digits : decimals that are printed
    note : what there is to say
    """

    what: str
    filled: str
    ours: tuple[float, float]
    printed: tuple[float, float]
    digits: int
    unit: str
    note: str = ""

    @property
    def agrees(self) -> bool:
        """Whether ours, rounded, are the digits that are printed."""
        return all(round(a, self.digits) == b for a, b in zip(self.ours, self.printed, strict=True))


def table_2() -> list[Row]:
    """Return Table 2 of the paper beside what its own formulas give with its own numbers."""
    of_roll, of_yaw = roll(0.162, 1.25), yaw(0.08, 0.018, 0.15)
    of_pitch, of_z = pitch(38.0, 9.8, 820.0), z(3.45, 1.2, 1.0)
    exact = math.degrees(yaw_before_simplifying(0.08, 0.018, 0.15))
    wide, tilt = math.degrees(of_yaw.value), math.degrees(of_pitch.value)
    by_text = "the slope of the text, 5.1°; Table 2 is shifted by 5.4°"
    by_table = "L_c is not stated: 0.162 m is what gives these digits, with a slope of 5.4°"
    return [
        *(_roll_row(of_roll, sign * LINE_SLOPE, by_text) for sign in (-1.0, 1.0)),
        *(_roll_row(of_roll, sign * SHIFT, by_table) for sign in (-1.0, 1.0)),
        Row("pitch", of_pitch.filled, (-tilt, tilt), (-63.0, 63.0), 0, "deg", "F_z,max is not stated: 820 N gives it"),
        Row("yaw", of_yaw.filled, (-wide, wide), (-16.34, 16.34), 2, "deg",
            f"cut off, not rounded; before it is simplified, eq. 2 gives {exact:.2f}°"),
        Row("z", of_z.filled, (0.0, of_z.value), (0.0, 1.25), 2, "m",
            "D_12 and D_E are not stated: their difference is, by Table 2 and D_Rz"),
    ]  # fmt: skip


def _roll_row(formula: Formula, alpha: float, note: str) -> Row:
    """Return the range of roll where the line slopes by `alpha` (rad)."""
    low, high = (math.degrees(sign * formula.value + alpha) for sign in (-1.0, 1.0))
    printed = (-19.9, 9.1) if alpha < 0.0 else (-9.1, 19.9)
    return Row("roll", f"±{formula.filled} {math.degrees(alpha):+.2g}°", (low, high), printed, 1, "deg", note)
