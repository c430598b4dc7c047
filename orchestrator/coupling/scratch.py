"""Folders for a while: named after their process, so that what a killed one has left is found and removed."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from orchestrator.coupling.cache import remove, user_folder

NAME = re.compile(r"line-landing-(\d+)-\w+")
"""Of a folder in the system's temporary one; the number is that of its process."""

PART = re.compile(r"\.(.+)\.(\d+)(\.[^.]*)?")
"""Name of a file that a process, by its number, has not completed."""


@contextmanager
def scratch(folder: Path | None = None) -> Iterator[Path]:
    """Give a folder of this process that goes at the end; what dead ones have left beside it is removed.

    Parameters
    ----------
    folder : in which it is made; None: the system's temporary one
    """
    remove_orphans(folder)
    prefix = f"line-landing-{os.getpid()}-"
    with tempfile.TemporaryDirectory(prefix=prefix, dir=folder, ignore_cleanup_errors=True) as place:
        yield Path(place)


def remove_orphans(folder: Path | None = None) -> None:
    """Remove the folders of processes that are no more: they were killed."""
    with suppress(OSError):
        for entry in Path(folder or tempfile.gettempdir()).iterdir():
            found = NAME.fullmatch(entry.name)
            if found is not None and not is_running(int(found[1])) and _is_ours(entry):
                remove(entry)


def remove_left_overs() -> None:
    """Remove what killed processes have left in the temporary folder and in that of unzipped FMUs."""
    remove_orphans()
    with suppress(OSError):
        remove_orphans(user_folder("unpacked", plain=True))


def remove_parts(folder: Path) -> None:
    """Remove the files in `folder` that were not completed and whose process is no more."""
    for path in folder.glob(".*"):
        part = PART.fullmatch(path.name)
        if part is not None and path.is_file() and not is_running(int(part[2])):
            path.unlink(missing_ok=True)


def is_running(process: int) -> bool:
    """Whether there is a process of that number."""
    if os.name != "posix":  # elsewhere to ask is to end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is another user's, or the system cannot tell
        return True
    return True


def _is_ours(entry: Path) -> bool:
    return not hasattr(os, "getuid") or entry.lstat().st_uid == os.getuid()
