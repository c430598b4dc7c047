"""How a command ends whatever happens: with a message and a status, never with a traceback on the screen."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from orchestrator.cli.terminal import complain, forgive_encodings
from orchestrator.coupling.errors import FAILED, INTERNAL, INTERRUPTED, WRONG_INPUT
from orchestrator.runs import last_net

OURS = ("orchestrator", "fmus")
REINSTALL = "install the program anew: pip install --force-reinstall line-landing"


@contextmanager
def under_the_net(arguments: Sequence[str]) -> Iterator[None]:
    """End the process by `SystemExit` alone: with a message and a status, and a file for what is a fault of this program."""
    forgive_encodings()
    try:
        with _all_heard(arguments):
            yield
    except KeyboardInterrupt:
        complain("interrupted")
        raise SystemExit(INTERRUPTED) from None
    except (GeneratorExit, SystemExit):
        raise
    except BaseException as error:  # a panic of a library in Rust is no Exception
        raise SystemExit(ended(error, arguments)) from None


def ended(error: BaseException, arguments: Sequence[str]) -> int:
    """Say on stderr what has ended a command, which nobody has caught, and return its exit status."""
    if isinstance(error, MemoryError):
        complain(f"out of memory ({last_net.in_a_line(error)}); take fewer steps or record fewer signals")
        return FAILED
    if isinstance(error, ImportError) and not _is_ours(error):
        complain(f"{error.name or 'a library'} cannot be loaded: {error}; {REINSTALL}")
        return WRONG_INPUT
    for line in str(last_net.caught(error, arguments)).splitlines():
        complain(line)
    return INTERNAL


def _is_ours(error: ImportError) -> bool:
    """Return whether what could not be imported belongs to this program."""
    return (error.name or "").partition(".")[0] in OURS


@contextmanager
def _all_heard(arguments: Sequence[str]) -> Iterator[None]:
    """Let what is lost in a thread, in a callback of C or as an object ends be written to a file, too."""

    def hear(lost: Any) -> None:
        if lost.exc_value is not None and not isinstance(lost.exc_value, SystemExit | KeyboardInterrupt):
            complain(str(last_net.caught(lost.exc_value, arguments)))

    before = threading.excepthook, sys.unraisablehook
    threading.excepthook = sys.unraisablehook = hear
    try:
        yield
    finally:
        threading.excepthook, sys.unraisablehook = before
