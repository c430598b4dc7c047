"""Ctrl-C, and the signals that ask a process to end: what they do is put off, or ends what is done as an exception would."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

ENDING = ("SIGTERM", "SIGHUP")
"""Signals that ask a process to end, beside Ctrl-C: of a system that shuts down, of a terminal that is closed."""


class Stopped(SystemExit):
    """A signal asks this process to end, and what has to be kept is kept; it ends with 128 + the signal's number.

    Attributes
    ----------
    number : of the signal
    where : what is kept, and where; empty if there is nothing
    """

    def __init__(self, number: int, where: str = ""):
        super().__init__(128 + number)
        self.number, self.where = number, where

    def __str__(self) -> str:
        return interrupted_by(self.number) + (f"; {self.where}" if self.where else "")


def interrupted_by(number: int) -> str:
    """Return by what a run was ended, in words."""
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


@contextmanager
def listening(heard: Callable[[int], object]) -> Iterator[None]:
    """Tell `heard` of the first signal that asks the process to end; after it, and afterwards, they do what they did before.

    Signals that are ignored stay so: a run under ``nohup`` outlives its terminal.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _numbers()}
    ours = [number for number, handler in before.items() if handler not in (signal.SIG_IGN, None)]

    def restore() -> None:
        for number in ours:
            signal.signal(number, before[number])

    def hear(number: int, _: Any) -> None:
        restore()
        heard(number)

    for number in ours:
        signal.signal(number, hear)
    try:
        yield
    finally:
        restore()


def _numbers() -> list[int]:
    """Return the signals that this system has."""
    return [signal.SIGINT, *(getattr(signal, name) for name in ENDING if hasattr(signal, name))]


@contextmanager
def ending() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end what is done within as Ctrl-C does, by an exception; a second one ends the process at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _numbers()[1:]}
    ours = [number for number, handler in before.items() if handler == signal.SIG_DFL]

    def stop(number: int, _: Any) -> None:
        for one in ours:
            signal.signal(one, signal.SIG_DFL)
        raise Stopped(number)

    for number in ours:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])


@contextmanager
def deferred(where: str = "") -> Iterator[None]:
    """Let what is done within be done, whatever signal comes, as the writing of results; then the signal is passed on."""
    asked: list[int] = []
    with listening(asked.append):
        yield
    passed_on(asked[0] if asked else None, where)


def passed_on(number: int | None, where: str = "") -> None:
    """Do with a signal that was heard what would have been done with it before.

    Parameters
    ----------
    number : of the signal; None: there was none
    where : what is kept, and where; `Stopped` says it
    """
    if number is None:
        return
    try:
        signal.raise_signal(number)
    except Stopped as stop:
        stop.where = where
        raise
