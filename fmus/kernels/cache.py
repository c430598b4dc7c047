"""Where modules keep what can be made again: compiled kernels, the sources that an FMU brings along.

A folder of the user's, ``LINE_LANDING_CACHE`` or ``$XDG_CACHE_HOME/line-landing`` or ``~/.cache/line-landing``; where none
of them can be written, one in the temporary folder, which is said once. The text of this file is part of the script
inside every FMU: standard library only.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

KEPT_DAYS = 30
"""Days without use after which an entry is removed."""
_said: set[Path] = set()


def user_folder(kind: str) -> Path:
    """Return the folder for entries of one `kind`, made if need be; raise `OSError` if it can be made nowhere."""
    wanted = _wanted()
    for base in (wanted, _temporary()):
        folder = base / kind
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                _say_if_elsewhere(base, wanted)
                return folder
    raise OSError(f"neither {wanted} nor {tempfile.gettempdir()} can be written; set LINE_LANDING_CACHE to a folder")


def _wanted() -> Path:
    given, xdg = os.environ.get("LINE_LANDING_CACHE"), os.environ.get("XDG_CACHE_HOME")
    if given:
        return Path(given).absolute()
    if xdg:
        return Path(xdg).absolute() / "line-landing"
    return Path(os.path.expanduser("~")).absolute() / ".cache" / "line-landing"


def _temporary() -> Path:
    """Return a folder below the temporary one that is the user's own: nobody else can have put code there."""
    owner = os.getuid() if hasattr(os, "getuid") else None
    folder = Path(tempfile.gettempdir()) / f"line-landing-{'user' if owner is None else owner}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if not folder.is_symlink() and owner in (None, folder.stat().st_uid):
            return folder
    return Path(tempfile.mkdtemp(prefix="line-landing-"))


def _say_if_elsewhere(base: Path, wanted: Path) -> None:
    if base != wanted and wanted not in _said:
        _said.add(wanted)
        print(f"line-landing: {wanted} cannot be written; caches are kept in {base}", file=sys.stderr)


def used(entry: Path) -> Path:
    """Mark `entry` as in use today; return it."""
    with contextlib.suppress(OSError):
        os.utime(entry)
    return entry


def prune(folder: Path, days: float = KEPT_DAYS) -> None:
    """Remove the entries of `folder` that nobody has used for so many days."""
    oldest = time.time() - 86400.0 * days
    with contextlib.suppress(OSError):
        for entry in folder.iterdir():
            if entry.is_dir() and not entry.is_symlink() and entry.stat().st_mtime < oldest:
                shutil.rmtree(entry, ignore_errors=True)
