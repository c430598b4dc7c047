"""Span and robot of a page, from what ``summary.json`` says of a landing's geometry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.landing import workspace
from orchestrator.landing.safety import NotRecorded, series
from orchestrator.report.page.head import Robot, Span, Wheel

Geometry = Mapping[str, Any]
NO_SIZE: Mapping[str, float | None] = {"across": None, "along": None, "height": None, "below_line": None}


def span_of(geometry: Geometry) -> Span:
    """Return the span with its supports: the left one is the origin."""
    length, rise = geometry["span"], geometry["level_difference"]
    return Span(length, [0.0, 0.0, 0.0], [0.0, length, rise])


def robot_of(geometry: Geometry, table: Table) -> Robot:
    """Return the robot to draw: our own, or what is known of one from elsewhere."""
    robot = geometry["robot"]
    return Robot(
        name=str(robot["name"]),
        layout=robot["layout"],
        **{**NO_SIZE, **(robot["size"] or {})},
        rotor_plane=0.0,
        line=robot["line_above_rotors"],
        wheels=[_wheel(wheel) for wheel in robot["wheels"]],
        centre_of_mass=robot["center_of_mass"],
        thrust="robot.thrust" in table,
    )


def _wheel(wheel: Mapping[str, Any]) -> Wheel:
    same = {name: wheel[name] for name in ("mount", "radius", "groove_angle", "axle_yaw", "axle_tilt", "braked")}
    return Wheel(width=wheel["groove_width"], axle=wheel["axle_direction"], **same)


def clearance(geometry: Geometry | None, table: Table) -> np.ndarray | None:
    """Return the least gap (n,) m of rotor plane and line at any wheel; None where size or signals are not known."""
    size = geometry["robot"]["size"] if geometry else None
    if not geometry or not size or size["along"] is None:
        return None
    try:
        rolls = series("roll", table)
    except NotRecorded:
        return None
    arm = geometry["robot"]["line_above_rotors"]
    return np.min([workspace.clearance(arm, size["along"], roll) for roll in rolls.values()], axis=0)
