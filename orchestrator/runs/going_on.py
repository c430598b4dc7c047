"""What a run leaves on disk while it is going on.

The folder ``unfinished`` in the run's own has the signals and the reports of the master as they come, and in ``about.json``
what they are of. It goes when the run is complete. Whoever writes there holds a lock, which ends with the process,
however that ends.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.run.results import read_json, write_json
from orchestrator.coupling.run.simulate import SIGNALS
from orchestrator.coupling.scratch import is_running

FOLDER, ABOUT, LOCK = "unfinished", "about.json", "lock"
_locks: dict[Path, BinaryIO] = {}


@contextmanager
def going_on(directory: Path, about: Mapping[str, Any]) -> Iterator[Path]:
    """Give the folder that a run writes to while it goes on; it goes again where nothing came of the run.

    Parameters
    ----------
    about : what is to be known of the run
    """
    folder = directory / FOLDER
    folder.mkdir(parents=True)
    try:
        _lock(folder / LOCK)
        write_json(folder / ABOUT, {"process": os.getpid(), "started": time.time(), **about})
        yield folder
    except (InputError, RunError, OSError) as error:
        if not (isinstance(error, OSError) and (folder / ABOUT).is_file()):  # else the disk is full, and rows are kept
            conclude(directory)
            with suppress(OSError):
                directory.rmdir()
        raise


def conclude(directory: Path) -> None:
    """Remove what a run has left while it was going on: it is complete now, or nothing came of it."""
    let_go(directory)
    shutil.rmtree(directory / FOLDER, ignore_errors=True)


def keep_signals(directory: Path) -> None:
    """Let the file of all signals outlast the run, beside its tables: a second name for it, so that it is never away."""
    source, target = directory / FOLDER / SIGNALS, directory / SIGNALS
    if source.is_file() and not target.exists():
        try:
            os.link(source, target)
        except OSError:  # a file system without second names
            shutil.copyfile(source, target)


def goes_on(directory: Path) -> bool:
    """Whether the run in `directory` is still going on, by its lock; where there are none, by the number of its process."""
    folder = directory / FOLDER
    try:
        import fcntl
    except ImportError:
        return is_running(int(read_json(folder / ABOUT)["process"]))
    with suppress(FileNotFoundError), open(folder / LOCK, "rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def let_go(directory: Path) -> None:
    """Give up the locks of the runs in `directory`: they do not go on any more."""
    for path in [path for path in _locks if directory in path.parents]:
        _locks.pop(path).close()


def _lock(path: Path) -> None:
    """Lock a new file as long as the run goes on, its error is estimated, and its files are written."""
    file = _locks[path] = open(path, "wb")  # noqa: SIM115 (closed by `let_go`, or by the end of the process)
    with suppress(ImportError, OSError):  # a system without such locks
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
