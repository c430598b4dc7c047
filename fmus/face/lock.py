"""One process at a time: a lock file beside what it guards.

The system gives a lock back when its process ends, however it ends; the file is removed with the lock. A link in its
place is not followed: whoever can write to the folder could else let us open a file of their choice.
"""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path

from fmus.kernels.notice import notice
from fmus.module.variables import ModuleError

try:
    import fcntl
except ImportError:  # not a POSIX system: files are replaced in one move, so that work is done twice at worst
    fcntl = None

LIMIT = 300.0
"""Longest wait, s: a build takes 2 s, and waits for a few others on a loaded machine."""
QUIET = 2.0
"""Wait after which it is said, s."""
POLL = 0.05
"""Time between two looks at the lock, s."""
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""What file systems without locks answer."""


@contextlib.contextmanager
def locked(path: Path, limit: float = LIMIT) -> Iterator[None]:
    """Let one process, and one thread of it, at a time work on `path`.

    Raises
    ------
    ModuleError
        after `limit` seconds, or if a link stands in the place of the lock file
    """
    lock = path.with_name(f".{path.name}.lock")
    handle = None if fcntl is None else _acquired(lock, limit)
    try:
        yield
    finally:
        if handle is not None:
            lock.unlink(missing_ok=True)  # before the lock is given back: nobody else has it then
            os.close(handle)


def _acquired(lock: Path, limit: float) -> int:
    """Return the open file that holds the lock."""
    start, said = time.monotonic(), False
    while (handle := _attempt(lock)) is None:
        waited = time.monotonic() - start
        if waited > limit:
            cure = "end that process, or remove the file if there is none"
            raise ModuleError(f"{lock}: another process has held this lock for {limit:g} s; {cure}")
        if waited > QUIET and not said:
            said = True
            notice(f"waiting for another process, which holds {lock} …")
        time.sleep(POLL)
    return handle


def _attempt(lock: Path) -> int | None:
    """Return the open file if the lock was to be had."""
    handle, mine = _opened(lock), False
    try:
        mine = not _is_taken(handle) and _is_still_there(lock, handle)
    finally:
        if not mine:
            os.close(handle)
    return handle if mine else None


def _opened(lock: Path) -> int:
    try:
        return os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise ModuleError(f"{lock}: is a link, which is not followed; remove it") from None


def _is_taken(handle: int) -> bool:
    assert fcntl is not None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
    return False


def _is_still_there(lock: Path, handle: int) -> bool:
    """Whether `lock` is the file that is open: who had the lock before has removed the file."""
    try:
        return os.path.samestat(os.lstat(lock), os.fstat(handle))
    except FileNotFoundError:
        return False
