"""Rows that grow while a run goes on, and their columns by name: in memory, or on disk where they are too many for it."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from orchestrator.coupling.run.spool import Spool

HELD = 2**26
"""Bytes of rows that are held in memory if nothing else is said."""
PIECE = 2**19
"""Bytes of the rows that are written at a time, about."""


class Rows:
    """Rows of numbers, one after another; with a file they go to disk as they come.

    Parameters
    ----------
    names : of the columns
    path : of the file; None: all is kept in memory
    held : bytes of rows that are held in memory where there is a file; more are read from there

    Attributes
    ----------
    places : place of each column, by its name
    failure : why rows could not be written; `add` raises it
    """

    def __init__(self, names: Sequence[str], path: Path | None = None, held: int | None = None):
        self.names = list(names)
        self.failure: Exception | None = None
        self.places = {name: place for place, name in enumerate(self.names)}
        self._open = np.empty((_rows_of_a_piece(len(self.names)), len(self.names)))
        self._filled = self._written = self._done = 0  # rows of the open piece, of these on disk; rows of pieces
        self._held: list[np.ndarray] | None = None if held == 0 and path is not None else []
        self._most = HELD if held is None else held
        self._spool = None if path is None else Spool(path, self.names)
        self._lock = threading.Lock()

    @classmethod
    def read(cls, path: Path) -> Rows:
        """Return the rows of a file; more are not added to it."""
        spool = Spool(path)
        found = cls(spool.names)
        found._spool, found._held, found._done = spool, None, len(spool)
        return found

    def __len__(self) -> int:
        return self._done + self._filled

    @property
    def next(self) -> np.ndarray:
        """The row (columns,) to be filled; it counts when it is added."""
        return self._open[self._filled]

    def add(self) -> None:
        """Count the row that was filled; `OSError` where rows cannot be written."""
        self._filled += 1
        if self.failure is not None:
            raise self.failure
        if self._filled == len(self._open):
            self._next_piece()

    def extend(self, rows: np.ndarray) -> None:
        """Add rows (k, columns)."""
        for row in rows:
            self.next[:] = row
            self.add()

    def flush(self) -> None:
        """Write the rows that were added; a failure is kept for `add`."""
        with self._lock:
            self._flush()

    def _flush(self) -> None:
        first, end = self._written, self._filled
        if self._spool is None or first == end or self.failure is not None:
            return
        try:
            self._spool.append(self._open[first:end])
            self._written = end
        except (OSError, ValueError) as error:  # ValueError: the file was closed
            self.failure = error

    def _next_piece(self) -> None:
        with self._lock:
            self._flush()
            if self.failure is not None:
                raise self.failure
            if self._held is not None:
                self._held.append(self._open.copy())
            self._done += self._filled
            self._filled = self._written = 0
            if self._spool is not None and self._done * self._open.itemsize * len(self.names) > self._most:
                self._held = None

    @property
    def is_held(self) -> bool:
        """Whether all is in memory."""
        return self._held is not None

    def array(self) -> np.ndarray:
        """Return all rows (n, columns)."""
        if self._held is None:
            return np.concatenate([*self.pieces()])
        if self._held:
            self._held = [np.concatenate(self._held)]
        return np.concatenate([*self._held, self._open[: self._filled]])

    def column(self, name: str) -> np.ndarray:
        """Return a column by its name, (n,)."""
        place = self.places[name]
        if self._held is None and self._spool is not None:
            start = self._spool.column(place)
            unwritten = self._open[self._written : self._filled, place]
            return np.concatenate([start, unwritten]) if unwritten.size else start
        return np.concatenate([piece[:, place] for piece in self.pieces()])

    def row(self, index: int) -> np.ndarray:
        """Return one row, (columns,); `IndexError` where there is none."""
        left = range(len(self))[index]
        for piece in self.pieces():
            if left < len(piece):
                return piece[left]
            left -= len(piece)
        raise IndexError(index)

    def pieces(self) -> Iterator[np.ndarray]:
        """Yield all rows piece by piece, (k, columns) each."""
        if self._held is None and self._spool is not None:
            yield from self._spool.pieces()
            yield self._open[self._written : self._filled]
        else:
            yield from self._held or ()
            yield self._open[: self._filled]

    def release(self) -> None:
        """Close the file if all is in memory: it is not needed any more."""
        if self._held is not None and self._spool is not None:
            self._spool.close()
            self._spool = None


class Columns(Mapping[str, np.ndarray]):
    """Columns of rows by name, each read from them when it is asked for, and not kept.

    Parameters
    ----------
    names : what a column is called here → its name in `rows`
    kinds : types of the columns that are no real numbers
    """

    def __init__(self, rows: Rows, names: Mapping[str, str], kinds: Mapping[str, type] | None = None):
        self.rows, self.names, self.kinds = rows, dict(names), dict(kinds or {})

    def __getitem__(self, name: str) -> np.ndarray:
        return self._typed(name, self.rows.column(self.names[name]))

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __repr__(self) -> str:
        return f"Columns({len(self)} of {len(self.rows)} rows: {', '.join(self.names)})"

    def _typed(self, name: str, values: np.ndarray) -> np.ndarray:
        return values.astype(self.kinds[name]) if name in self.kinds else values

    def loaded(self) -> dict[str, np.ndarray]:
        """Return all of them in memory."""
        values, places = self.rows.array(), self.rows.places
        return {name: self._typed(name, values[:, places[stored]]) for name, stored in self.names.items()}

    def among(self, names: Sequence[str]) -> Columns:
        """Return those of them that are named."""
        return Columns(self.rows, {name: self.names[name] for name in names}, self.kinds)

    def of_kinds(self, kinds: Mapping[str, type]) -> Columns:
        """Return them with other types."""
        return Columns(self.rows, self.names, kinds)

    def pieces(self) -> Iterator[dict[str, np.ndarray]]:
        """Yield all columns piece by piece."""
        for piece in self.rows.pieces():
            yield {n: self._typed(n, piece[:, self.rows.places[stored]]) for n, stored in self.names.items()}


def _rows_of_a_piece(columns: int) -> int:
    return max(16, min(4096, PIECE // (8 * max(columns, 1))))


def pieces_of(table: Mapping[str, np.ndarray]) -> Iterator[Mapping[str, np.ndarray]]:
    """Yield the rows of a table piece by piece."""
    if isinstance(table, Columns):
        yield from table.pieces()
        return
    size = _rows_of_a_piece(len(table))
    for first in range(0, max(map(len, table.values()), default=0), size):
        yield {name: values[first : first + size] for name, values in table.items()}


def some_of(table: Mapping[str, np.ndarray], names: Sequence[str]) -> Mapping[str, np.ndarray]:
    """Return the columns of a table that are named; those on disk stay there."""
    return table.among(names) if isinstance(table, Columns) else {name: table[name] for name in names}
