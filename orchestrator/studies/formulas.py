"""What follows from a claim's own formula, without a run: Tables 1, 2 and 4 of the paper, by name, in the units printed."""

from __future__ import annotations

import math
from collections.abc import Callable

from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.landing.workspace import Row, table_2

DIAMETER, MODULUS = 0.018, 79.8e9
"""Jia et al. 2025, section 4.3: m, Pa."""


def axial_stiffness() -> tuple[float, ...]:
    """Return E π d²/4 of a solid rod, N."""
    return (MODULUS * math.pi * DIAMETER**2 / 4.0,)


def bending_stiffness() -> tuple[float, ...]:
    """Return E π d⁴/64 of a solid rod, N.m²."""
    return (MODULUS * math.pi * DIAMETER**4 / 64.0,)


def roll_limits() -> tuple[float, ...]:
    """Return the ranges of roll of Table 2 by eq. 1 and the slope of the text, ±5.1°: four ends, deg."""
    return _ends([row for row in table_2() if row.what == "roll"][:2])


def pitch_limits() -> tuple[float, ...]:
    """Return the range of pitch of Table 2 by eq. 4, deg."""
    return _ends([row for row in table_2() if row.what == "pitch"])


def yaw_limits() -> tuple[float, ...]:
    """Return the range of yaw of Table 2 by eq. 3, deg."""
    return _ends([row for row in table_2() if row.what == "yaw"])


def z_limits() -> tuple[float, ...]:
    """Return the range of Z of Table 2 by eq. 5, m."""
    return _ends([row for row in table_2() if row.what == "z"])


def wheels() -> tuple[float, ...]:
    """Return the numbers of wheels of Table 4's robots, as the catalogue has them."""
    names = ("hybrid_robot_1", "linedrone", "hybrid_robot_2", "fptlir")
    return tuple(float(load_robot(name).n_wheels) for name in names)


def _ends(rows: list[Row]) -> tuple[float, ...]:
    return tuple(end for row in rows for end in row.ours)


FORMULAS: dict[str, Callable[[], tuple[float, ...]]] = {
    function.__name__: function
    for function in (axial_stiffness, bending_stiffness, roll_limits, pitch_limits, yaw_limits, z_limits, wheels)
}
"""The formulas by name."""
