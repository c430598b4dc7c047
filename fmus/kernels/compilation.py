"""Kernels are compiled at their first call on a machine. That takes a minute, in which nothing else is seen: it is said."""

from __future__ import annotations

import atexit
import time

from numba.core.event import Event, Listener, register

from fmus.kernels.notice import notice


class Compilation(Listener):
    """Says when the first kernel of a process is compiled, and what all of them took.

    Attributes
    ----------
    seconds : wall time spent so far, s
    """

    def __init__(self) -> None:
        self.seconds, self._start, self._depth = 0.0, 0.0, 0

    def on_start(self, event: Event) -> None:
        """Begin to count; a kernel that calls others is compiled around them."""
        if not self.seconds and not self._depth:
            notice("compiling kernels for this machine; this is done once and takes up to two minutes …")
        if not self._depth:
            self._start = time.monotonic()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """Count what one kernel took, with those that it calls."""
        self._depth -= 1
        if not self._depth:
            self.seconds += time.monotonic() - self._start

    def conclude(self) -> None:
        """Say how long it took, if anything was compiled since the last time."""
        if self.seconds:
            notice(f"kernels were compiled in {self.seconds:.0f} s; they are kept for the next time")
            self.seconds = 0.0


COMPILATION = Compilation()
"""That of this process."""


def watch() -> None:
    """Listen to Numba, once a process."""
    register("numba:compile", COMPILATION)
    atexit.register(COMPILATION.conclude)
