"""What takes long and happens once on a machine is said on stderr: compiling, building."""

from __future__ import annotations

import sys

muted = False
"""Whether nothing is said: `orchestrator … --quiet`."""


def notice(message: str) -> None:
    """Say `message` on stderr."""
    if not muted:
        print(f"line-landing: {message}", file=sys.stderr, flush=True)
