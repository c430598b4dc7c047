"""Standard output and error that may be closed, broken or full: what cannot be printed costs no results."""

from __future__ import annotations

import errno
import os
import sys
from typing import Any, TextIO, cast

QUIET = (errno.EPIPE, errno.EIO, errno.EBADF)
"""Nobody reads any more: a pipe (``| head``), a terminal that is gone."""


class Forgiving:
    """A stream that goes on into nothing after its first failure.

    Attributes
    ----------
    failure : the first, but for that nobody reads any more
    """

    def __init__(self, stream: TextIO):
        self._stream = stream
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        """Write text, or forget it."""
        try:
            return self._stream.write(text)
        except OSError as error:
            self._give_up(error)
            return len(text)

    def flush(self) -> None:
        """Flush, or forget what there is."""
        try:
            self._stream.flush()
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        if error.errno not in QUIET:
            self.failure = self.failure or error
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self._stream.fileno())
        os.close(nothing)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def forgive() -> None:
    """Let this process go on whatever becomes of its standard streams.

    Those that are closed lead to nothing: a file of results opened in their place would get what is printed.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if not _is_open(number):
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115 (as long as the process)
    for name in ("stdout", "stderr"):
        if not isinstance(getattr(sys, name), Forgiving):
            setattr(sys, name, cast("TextIO", Forgiving(getattr(sys, name))))


def lost() -> OSError | None:
    """Return why answers could not be printed on standard output; None where they were, or nobody reads them."""
    stream: Any = sys.stdout
    if not isinstance(stream, Forgiving):
        return None
    stream.flush()
    return stream.failure


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True
