"""What is said on stderr, on whatever terminal: no encoding, no stray byte and no closed stream ends a command."""

from __future__ import annotations

import sys
from contextlib import suppress
from io import TextIOWrapper

MOST = 2000
"""Characters of a line; longer ones are cut."""


def complain(message: str) -> None:
    """Say on stderr what is wrong."""
    if sys.stderr is None:  # closed before the start; print would take stdout
        return
    with suppress(OSError, ValueError):  # nobody listens any more
        print(f"orchestrator: {shown(message)}", file=sys.stderr)


def shown(message: str) -> str:
    """Return a message as a terminal may see it: control characters, which FMUs and files may hold, as escapes, and cut."""
    plain = "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in message[:MOST]
    )
    return plain if len(message) <= MOST else f"{plain} … ({len(message) - MOST} more characters)"


def forgive_encodings() -> None:
    """Let what a terminal or a pipe cannot show appear as an escape, not as an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
