"""Ctrl-C: ends a run at a communication point, so that its results so far are kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from orchestrator.coupling.fmu.channel import waiting
from orchestrator.coupling.fmu.failure import FmuError


class Interruption(FmuError):
    """Ctrl-C: ends a run at a communication point, so that its results so far are kept."""

    def __init__(self, time: float):
        super().__init__("run", time, 0, "interrupted")

    def __str__(self) -> str:
        return f"interrupted at t = {self.time:g} s"


@contextmanager
def interruptible() -> Iterator[Callable[[float], None]]:
    """Give what a run calls at each communication point; it raises `Interruption` after Ctrl-C.

    A second Ctrl-C ends the program at once. Only the main thread hears of Ctrl-C; elsewhere the run goes on.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda time: None
        return
    asked: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def ask(number: int, _: Any) -> None:
        asked.append(number)
        signal.signal(signal.SIGINT, before)

    def check(time: float) -> None:
        if asked:
            raise Interruption(time)

    signal.signal(signal.SIGINT, ask)
    try:
        with waiting(check):  # an FMU in a process of its own may never come to a communication point
            yield check
    finally:
        signal.signal(signal.SIGINT, before)
