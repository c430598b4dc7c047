"""Where modules keep what can be made again: compiled kernels, FMUs, the sources that an FMU brings along.

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


def user_folder(kind: str) -> Path:
    """Return the folder for entries of one `kind`, made if need be; raise `OSError` if it can be made nowhere."""
    for place in (_wanted, _temporary):
        with contextlib.suppress(OSError, RuntimeError):  # the latter: a user without a home
            base = place().expanduser().absolute()
            (base / kind).mkdir(parents=True, exist_ok=True)
            if os.access(base / kind, os.W_OK):
                if place is _temporary:
                    _settle(base)
                return base / kind
    raise OSError(f"neither {_wanted()} nor {tempfile.gettempdir()} can be written; set LINE_LANDING_CACHE to a folder")


def _wanted() -> Path:
    given, xdg = os.environ.get("LINE_LANDING_CACHE"), os.environ.get("XDG_CACHE_HOME")
    return Path(given) if given else Path(xdg or "~/.cache", "line-landing")


def _temporary() -> Path:
    """Return a folder below the temporary one that is the user's own: nobody else can have put code there."""
    owner = os.getuid() if hasattr(os, "getuid") else None
    folder = Path(tempfile.gettempdir()) / f"line-landing-{'user' if owner is None else owner}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if not folder.is_symlink() and owner in (None, folder.stat().st_uid):
            return folder
    return Path(tempfile.mkdtemp(prefix="line-landing-"))


def _settle(base: Path) -> None:
    """Stay with `base`, in the processes that this one starts too, which then need not say so again."""
    print(f"line-landing: {_wanted()} cannot be written; caches are kept in {base}", file=sys.stderr)
    os.environ["LINE_LANDING_CACHE"] = str(base)


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
            if entry.lstat().st_mtime < oldest:
                remove(entry)


def remove(entry: Path) -> None:
    """Remove a file, a folder or a link, if that can be done."""
    if entry.is_dir() and not entry.is_symlink():
        shutil.rmtree(entry, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            entry.unlink()
