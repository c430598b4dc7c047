"""Kernels are compiled at their first call on a machine. That takes a minute, in which nothing else is seen: it is said."""

from __future__ import annotations

import atexit
import time
from collections.abc import Container

from numba.core.event import Event, Listener, register

from fmus.kernels.notice import notice


class Compilation(Listener):
    """Says when the first kernel of a process is compiled, and at the end what all of them took.

    Parameters
    ----------
    modules : names of the modules whose kernels count; a kernel that calls others is compiled around them
    """

    def __init__(self, modules: Container[str]):
        self._modules, self._inside, self._seconds = modules, list[float](), 0.0
        register("numba:compile", self)
        atexit.register(self.conclude)

    def on_start(self, event: Event) -> None:
        """Begin to count."""
        if self._counts(event):
            if not (self._inside or self._seconds):
                notice("compiling kernels for this machine, once; this takes up to two minutes …")
            self._inside.append(time.monotonic())

    def on_end(self, event: Event) -> None:
        """Count what one kernel took, with those that it calls."""
        if self._counts(event):
            start = self._inside.pop()
            self._seconds += 0.0 if self._inside else time.monotonic() - start

    def _counts(self, event: Event) -> bool:
        return event.data is not None and event.data["dispatcher"].py_func.__module__ in self._modules

    def conclude(self) -> None:
        """Say how long it took, if anything was compiled since the last time."""
        if self._seconds:
            notice(f"kernels were compiled in {self._seconds:.0f} s")
            self._seconds = 0.0
