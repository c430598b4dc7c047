"""Where FMUs are unzipped: each once, in a cache folder of the user's that loaders can read.

The folder is that of `fmus.kernels.cache`, which the engine does not know; where its path is not plain ASCII, or
cannot be written, one in a temporary folder.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import fmpy

PLAIN = re.compile(r"[A-Za-z0-9_./\\:-]+")
"""Paths that every loader can read."""
KEPT_DAYS = 30
"""Days without use after which an unzipped FMU is removed."""


def unzip(path: Path, sha256: str) -> Path:
    """Unzip the FMU once; return the folder."""
    folder = unzip_folder(sha256)
    if not (folder / "modelDescription.xml").is_file():
        _prune(folder.parent)
        _prune(folder.parent.with_name("fmu"))  # where they were before version 0.2
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            fmpy.extract(str(path), os.path.join(scratch, "fmu"))
            with contextlib.suppress(OSError):  # another process was faster
                os.rename(os.path.join(scratch, "fmu"), folder)
    with contextlib.suppress(OSError):
        os.utime(folder)
    return folder


def unzip_folder(sha256: str) -> Path:
    """Return a plain ASCII folder for the FMU of this hash: loaders choke on others, and compiled code is
    found again."""
    for base in _places():
        folder = base / "unzipped" / sha256[:16]
        if PLAIN.fullmatch(str(folder)):
            with contextlib.suppress(OSError):
                folder.parent.mkdir(parents=True, exist_ok=True)
                if os.access(folder.parent, os.W_OK):
                    return folder
    raise OSError("no folder with a plain ASCII path can be written; set TMPDIR to one")


def _places() -> Iterator[Path]:
    """Yield folders of the user's, the best first."""
    given, xdg = os.environ.get("LINE_LANDING_CACHE"), os.environ.get("XDG_CACHE_HOME")
    home = os.path.expanduser(given or os.path.join(xdg or "~/.cache", "line-landing"))
    if not home.startswith("~"):  # else the user has no home
        yield Path(home).absolute()
    owner = os.getuid() if hasattr(os, "getuid") else None
    for temporary in (tempfile.gettempdir(), "/tmp", "/var/tmp"):
        folder = Path(temporary, f"line-landing-{'user' if owner is None else owner}").absolute()
        if PLAIN.fullmatch(str(folder)) and _is_the_users_own(folder, owner):
            yield folder


def _is_the_users_own(folder: Path, owner: int | None) -> bool:
    """Make the folder if need be; say whether nobody else can have put code there."""
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        return not folder.is_symlink() and owner in (None, folder.stat().st_uid)
    return False


def _prune(folder: Path) -> None:
    """Remove what nobody has used for long, drafts that were given up too."""
    oldest = time.time() - 86400.0 * KEPT_DAYS
    for entry in folder.iterdir() if folder.is_dir() else ():
        with contextlib.suppress(OSError):
            if entry.lstat().st_mtime < oldest:
                shutil.rmtree(entry)
