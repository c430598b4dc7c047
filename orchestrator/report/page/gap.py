"""The gap between rotors and line: how near the line, as it is bent, comes to the plane of the rotors."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.report.page.line import Line
from orchestrator.report.page.scene import Geometry

SAMPLES, BEYOND = 49, 1.3
"""Points of the line that are looked at, and how far beyond the rotors they reach: a line may lie steep."""


@dataclass(frozen=True)
class Gap:
    """The gap over time: `time` (k,) s, `size` (k,) m, negative where the line cuts the plane of the rotors."""

    time: np.ndarray
    size: np.ndarray


def gap_of(geometry: Geometry | None, table: Table, line: Line | None) -> Gap | None:
    """Return the least gap of rotor plane and line over the length of the robot; None where size or shape is not known."""
    size = geometry["robot"]["size"] if geometry else None
    arcs = [values for name, values in table.items() if re.fullmatch(r"contact\d+\.cable\.s", name)]
    pose = [
        f"robot.{name}" for name in ("body.position.x", "body.position.y", "body.position.z", "roll", "pitch", "yaw")
    ]
    if geometry is None or size is None or line is None or not arcs or any(name not in table for name in pose):
        return None
    rows, half = np.searchsorted(table["time"], line.time), 0.5 * size["along"]
    s = np.mean(arcs, axis=0)[rows, None] + BEYOND * half * np.linspace(-1.0, 1.0, SAMPLES)
    body = np.stack([table[name][rows] for name in pose], axis=1)
    y, z = _in_body(_points(line, s), body)
    sign, rotors = -1.0 if geometry["robot"]["layout"] == "bottom" else 1.0, np.linspace(-half, half, SAMPLES)
    above = [
        np.interp(rotors, *frame) for frame in zip(y, z, strict=True)
    ]  # a line that ends before the rim: as at its end
    return Gap(line.time, np.min(sign * np.array(above), axis=1))


def _points(line: Line, s: np.ndarray) -> np.ndarray:
    """Return the points (k, n, 3) m of the line at arc lengths `s` (k, n): cubic Hermite between its nodes."""
    i = np.clip(np.searchsorted(line.s, s) - 1, 0, len(line.s) - 2)
    h = (line.s[i + 1] - line.s[i])[..., None]
    u = np.clip((s - line.s[i])[..., None] / h, 0.0, 1.0)
    v, frame = 1.0 - u, np.arange(len(s))[:, None]
    left = v * v * (1.0 + 2.0 * u) * line.position[frame, i] + u * v * v * h * line.slope[frame, i]
    return left + u * u * (3.0 - 2.0 * u) * line.position[frame, i + 1] - u * u * v * h * line.slope[frame, i + 1]


def _in_body(points: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return y and z (k, n) m of points in the robot's frame b; `body` (k, 6): place of b, then roll, pitch, yaw."""
    d = points - body[:, None, :3]
    (sr, sp, sy), (cr, cp, cy) = np.sin(body[:, 3:]).T, np.cos(body[:, 3:]).T
    along_y = np.stack([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr], axis=1)
    along_z = np.stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr], axis=1)
    return np.einsum("knj,kj->kn", d, along_y), np.einsum("knj,kj->kn", d, along_z)
