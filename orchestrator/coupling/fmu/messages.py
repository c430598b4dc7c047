"""What an FMU says: bounded, whatever it floods us with, and its cause found where a call fails."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator

from orchestrator.coupling.fmu.binding import ERROR, LABELS, WARNING

MOST = 500
"""First and last messages of an FMU that are kept, each."""
OF_A_CALL = 20
"""Complaints of one call among which its cause is looked for."""
EXCEPTION = re.compile(r"(\w+\.)*\w*(Error|Exception)\b")
"""How a line begins that names an exception of Python."""


class Messages:
    """The messages of one FMU in their order, ``[warning] text``.

    Attributes
    ----------
    count, warnings : of all messages; of those of status warning or worse
    last : the last of all
    """

    def __init__(self) -> None:
        self.count = self.warnings = 0
        self._first: list[str] = []
        self._last: deque[str] = deque(maxlen=MOST)
        self._complaints: list[tuple[int, str]] = []
        self._latest = self.last = ""

    def __iter__(self) -> Iterator[str]:
        yield from self._first
        if left_out := self.count - len(self._first) - len(self._last):
            yield f"… {left_out} more messages …"
        yield from self._last

    def add(self, status: int, text: str) -> None:
        """Take a message."""
        line = f"[{LABELS[status] if 0 <= status < len(LABELS) else status}] {text}"
        self._keep(line)
        if status < WARNING:
            return
        self.warnings += 1
        self._latest = line
        if len(self._complaints) < OF_A_CALL:
            self._complaints.append((status, line))

    def print(self, text: str) -> None:
        """Take a line that the FMU has printed in its own process."""
        self._keep(f"[printed] {text}")

    def _keep(self, line: str) -> None:
        self.count += 1
        (self._first if len(self._first) < MOST else self._last).append(line)
        self.last = line

    def begin(self) -> None:
        """Note that a new call begins."""
        self._complaints.clear()

    @property
    def cause(self) -> str:
        """What was the matter, in short: the first error of the present call, else its first warning, else the last before."""
        errors = [line for status, line in self._complaints if status >= ERROR]
        warnings = [line for _, line in self._complaints]
        return gist((errors or warnings or [self._latest])[0])


def gist(message: str) -> str:
    """Return what of a message says what happened: its first line with the second, of a traceback the last one; behind the
    first an exception that a later line names."""
    lines = [line.strip() for line in message.splitlines() if line.strip()] or [""]
    if "Traceback" in lines[0]:
        return lines[-1]
    named = [line for line in lines[1:] if EXCEPTION.match(line)]
    if named:
        return f"{lines[0]}: {named[-1]}"
    return (" " if lines[0].endswith((".", ":", ";")) else "; ").join(lines[:2])
