"""Commented files to start from: a scenario, a robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from orchestrator.catalogue.names import require_file_name
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "templates"


def write_new(kind: Literal["scenario", "robot"], name: str | Path) -> Path:
    """Write a commented file that is valid as it stands, and return its path; nothing is ever overwritten.

    Parameters
    ----------
    name : of the file, with or without ``.toml``, with or without a folder
    """
    path = Path(f"{str(name).removesuffix('.toml')}.toml")
    require_file_name(name, path.name.removesuffix(".toml"))
    title = json.dumps(path.stem.replace("_", " "), ensure_ascii=False)  # a TOML string is written like one of JSON
    text = (FOLDER / f"{kind}.toml").read_text(encoding="utf-8")
    text = text.replace('title = "TITLE"', f"title = {title}").replace("THIS.toml", path.name)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{path}: exists already; choose another name") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    return path
