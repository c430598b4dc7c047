"""Rows of numbers that go to disk as they come: a file of NumPy arrays one after another, which any NumPy reads.

The first array holds the names of the columns, each other one a piece of the rows, (columns, rows). A file is added to at
its end alone, so that one whose writer was killed holds all that was written; a piece that was cut short is passed over.

    with open("signals.part", "rb") as file:
        names, first = np.load(file), np.load(file)
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Protocol, Self

import numpy as np
from numpy.lib import format as npy

INTERVAL = 0.4
"""s of wall time after which what has come is written; so much at most is lost when the process is killed, and the time of
writing."""


class Spool:
    """A file of rows; what is written can be read at once.

    Parameters
    ----------
    path : must not exist yet where `names` are given
    names : of the columns of a new file; None: the file is there, and is only read

    Attributes
    ----------
    names : of the columns
    """

    def __init__(self, path: Path, names: Sequence[str] | None = None):
        self._pieces: list[tuple[int, int]] = []  # (place of the numbers in the file, rows)
        self._rows = 0
        self._file: BinaryIO = open(path, "rb" if names is None else "x+b", buffering=0)  # noqa: SIM115 (closed by `close`)
        if names is None:
            self.names, self._end = self._scanned(path)
        else:
            self.names, self._end = list(names), 0
            self._append(np.array(self.names, dtype=np.str_))

    def __len__(self) -> int:
        return self._rows

    def append(self, rows: np.ndarray) -> None:
        """Write `rows` (k, columns) as one piece; where that fails (a full disk) the file stays as it was."""
        place = self._append(np.ascontiguousarray(rows.T))
        self._pieces.append((place, len(rows)))
        self._rows += len(rows)

    def column(self, place: int) -> np.ndarray:
        """Return the column at `place`, (rows,)."""
        found, first = np.empty(self._rows), 0
        for offset, count in self._pieces:
            self._read(found[first : first + count], offset + 8 * place * count)
            first += count
        return found

    def pieces(self) -> Iterator[np.ndarray]:
        """Yield the rows piece by piece, (k, columns) each."""
        for offset, count in self._pieces:
            piece = np.empty((len(self.names), count))
            self._read(piece, offset)
            yield piece.T

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __del__(self) -> None:
        if hasattr(self, "_file"):
            self.close()

    def _append(self, array: np.ndarray) -> int:
        """Write an array at the end; return where its numbers begin."""
        buffer = io.BytesIO()
        np.save(buffer, array, allow_pickle=False)
        place = self._end + buffer.tell() - array.nbytes
        try:
            self._file.seek(self._end)
            write_all(self._file, buffer.getbuffer())
        except OSError as error:
            self._file.truncate(self._end)
            raise OSError(error.errno, error.strerror, str(self._file.name)) from None
        self._end += buffer.tell()
        return place

    def _read(self, into: np.ndarray, place: int) -> None:
        """Fill an array with what stands at `place`."""
        self._file.seek(place)
        if self._file.readinto(into) != into.nbytes:  # pyright: ignore[reportAttributeAccessIssue]
            raise OSError(f"{self._file.name}: was cut short while it was read")

    def _scanned(self, path: Path) -> tuple[list[str], int]:
        """Find the pieces of a file; return the names of its columns and where its last whole piece ends."""
        size = os.fstat(self._file.fileno()).st_size
        try:
            names = np.load(self._file, allow_pickle=False).tolist()
        except (ValueError, EOFError) as error:
            raise OSError(f"{path}: no names of columns ({error})") from None
        end = self._file.tell()
        with suppress(ValueError, EOFError):  # of a piece that was cut short
            while end < size and (piece := _header(self._file)) is not None:
                (columns, rows), place = piece, self._file.tell()
                end = place + 8 * columns * rows
                if columns != len(names) or end > size:
                    break
                self._pieces.append((place, rows))
                self._rows += rows
                self._file.seek(end)
        return names, end


def _header(file: BinaryIO) -> tuple[int, int] | None:
    """Return the shape of the array that begins here; None where it is not one of ours."""
    if npy.read_magic(file) != (1, 0):
        return None
    shape, fortran, kind = npy.read_array_header_1_0(file)
    return (shape[0], shape[1]) if len(shape) == 2 and not fortran and kind == np.float64 else None


def write_all(file: BinaryIO, content: memoryview) -> None:
    """Write all of `content` to an unbuffered file, which may take less of it at a time."""
    while content.nbytes:
        content = content[file.write(content) :]


class Flushed(Protocol):
    """What can be written now."""

    def flush(self) -> None:
        """Write what has come since the last time."""
        ...


class Saving:
    """Has what has come written every `INTERVAL`, whatever the run is doing meanwhile, and once more at the end.

    A failure is kept by what is written, which says it to who adds to it.
    """

    def __init__(self, *written: Flushed):
        self._written, self._end = written, threading.Event()
        self._thread = threading.Thread(target=self._work, name="saving", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._thread.join()
        self._save()

    def _work(self) -> None:
        while not self._end.wait(INTERVAL):
            self._save()

    def _save(self) -> None:
        for one in self._written:
            one.flush()
