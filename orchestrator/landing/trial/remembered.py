"""Verdicts of trials, kept by the content of the FMU, so that a landing can say of a foreign one what is known of it."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

from orchestrator.coupling.cache import user_folder
from orchestrator.coupling.run.results import write_json

KIND = "trials"


def remember(sha256: str, kind: str, failed: list[str]) -> None:
    """Keep which findings of a trial as `kind` have failed, of the FMU with that content, where there is a place for it."""
    with contextlib.suppress(OSError):
        write_json(_file(sha256, kind), {"failed": failed})


def said(sha256: str, kind: str, path: Path) -> str:
    """Return what is to be said of a foreign FMU before it lands; empty if it has passed its trial."""
    try:
        failed = json.loads(_file(sha256, kind).read_text(encoding="utf-8"))["failed"]
    except (OSError, ValueError, KeyError, TypeError):
        return f"{kind}: whether {path.name} does what its variables promise is not known; `orchestrator check --run {path}`"
    if not failed:
        return ""
    return f"{kind}: {path.name} has failed its trial ({', '.join(failed)}); `orchestrator check --run {path}` says why"


def _file(sha256: str, kind: str) -> Path:
    return user_folder(KIND) / f"{sha256}-{kind}.json"
