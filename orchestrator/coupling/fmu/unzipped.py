"""FMUs unzipped: each content once, into a folder that loaders can read. Others see it whole or not at all."""

from __future__ import annotations

import contextlib
import os
import zipfile
from pathlib import Path

import fmpy

from orchestrator.coupling.cache import prune, remove, used, user_folder
from orchestrator.coupling.scratch import scratch

FORMER = "fmu"
"""Where they were before version 0.2."""


def unzip(path: Path, sha256: str) -> Path:
    """Return the folder of the unzipped FMU."""
    folder = unzip_folder(sha256)
    if not _is_whole(folder, path):
        prune(folder.parent)
        prune(folder.parent.with_name(FORMER))
        with scratch(folder.parent) as place:
            fmpy.extract(str(path), os.path.join(place, "fmu"))
            _move(Path(place, "fmu"), folder, path)
    return used(folder)


def unzip_folder(sha256: str) -> Path:
    """Return the folder for the FMU of this hash: a plain ASCII path, for loaders choke on others."""
    return user_folder("unzipped", plain=True) / sha256[:16]


def _is_whole(folder: Path, path: Path) -> bool:
    """Return whether `folder` has every file of the FMU: what cleans temporary folders takes them one by one."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    with zipfile.ZipFile(path) as archive:
        files = [name for name in archive.namelist() if not name.endswith("/") and ".." not in name.split("/")]
    return all((folder / name).is_file() for name in files)


def _move(made: Path, folder: Path, path: Path) -> None:
    """Put what was `made` in the place of `folder`, unless another process was faster."""
    for _ in range(2):
        with contextlib.suppress(OSError):
            os.rename(made, folder)
            return
        if _is_whole(folder, path):
            return
        remove(folder)  # something is missing, or it is a link
    raise OSError(f"{folder}: cannot be replaced; remove it")
