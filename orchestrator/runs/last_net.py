"""What nobody has caught: a fault of this program. It ends with a status of its own, and leaves a file that says what it was.

Standard library only, so that it is there when an import fails.
"""

from __future__ import annotations

import os
import platform
import sys
import time
import traceback
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from orchestrator.coupling.cache import prune, user_folder
from orchestrator.coupling.errors import INTERNAL, OrchestratorError

KIND = "crashes"
"""Folder of the files among the user's, `orchestrator.coupling.cache`."""
PACKAGES = ("line-landing", "numpy", "scipy", "numba", "llvmlite", "fmpy", "pythonfmu", "pydantic", "typer", "h5py")
TOLD = ("LINE_LANDING_", "NUMBA_", "OPENBLAS_", "OMP_", "PYTHON", "LANG", "LC_", "XDG_CACHE_HOME")
"""How the names of environment variables begin that stand in the file."""


noted: list[str] = []
"""What faults of this program runs in workers have met, since the command began."""


class InternalError(OrchestratorError):
    """A fault of this program; the message names the file that says what it was."""

    exit_status = INTERNAL


def caught(error: BaseException, arguments: Sequence[str] = ()) -> InternalError:
    """Write what happened into a file of the user's, and return the error that names it."""
    found = f"internal error, {in_a_line(error)}"
    text = report(error, arguments)
    try:
        return InternalError(f"{found}; please report it with {_written(text)}")
    except OSError as why:  # nowhere to write to: the text itself is all that is left
        return InternalError(f"{found}; please report it with what follows, no file could be written ({why})\n{text}")


def in_a_line(error: BaseException) -> str:
    """Return kind and first line of an exception, in short."""
    first = next(iter(str(error).splitlines()), "")
    return f"{type(error).__name__}: {first[:200]}" if first else type(error).__name__


def report(error: BaseException, arguments: Sequence[str]) -> str:
    """Return what whoever mends it needs to know: command line, versions, platform, traceback."""
    environment = {name: value for name, value in sorted(os.environ.items()) if name.startswith(TOLD)}
    lines = [
        f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')}, process {os.getpid()}",
        f"command line: {[sys.argv[0] if sys.argv else '', *arguments]}",
        f"folder: {_current()}",
        f"platform: {platform.platform()}, {platform.machine()}; Python {sys.version} in {sys.executable}",
        f"versions: {', '.join(f'{name} {_version(name)}' for name in PACKAGES)}",
        f"environment: {environment}",
        "",
        "".join(traceback.format_exception(error)),
    ]
    return "\n".join(lines)


def _current() -> str:
    try:
        return os.getcwd()
    except OSError as error:
        return f"none ({error.strerror})"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "missing"


def _written(text: str) -> Path:
    """Write a new file that nobody else can read, and return it; old ones are removed."""
    folder = user_folder(KIND)
    prune(folder)
    path = folder / f"{time.strftime('%Y%m%dT%H%M%S')}-{os.getpid()}-{time.monotonic_ns() % 10**6:06d}.txt"
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(text.encode("utf-8", "backslashreplace"))
    return path
