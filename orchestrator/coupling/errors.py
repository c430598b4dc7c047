"""Errors a user can act on: each names the place, the cause and the cure, and knows its exit status."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

DONE, MISSED, WRONG_INPUT, FAILED, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 70, 130
"""Exit status: done; done, but a tolerance or safety limit is missed; wrong input; run failed; fault of ours; Ctrl-C."""
SIGNALLED = 128
"""Exit status of a process that a signal has ended, less the signal's number."""
FORWARD = "take gauss_seidel, which never goes back; with contact a macro step of 1 ms, halved until no energy drifts"
"""What works where an FMU cannot save its state (docs/notebook/masters.md)."""


class OrchestratorError(Exception):
    """Base of all errors that end a command with a message instead of a traceback."""

    exit_status = FAILED


class InputError(OrchestratorError):
    """Wrong input, found before anything was written.

    Parameters
    ----------
    problems : one line each; all that were found, so that they can be mended at once
    """

    exit_status = WRONG_INPUT

    def __init__(self, problems: str | Iterable[str]):
        self.problems = [problems] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(self.problems))


class RunError(OrchestratorError):
    """The run failed while it was going on; `time` (s) is how far it came."""

    exit_status = FAILED

    def __init__(self, message: str, time: float = float("nan")):
        self.time = time
        super().__init__(message)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ``; did you mean mass?`` for the known name nearest to `name`, or an empty string."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else ""


def digits(number: float) -> str:
    """Return a number with all its digits, so that it can be typed: ``0.016666666666666666``, ``10``."""
    return repr(float(number)).removesuffix(".0")
