"""Names of files that a user gives: those that some system would not take, or hide, are refused before anything is written."""

from __future__ import annotations

import json
import re
from pathlib import Path
from unicodedata import category

from orchestrator.coupling.errors import InputError

DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])\s*", re.IGNORECASE)
"""Names of Windows' devices, whatever ending follows: https://learn.microsoft.com/windows/win32/fileio/naming-a-file."""


def require_file_name(given: str | Path, name: str) -> None:
    """Refuse a name that is none, hidden, a device of Windows, or that no file can have.

    Parameters
    ----------
    given : what the user has written, for the message
    name : of the file, without folder and ending
    """
    shown = json.dumps(str(given), ensure_ascii=False)
    if not name.strip(" ."):
        raise InputError(f"{shown}: names no file; write a name behind the folder, my_line for instance")
    if name.startswith("."):
        raise InputError(f"{shown}: would be a hidden file; leave away the dot before its name")
    if DEVICES.fullmatch(name.split(".")[0]):
        raise InputError(f"{shown}: is the name of a device on Windows; choose another, my_{name} for instance")
    if "\0" in str(given) or any(category(letter) == "Cc" for letter in name):
        raise InputError(f"{shown}: has a control character, which no name of a file should have; leave it away")
