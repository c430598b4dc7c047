"""Who writes the modes of the line with the robot on it: tables, and the shapes."""

from __future__ import annotations

import csv

import numpy as np

from orchestrator.coupling.run.results import replacing
from orchestrator.landing.robot_modes import SHARES, Positions, SystemModes
from orchestrator.runs.directory import RunDirectory

HEAD = ("mode", "kind", "frequency [Hz]", "damping ratio [1]", "growth [1/s]", *(f"{share} [1]" for share in SHARES))
UNITS = {"equilibrium": "m", "frequency": "Hz", "growth": "1/s", "damping_ratio": "1"}


def write_modes(directory: RunDirectory, found: SystemModes) -> None:
    """Write ``modes.csv``, a row a mode, and ``modes.h5`` with the shapes."""
    with replacing(directory.path / "modes.csv") as temporary, temporary.open("w", newline="") as file:
        csv.writer(file).writerows([HEAD, *rows(found)])
    directory.write_fields("modes.h5", shapes(found), UNITS)


def rows(found: SystemModes) -> list[tuple[str, ...]]:
    """Return the rows of ``modes.csv``."""
    numbers = np.column_stack([found.frequency, found.damping_ratio, found.growth, found.shares]).tolist()
    named = zip(found.kinds, numbers, strict=True)
    return [(str(k), kind, *map(repr, row)) for k, (kind, row) in enumerate(named, start=1)]


def shapes(found: SystemModes) -> dict[str, np.ndarray]:
    """Return equilibrium (m, 3), numbers (n,), and the shapes of line (n, m, 3) and robot (n, 6), real and imaginary."""
    numbers = {"frequency": found.frequency, "damping_ratio": found.damping_ratio, "growth": found.growth}
    parts = {"line": found.line, "robot": found.robot}
    split = {f"{name}.{part}": getattr(values, part) for name, values in parts.items() for part in ("real", "imag")}
    return {"equilibrium": found.equilibrium, **numbers, **split}


def write_positions(directory: RunDirectory, found: Positions) -> None:
    """Write ``positions.csv``: bounce and pendulum over the landing position."""
    table = {"landing.position": found.position}
    for i, name in enumerate(("bounce", "pendulum")):
        table |= {f"{name}.frequency": found.frequency[:, i], f"{name}.damping_ratio": found.damping_ratio[:, i]}
    directory.write_table("positions.csv", table)
