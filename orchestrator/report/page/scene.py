"""Span and robot of a page, from what ``summary.json`` says of a landing's geometry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from orchestrator.coupling.run.results import Table
from orchestrator.report.page.head import Robot, Span, Wheel

Geometry = Mapping[str, Any]
NO_SIZE: Mapping[str, float | None] = {"across": None, "along": None, "height": None, "below_line": None}


def span_of(geometry: Geometry) -> Span:
    """Return the span with its supports: the left one is the origin."""
    length, rise = geometry["span"], geometry["level_difference"]
    return Span(length, [0.0, 0.0, 0.0], [0.0, length, rise])


def place_of(geometry: Geometry, table: Table | None = None) -> dict[str, Any]:
    """Return span, robot and what else of a head is known from a geometry."""
    return {
        "span": span_of(geometry),
        "cable_diameter": geometry["cable_diameter"],
        "landing_position": geometry["landing_position"],
        "robot": robot_of(geometry, table or {}),
    }


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
