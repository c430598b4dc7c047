"""FMUs unzipped: each content once, into a folder that loaders can read. Others see it whole or not at all.

What lies there is held against the hashes taken when it was unzipped each time it is used, and made anew where it
differs. An instance gets a copy of its own of what it may write.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from itertools import count
from pathlib import Path

from orchestrator.coupling.cache import prune, remove, shrink, used, user_folder
from orchestrator.coupling.fmu.archive import Hashes, sha256_of, unpack
from orchestrator.coupling.scratch import is_running, scratch

KIND, HASHES, OWN = "unpacked", "unpacked-hashes", "instances"
"""Folders of the user's: FMUs unzipped, the hashes of their files, copies for single instances."""
FORMER = ("fmu", "unzipped")
"""Where they were before."""
RESOURCES = "resources"
"""Folder of an FMU whose files it opens by its own paths, and may write."""
COMPILED = "__pycache__"
"""Folders that Python makes."""
MOST_MEGABYTES = 4096.0
_numbers = count(1)


def unzip(path: Path, sha256: str) -> Path:
    """Return the folder of the unzipped FMU; `ArchiveError` says what is wrong with its archive."""
    folder = unzip_folder(sha256)
    if not _is_whole(folder):
        for kind in (KIND, HASHES, *FORMER):
            prune(folder.parent.with_name(kind))
        shrink(folder.parent, MOST_MEGABYTES)
        with scratch(folder.parent) as place:
            _note(unpack(path, place / "fmu"), place / "hashes", folder)
            _move(place / "fmu", folder)
    return used(folder)


def unzip_folder(sha256: str) -> Path:
    """Return the folder for the FMU of this hash: a plain ASCII path, for loaders choke on others."""
    return user_folder(KIND, plain=True) / sha256[:16]


def _hashes(folder: Path) -> Path:
    return folder.parent.with_name(HASHES) / f"{folder.name}.json"


def _is_whole(folder: Path) -> bool:
    """Return whether `folder` holds the files of the FMU, all and unchanged, and no others but what Python compiles."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    with contextlib.suppress(OSError, ValueError):
        known: Hashes = json.loads(_hashes(folder).read_text(encoding="utf-8"))
        return _there(folder) == known.keys() and all(sha256_of(folder / name) == known[name] for name in known)
    return False


def _there(folder: Path) -> set[str]:
    """Return the files in `folder`; a link among them counts as one."""
    found = set[str]()
    for place, folders, names in os.walk(folder):
        links = [name for name in folders if os.path.islink(os.path.join(place, name))]
        folders[:] = [name for name in folders if name != COMPILED]
        found |= {os.path.relpath(os.path.join(place, name), folder).replace(os.sep, "/") for name in (*names, *links)}
    return found


def _move(made: Path, folder: Path) -> None:
    """Put what was `made` in the place of `folder`, unless another process was faster."""
    for _ in range(2):
        with contextlib.suppress(OSError):
            os.rename(made, folder)
            return
        if _is_whole(folder):
            return
        remove(folder)  # something is missing or has been changed, or it is a link
    raise OSError(f"{folder}: cannot be replaced; remove it")


def _note(hashes: Hashes, made: Path, folder: Path) -> None:
    """Write down the hashes of the files of `folder`, whole or not at all; `made` is where they are written to."""
    made.write_text(json.dumps(hashes), encoding="utf-8")
    _hashes(folder).parent.mkdir(exist_ok=True)
    os.replace(made, _hashes(folder))


# -- a copy for one instance ------------------------------------------------------------------------------------


def own_copy(folder: Path) -> Path:
    """Return a folder of the FMU unzipped in `folder` for one instance: its resources are copies, the rest is shared.

    Shared files are hard links, so that the system loads a library once. `remove` it when the instance has ended; those
    of processes that are no more are removed here.
    """
    place = user_folder(OWN, plain=True)
    _sweep(place)
    own = place / f"{os.getpid()}-{next(_numbers)}"
    remove(own)
    for source, _, names in os.walk(folder):
        inside = Path(source).relative_to(folder)
        (own / inside).mkdir()
        share = RESOURCES not in inside.parts[:1]
        for name in names:
            _place(Path(source, name), own / inside / name, share)
    return own


def _place(source: Path, target: Path, share: bool) -> None:
    """Put a file at `target`, as a link where it is shared and the file system has links."""
    if share:
        with contextlib.suppress(OSError):
            os.link(source, target)
            return
    shutil.copy2(source, target)


def _sweep(place: Path) -> None:
    """Remove the copies of processes that are no more."""
    for entry in place.iterdir():
        process = entry.name.partition("-")[0]
        if process.isdecimal() and not is_running(int(process)):
            remove(entry)
