"""What ends a run at a communication point, so that its results are kept: Ctrl-C, or a signal that asks the process to end."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from orchestrator.coupling.fmu.channel import waiting
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.signals import interrupted_by, listening


class Interruption(FmuError):
    """A signal ends a run at a communication point, so that its results so far are kept.

    Attributes
    ----------
    number : of the signal
    """

    def __init__(self, time: float, number: int = signal.SIGINT):
        super().__init__("run", time, 0, "interrupted")
        self.number = number

    def __str__(self) -> str:
        return f"{interrupted_by(self.number)} at t = {self.time:g} s"


@contextmanager
def interruptible() -> Iterator[Callable[[float], None]]:
    """Give what a run calls at each communication point; it raises `Interruption` after Ctrl-C, SIGTERM or SIGHUP.

    A second signal does what it did before. Only the main thread hears of signals; elsewhere the run goes on.
    """
    asked: list[int] = []

    def check(time: float) -> None:
        if asked:
            raise Interruption(time, asked[0])

    # an FMU in a process of its own may never come to a communication point
    with listening(asked.append), waiting(check):
        yield check
