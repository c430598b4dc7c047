"""The scenarios that come with the package, and any other by its path."""

from __future__ import annotations

from pathlib import Path

from orchestrator.coupling.errors import InputError, nearest

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
    if path.is_file() or (beside / text.partition("#")[0]).is_file():  # of an archive, a variant
        return path
    if text in names():
        return folder() / f"{text}.toml"
    near = [*(file.name for file in path.parent.glob("*.toml")), *names()] if path.parent.is_dir() else names()
    hint = nearest(path.name, near)
    raise InputError(f"{text}: no such scenario file{hint}; `orchestrator list` shows the names of those there are")
