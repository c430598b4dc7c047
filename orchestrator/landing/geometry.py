"""What a picture of a landing needs to know of span, line and robot beside its signals; numbers in SI."""

from __future__ import annotations

from typing import Any

from fmus.contact.module import Contact
from fmus.robot.module import Robot
from orchestrator.catalogue.robot_spec import Size
from orchestrator.landing.limits import line_heights
from orchestrator.landing.resolve import Landing, cable_as_given, contact_module, robot_module


def geometry(landing: Landing) -> dict[str, Any]:
    """Return span, line and robot, as ``summary.json`` has them under ``geometry``."""
    cable, contact = cable_as_given(landing.cable), contact_module(landing.contact, 0.0)
    return {
        "span": float(cable["span"]),
        "level_difference": float(cable["level_difference"]),
        "cable_length": landing.placement.cable_length,
        "cable_diameter": _value(contact, "cable_diameter"),
        "landing_position": landing.scenario.landing.position,
        "robot": _robot(landing, contact),
    }


def _robot(landing: Landing, contact: Contact) -> dict[str, Any]:
    """Return the robot: its wheels as they are mounted; size and sources where the catalogue knows them."""
    robot, spec = robot_module(landing.robot, landing.n_wheels), landing.sources.spec
    line = min(line_heights(landing), key=abs)
    return {
        "name": landing.scenario.robot.model or landing.scenario.robot.fmu,
        "layout": spec.layout if spec is not None else "top" if line > 0.0 else "bottom",
        "size": _size(spec.size) if spec is not None and spec.size is not None else None,
        "line_above_rotors": line,
        "weight": _value(robot, "mass") * _value(robot, "gravity"),
        "center_of_mass": _triple(robot, "center_of_mass"),
        "wheels": [_wheel(robot, contact, f"wheel[{k}]") for k in range(1, landing.n_wheels + 1)],
        "quantities": {key: one.model_dump() for key, one in spec.quantities().items()} if spec is not None else {},
    }


def _size(size: Size) -> dict[str, float | None]:
    lengths = {name: getattr(size, name) for name in Size.model_fields}
    return {name: None if length is None else length.value for name, length in lengths.items()}


def _wheel(robot: Robot, contact: Contact, name: str) -> dict[str, Any]:
    return {
        "mount": _triple(robot, f"{name}.mount"),
        "axle_direction": _triple(robot, f"{name}.axle_direction"),
        **{key: _value(robot, f"{name}.{key}") for key in ("axle_yaw", "axle_tilt")},
        "braked": bool(_value(robot, f"{name}.braked")),
        "radius": _value(contact, "wheel_radius"),
        **{key: _value(contact, key) for key in ("groove_angle", "groove_width")},
    }


def _triple(robot: Robot, name: str) -> list[float]:
    return [_value(robot, f"{name}.{axis}") for axis in "xyz"]


def _value(module: Robot | Contact, name: str) -> float:
    return float(module.values[module.table.index[name]])
