"""A run directory: tables, fields, summary, and last the manifest. A run is done when its manifest says so.

Every file is written under another name and moved into place, so that no reader ever sees half a file.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import platform
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError

Table = dict[str, np.ndarray]
"""Columns of equal length by name; the first is ``time`` in s."""

PACKAGES = ("line-landing", "numpy", "scipy", "numba", "fmpy", "pythonfmu")


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
            raise InputError(f"{path}: exists already; remove it or choose another with --out") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be made: {error.strerror}; choose another with --out") from None

    def write_table(self, name: str, table: Mapping[str, np.ndarray]) -> None:
        """Write `table` as CSV in FMPy's own format; every number reads back bit for bit."""
        with replacing(self.path / name) as temporary, open(temporary, "w", encoding="utf-8") as file:
            csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(table)
            for row in zip(*(_exact(column) for column in table.values()), strict=True):
                file.write(",".join(row) + "\n")

    def write_json(self, name: str, content: Any) -> None:
        """Write `content` as JSON; NaN and infinity, which JSON has not, become null."""
        text = json.dumps(_plain(content), indent=2, ensure_ascii=False, allow_nan=False)
        with replacing(self.path / name) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    def write_fields(self, name: str, fields: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
        """Write arrays over time as HDF5, each with its attribute ``unit``."""
        import h5py

        with replacing(self.path / name) as temporary, h5py.File(temporary, "w") as file:
            for key, values in fields.items():
                dataset = file.create_dataset(key, data=values, compression="gzip", compression_opts=1)
                dataset.attrs["unit"] = units.get(key, "1")

    def write_manifest(self, content: Mapping[str, Any], error: str | None = None) -> None:
        """Write ``manifest.json``, the last file; with `error` the run is marked as incomplete."""
        self.write_json("manifest.json", {"complete": error is None, "error": error, **content, **circumstances()})


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a name to write to; move it to `path` at the end, or remove it if the writing failed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def default_directory(name: str, base: Path = Path("runs")) -> Path:
    """Return ``runs/NAME-001``, or the first higher number that is free."""
    number = 1
    while (base / f"{name}-{number:03d}").exists():
        number += 1
    return base / f"{name}-{number:03d}"


def read_table(path: Path) -> Table:
    """Return the columns of a CSV table that `RunDirectory.write_table` or FMPy wrote."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            names = next(csv.reader(file))
            values = np.loadtxt(file, delimiter=",", ndmin=2).reshape(-1, len(names))
    except (OSError, StopIteration, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a table of results: {error}") from None
    return dict(zip(names, np.ascontiguousarray(values.T), strict=True))


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; raise `InputError` if it cannot be read."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def read_fields(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of ``fields.h5``, or none if there is no such file."""
    if not path.is_file():
        return {}
    import h5py

    with h5py.File(path) as file:
        return {str(key): np.asarray(file[key]) for key in file}


def circumstances() -> dict[str, Any]:
    """Return what a run depends on beside its scenario: versions, commit, platform, date."""
    return {
        "written": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "versions": {"python": platform.python_version(), **{p: _version(p) for p in PACKAGES}},
        "commit": _commit(),
        "platform": platform.platform(),
        "processor": platform.machine(),
    }


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _exact(column: np.ndarray) -> list[str]:
    """Return the shortest texts that read back as the same numbers; flags as 0 and 1."""
    values = np.asarray(column)
    return [repr(value) for value in (values.astype(int) if values.dtype == bool else values).tolist()]


def _plain(content: Any) -> Any:
    """Return `content` in JSON's types."""
    if is_dataclass(content) and not isinstance(content, type):
        return _plain(asdict(content))
    if isinstance(content, Mapping):
        return {str(key): _plain(value) for key, value in content.items()}
    if isinstance(content, np.ndarray | np.generic):
        return _plain(content.tolist())
    if isinstance(content, list | tuple):
        return [_plain(value) for value in content]
    if isinstance(content, float):
        return content if np.isfinite(content) else None
    if isinstance(content, bool | int | str) or content is None:
        return content
    return str(content)


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
