"""The scenarios that come with the package, and any other by its path."""

from __future__ import annotations

import os
from pathlib import Path

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.reading import is_file

PACKAGE = Path(__file__).parents[1]


def folder() -> Path:
    """Return where the shipped scenarios are: in the package, or beside it in a clone."""
    inside = PACKAGE / "scenarios"
    return inside if inside.is_dir() else PACKAGE.parent / "scenarios"


def names() -> list[str]:
    """Return the names of the shipped scenarios."""
    return sorted(path.stem for path in folder().glob("*.toml"))


def find(name_or_path: str | Path, beside: Path = Path()) -> Path:
    """Return the file of a scenario: a file that exists (relative to `beside`), else the shipped one of that name."""
    text = str(name_or_path)
    path = beside / text
    if is_file(path) or is_file(beside / text.partition("#")[0]):  # of an archive, a variant
        return path
    if text in names():
        return folder() / f"{text}.toml"
    if text and os.path.lexists(path):
        raise InputError(f"{text}: is no file; give a scenario file, or one of the names of `orchestrator list`")
    near = [*(file.name for file in path.parent.glob("*.toml")), *names()] if os.path.isdir(path.parent) else names()
    hint = nearest(path.name, near)
    raise InputError(f"{text}: no such scenario file{hint}; `orchestrator list` shows the names of those there are")
