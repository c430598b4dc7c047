"""Files of results: tables, fields, JSON; written under another name and moved into place, so that no reader ever sees
half a file."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.reading import require_file
from orchestrator.coupling.run.columns import Columns, Rows, pieces_of
from orchestrator.coupling.scratch import scratch

Table = Mapping[str, np.ndarray]
"""Columns of equal length by name; the first is ``time`` in s."""
Fields = dict[str, np.ndarray]
"""Arrays over time by name."""


IN_MEMORY = 2**26
"""Bytes of a table that is read into memory."""
LINES = 4096
"""Rows of a longer one that are read at a time."""


@contextmanager
def replacing(path: Path, *, lasting: bool = True) -> Iterator[Path]:
    """Give a name to write to; move it to `path` at the end, or remove it if the writing failed.

    What is moved is on the disk, and so is its new name: after a power cut there is the old file or the new one, whole.

    Parameters
    ----------
    lasting : False of what can be made again, as pictures are: it may be lost in a power cut
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        if lasting:
            _synced(temporary)
        os.replace(temporary, path)
        if lasting:
            _synced(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def _synced(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; where folders cannot be opened, not for these."""
    if os.name == "nt" and path.is_dir():
        return
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a file system that knows no such thing
            raise
    finally:
        os.close(handle)


def write_table(path: Path, table: Table) -> None:
    """Write `table` as CSV in FMPy's own format, piece by piece; every number reads back bit for bit."""
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as file:
        csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(table)
        for piece in pieces_of(table):
            for row in zip(*(_exact(column) for column in piece.values()), strict=True):
                file.write(",".join(row) + "\n")


def write_json(path: Path, content: Any) -> None:
    """Write `content` as JSON; NaN and infinity, which JSON has not, become null."""
    text = json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(
            text + "\n", encoding="utf-8", errors="backslashreplace"
        )  # names of files that are no text


def write_fields(path: Path, fields: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
    """Write arrays over time as HDF5, each with its attribute ``unit``.

    The file is made in memory and written as bytes: where the disk is full HDF5 itself would end the process.
    """
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w", track_order=True) as file:
        for key, values in fields.items():
            dataset = file.create_dataset(key, data=values, compression="gzip", compression_opts=1)
            dataset.attrs["unit"] = units.get(key, "1")
    write_bytes(path, image.getbuffer())


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Write bytes."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def read_table(path: Path) -> Table:
    """Return the columns of a CSV table that `RunDirectory.write_table` or FMPy wrote; of a long one, columns on disk."""
    try:
        require_file(path, "a table of results")
        with open(path, encoding="utf-8", newline="") as file:
            names = next(csv.reader(file))
            if os.fstat(file.fileno()).st_size > IN_MEMORY:
                return _on_disk(names, file)
            values = np.loadtxt(file, delimiter=",", ndmin=2).reshape(-1, len(names))
    except (OSError, StopIteration, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a table of results: {error}") from None
    return dict(zip(names, np.ascontiguousarray(values.T), strict=True))


def _on_disk(names: list[str], lines: Iterable[str]) -> Columns:
    """Return the columns of a table that is too long for memory: they are in a file that goes with them."""
    lines = iter(lines)
    with scratch() as folder:
        rows = Rows(names, folder / "rows", held=0)
        while piece := list(islice(lines, LINES)):
            rows.extend(np.loadtxt(piece, delimiter=",", ndmin=2).reshape(-1, len(names)))
        rows.flush()
    return Columns(rows, {name: name for name in names})


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; raise `InputError` if it cannot be read."""
    try:
        require_file(path, "a JSON file")
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def read_fields(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of ``fields.h5``, or none if there is no such file."""
    if not path.is_file():
        return {}
    import h5py

    try:
        with h5py.File(path) as file:
            return {str(key): np.asarray(file[key]) for key in file}
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def _exact(column: np.ndarray) -> list[str]:
    """Return the shortest texts that read back as the same numbers; flags as 0 and 1."""
    values = np.asarray(column)
    return [repr(value) for value in (values.astype(int) if values.dtype == bool else values).tolist()]


def plain(content: Any) -> Any:
    """Return `content` in JSON's types."""
    if is_dataclass(content) and not isinstance(content, type):
        return plain(asdict(content))
    if isinstance(content, Mapping):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, np.ndarray | np.generic):
        return plain(content.tolist())
    if isinstance(content, list | tuple):
        return [plain(value) for value in content]
    if isinstance(content, float):
        return content if np.isfinite(content) else None
    if isinstance(content, bool | int | str) or content is None:
        return content
    return str(content)
