"""What there is to choose from, with a line each: scenarios, robots, masters."""

from __future__ import annotations

import tomllib
from pathlib import Path

from orchestrator.catalogue.robot_spec import catalogue


def scenarios(folder: Path) -> dict[str, str]:
    """Return the titles of the scenario files of `folder` by path."""
    return {str(path): _title(path) for path in sorted(folder.glob("*.toml"))}


def robots() -> dict[str, str]:
    """Return the titles of the robots of the catalogue by name."""
    return {name: robot.title for name, robot in catalogue().items()}


def masters() -> dict[str, str]:
    """Return the titles of the masters by name."""
    from orchestrator.coupling.masters import MASTERS

    return {name: master.TITLE for name, master in MASTERS.items()}


def _title(path: Path) -> str:
    try:
        return str(tomllib.loads(path.read_text(encoding="utf-8")).get("title", ""))
    except (OSError, ValueError) as error:
        return f"cannot be read: {error}"
