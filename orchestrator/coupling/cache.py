"""Where the engine keeps what can be made again: unzipped FMUs, compiled kernels.

A folder of the user's: ``LINE_LANDING_CACHE`` or ``$XDG_CACHE_HOME/line-landing`` or ``~/.cache/line-landing``; where that
will not do, one in a temporary folder, which is said once. Modules keep their kernels there by the same rule
(`fmus.kernels.cache`), which the engine does not know.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

PLAIN = re.compile(r"[A-Za-z0-9_./\\:-]+")
"""Paths that every loader of FMUs can read."""
MEGABYTES = "LINE_LANDING_CACHE_MB"
"""Environment variable: room for unzipped FMUs."""
KEPT_DAYS = 30
"""Days without use after which an entry is removed."""
_said: set[Path] = set()


def user_folder(kind: str, *, plain: bool = False) -> Path:
    """Return the folder for entries of one `kind`, made if need be; raise `OSError` if it can be made nowhere.

    Parameters
    ----------
    plain : whether its path has to be plain ASCII, without blanks
    """
    for base in _places():
        if (not plain or PLAIN.fullmatch(str(base / kind))) and _is_writable(base / kind):
            _say_if_elsewhere(base, plain)
            return base / kind
    cure = "set LINE_LANDING_CACHE to a folder" + (" with a plain ASCII path" if plain else "")
    raise OSError(f"no folder of yours and none of the temporary ones can be used; {cure}")


def _places() -> Iterator[Path]:
    """Yield folders of the user's, the best first."""
    wanted = _wanted()
    if wanted is not None:
        yield wanted
    for parent in dict.fromkeys((tempfile.gettempdir(), "/tmp", "/var/tmp")):
        owner = os.getuid() if hasattr(os, "getuid") else None
        folder = Path(parent, f"line-landing-{'user' if owner is None else owner}").absolute()
        if _is_private(folder, owner):
            yield folder


def _wanted() -> Path | None:
    given, xdg = os.environ.get("LINE_LANDING_CACHE"), os.environ.get("XDG_CACHE_HOME")
    place = os.path.expanduser(given or os.path.join(xdg or "~/.cache", "line-landing"))
    return None if place.startswith("~") else Path(place).absolute()  # a user without a home


def _is_writable(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        return os.access(folder, os.W_OK)
    return False


def _is_private(folder: Path, owner: int | None) -> bool:
    """Make the folder if need be; return whether nobody else can have put code there."""
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        return stat.S_ISDIR(found.st_mode) and (owner is None or (found.st_uid == owner and not found.st_mode & 0o022))
    return False


def _say_if_elsewhere(base: Path, plain: bool) -> None:
    """Say once that `base` serves; what cannot be written is given up by the processes started from here, too."""
    wanted = _wanted()
    if base == wanted or base in _said:
        return
    _said.add(base)
    if plain and wanted is not None and not PLAIN.fullmatch(str(wanted)):
        why = f"FMUs cannot be loaded from {wanted}; they are unzipped"
    else:
        why = f"{wanted or 'a home folder'} cannot be written; caches are kept"
        os.environ["LINE_LANDING_CACHE"] = str(base)
    print(f"line-landing: {why} in {base}", file=sys.stderr)


def used(entry: Path) -> Path:
    """Mark `entry` as in use today; return it."""
    with contextlib.suppress(OSError):
        os.utime(entry)
    return entry


def prune(folder: Path, days: float = KEPT_DAYS) -> None:
    """Remove the entries of `folder` that nobody has used for so many days."""
    oldest = time.time() - 86400.0 * days
    for entry in folder.iterdir() if folder.is_dir() else ():
        with contextlib.suppress(OSError):
            if entry.lstat().st_mtime < oldest:
                remove(entry)


def shrink(folder: Path, megabytes: float) -> None:
    """Remove the entries of `folder` that nobody has used for longest where all take more room than `megabytes`.

    ``LINE_LANDING_CACHE_MB`` is taken instead where it is set. What has been used within a day stays: it may be in use now.
    """
    room, old = 1e6 * _megabytes(megabytes), time.time() - 86400.0
    entries = sorted((_used_at(entry), _size(entry), entry) for entry in (folder.iterdir() if folder.is_dir() else ()))
    total = sum(size for _, size, _ in entries)
    for when, size, entry in entries:
        if total <= room or when > old:
            return
        remove(entry)
        total -= size


def _megabytes(otherwise: float) -> float:
    with contextlib.suppress(ValueError):
        return float(os.environ.get(MEGABYTES) or otherwise)
    return otherwise


def _used_at(entry: Path) -> float:
    with contextlib.suppress(OSError):
        return entry.lstat().st_mtime
    return 0.0


def _size(entry: Path) -> int:
    """Return the bytes of a file, or of all files of a folder."""
    total = 0
    for place, _, names in os.walk(entry):
        for name in names:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(place, name)).st_size
    return total


def remove(entry: Path) -> None:
    """Remove a file, a folder or a link (not what it leads to), if that can be done."""
    with contextlib.suppress(OSError):
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()
