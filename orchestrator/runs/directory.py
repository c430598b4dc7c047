"""A run directory: made before the run starts, it belongs to that run alone; done when its manifest says so."""

from __future__ import annotations

import platform
import subprocess
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import write_bytes, write_fields, write_json, write_table
from orchestrator.runs.going_on import conclude, let_go

PACKAGES = ("line-landing", "numpy", "scipy", "numba", "fmpy", "pythonfmu")

START_BLOCKS, START = "start.bin", "start.json"
"""What a landing leaves to be solved anew, and what is said of it (`orchestrator/runs/whatif.py`)."""


class Taken(InputError):
    """The directory is there already."""


class RunDirectory:
    """A directory that is made by one run and belongs to it alone.

    Parameters
    ----------
    path : must not exist yet; `InputError` if it does, and nothing is touched
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise Taken(f"{path}: exists already; remove it or choose another with --out") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be made: {error.strerror}; choose another with --out") from None

    @classmethod
    def within(cls, parent: RunDirectory, name: str) -> RunDirectory:
        """Return a folder in one of our own, made if need be."""
        (parent.path / name).mkdir(exist_ok=True)
        return cls.of(parent.path / name)

    @classmethod
    def of(cls, path: Path) -> RunDirectory:
        """Return a directory that is there already, and is to be written to."""
        found = cls.__new__(cls)
        found.path = path
        return found

    @classmethod
    def numbered(cls, name: str, base: Path = Path("runs")) -> RunDirectory:
        """Make ``runs/NAME-001``, or the first higher number that is free; two runs never get the same one."""
        for number in count(1):
            with suppress(Taken):
                return cls(base / f"{name}-{number:03d}")
        raise AssertionError  # numbers do not end

    def write_table(self, name: str, table: Mapping[str, np.ndarray]) -> None:
        """Write `table` as CSV in FMPy's own format; every number reads back bit for bit."""
        write_table(self.path / name, table)

    def write_json(self, name: str, content: Any) -> None:
        """Write `content` as JSON; NaN and infinity, which JSON has not, become null."""
        write_json(self.path / name, content)

    def write_fields(self, name: str, fields: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
        """Write arrays over time as HDF5, each with its attribute ``unit``."""
        write_fields(self.path / name, fields, units)

    def write_lines(self, name: str, lines: Iterable[str]) -> None:
        """Write `lines` of text."""
        write_bytes(self.path / name, "".join(f"{line}\n" for line in lines).encode())

    def write_manifest(self, content: Mapping[str, Any], error: str | None = None) -> None:
        """Write ``manifest.json``, the last file; with `error` the run is marked as incomplete.

        What was kept while the run was going on is not needed any more.
        """
        self.write_json("manifest.json", manifest(content, error))
        conclude(self.path)

    def discard(self) -> None:
        """Remove the directory if nothing was written: its run did not come to be."""
        with suppress(OSError):
            self.path.rmdir()


@contextmanager
def claimed(out: Path | str | None, name: str) -> Iterator[RunDirectory]:
    """Make the directory of a run before it starts: `out`, or a numbered one; it goes again if it stays empty.

    Parameters
    ----------
    out : must not exist yet
    name : of the scenario; names the numbered one
    """
    directory = RunDirectory(Path(out)) if out is not None else RunDirectory.numbered(name)
    try:
        yield directory
    finally:
        let_go(directory.path)
        directory.discard()


def folder_for(path: Path, option: str) -> Path:
    """Make the folder `path` that results will be written to, before they are; `InputError` where that cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{option} {path}: cannot be made a folder ({error.strerror}); choose another") from None
    return path


def manifest(content: Mapping[str, Any], error: str | None = None) -> dict[str, Any]:
    """Return what a manifest says: whether all is there, or why not; what it was made from, and under which circumstances."""
    return {"complete": error is None, "error": error, **content, **circumstances()}


def circumstances() -> dict[str, Any]:
    """Return what a run depends on beside its scenario: versions, commit, platform, date."""
    return {
        "written": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        **_program(),
        "platform": platform.platform(),
        "processor": platform.machine(),
    }


@cache
def _program() -> dict[str, Any]:
    """Return versions and commit, as they were when this process first asked."""
    versions = {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}
    return {"versions": versions, "commit": _commit()}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """Return the commit of the program's own repository, with ``+`` if files were changed since."""
    here = Path(__file__).resolve().parent
    try:
        command = ["git", "-C", str(here), "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"]
        result = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip() or None
