"""A folder of the catalogue: one TOML file a name."""

from __future__ import annotations

from pathlib import Path

from orchestrator.coupling.errors import InputError, nearest


def names(folder: Path) -> list[str]:
    """Return the names in `folder`, whatever their files hold."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def is_file(name_or_path: str) -> bool:
    """Whether something is named by its file, and not by its name in the catalogue."""
    return name_or_path.endswith(".toml")


def find(folder: Path, name: str, what: str, otherwise: str = "") -> Path:
    """Return the file of `name`; `InputError` names the nearest one, or all and what there is `otherwise`."""
    there = names(folder)
    if name not in there:
        hint = nearest(name, there) or f"; choose {', '.join(there)}{otherwise}"
        raise InputError(f"no {what}{hint}")
    return folder / f"{name}.toml"


def find_or_path(folder: Path, name_or_path: str, thing: str, beside: Path) -> Path:
    """Return the file of a name, or the file itself that a path relative to `beside` stands for."""
    if is_file(name_or_path):
        return beside / name_or_path
    return find(folder, name_or_path, f"{thing} {name_or_path!r} in the catalogue", ", or the path of a .toml file")
