"""What our process and that of an FMU say to each other: a journal in shared memory, and pipes that wake the reader.

A request is a list of records that are carried out in their order; eight bytes through a pipe say where it ends. What needs no
answer at once (inputs set, states saved and taken back) waits for the next call that does, so that a step with its inputs
and outputs is one exchange. The answer is one byte if all went well, else frames: a letter, a length, JSON. Nothing that
comes from there is executed or trusted to be whole.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import select
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from struct import Struct
from time import perf_counter
from typing import Any

HEADER = Struct("=iiqdd")
"""Of a record: what is done, its key, a whole number, t and h (s)."""
DEFINE, SET, GET, PEEK, STEP, SAVE, RESTORE, FORGET, CALL = range(9)
"""What is done. PEEK is a GET that nobody has asked for yet: it spoils nothing if it fails."""
WORD, TOOK, START = Struct("=q"), Struct("=d"), 64
"""Places in the shared memory: 0, the number of the record that is being carried out; 8, s that the last step took; `START`,
the first record."""
FINE, ENDS = b".", b"e"
"""All went well; and the FMU asks for the end of the simulation."""
MESSAGE, PEEKED, RESULT = b"M", b"P", b"R"
FRAME = Struct("=cI")
JOURNAL, CHUNK, SLICE_MS = 1 << 20, 1 << 12, 250.0
"""Least bytes of the journal; most that are read at once; ms that are waited without a look around."""


class Ended(Exception):
    """The process has ended, or says what has no sense."""


class TooLate(Exception):
    """There is no answer in time."""


_waiting: list[Callable[[float], None]] = []


@contextmanager
def waiting(call: Callable[[float], None]) -> Iterator[None]:
    """Let `call` be made, with the time of the FMU (s), again and again while the answer of one is waited for.

    What it raises gives the FMU up: its process is ended.
    """
    _waiting.append(call)
    try:
        yield
    finally:
        _waiting.remove(call)


def aligned(size: int) -> int:
    """Return the next multiple of eight bytes."""
    return -(-size // 8) * 8


def shared_memory(size: int) -> int:
    """Return the descriptor of anonymous memory that can be given to another process."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("fmu")
    else:
        descriptor, path = tempfile.mkstemp()
        os.unlink(path)
    os.truncate(descriptor, size)
    return descriptor


def frame(kind: bytes, content: Any) -> bytes:
    """Return a part of an answer that is more than one byte."""
    text = json.dumps(content).encode()
    return FRAME.pack(kind, len(text)) + text


def parted(data: bytes) -> tuple[list[tuple[bytes, bytes]], bytes]:
    """Return kind and content of each whole frame in `data`, and what is left; `Ended` where it has no sense."""
    found: list[tuple[bytes, bytes]] = []
    while data:
        if data[:1] in (FINE, ENDS):
            found.append((data[:1], b""))
            data = data[1:]
            continue
        if len(data) < FRAME.size:
            break
        kind, length = FRAME.unpack_from(data)
        if kind not in (MESSAGE, PEEKED, RESULT):
            raise Ended
        if len(data) < FRAME.size + length:
            break
        found.append((kind, data[FRAME.size : FRAME.size + length]))
        data = data[FRAME.size + length :]
    return found, data


class Channel:
    """Our end of it.

    Parameters
    ----------
    largest : bytes of all variables of the FMU together
    printed : receives the lines that the process prints
    time : returns the time of the FMU, s

    Attributes
    ----------
    memory : journal, then answers
    answers, size : where the latter begin, and where they end
    timeout : s that an answer may take; None: as long as it likes
    """

    def __init__(self, largest: int, printed: Callable[[str], None], time: Callable[[], float]):
        self.answers = START + aligned(JOURNAL + 2 * largest)
        self.size = self.answers + aligned(JOURNAL + 2 * largest)
        self.shared = shared_memory(self.size)
        self.memory = mmap.mmap(self.shared, self.size)
        self.timeout: float | None = None
        self.end, self.deadline = START, 0.0
        self._end: int | None = None
        self._printed, self._time, self._text = printed, time, b""
        self._received, self._requests = os.pipe()
        self._inbox, self._answered = os.pipe()
        self._lines, self._prints = os.pipe()
        self._poll = select.poll()
        for descriptor in (self._inbox, self._lines):
            self._poll.register(descriptor, select.POLLIN)

    @property
    def theirs(self) -> list[int]:
        """The descriptors for the other process: where it reads, answers and prints, and the memory."""
        return [self._received, self._answered, self._prints, self.shared]

    def handed_over(self, pid: int) -> None:
        """Note that the process `pid` has its descriptors."""
        for descriptor in self.theirs:
            os.close(descriptor)
        with contextlib.suppress(OSError, AttributeError):  # it tells of an end even if others keep the pipes open
            self._end = os.pidfd_open(pid)
            self._poll.register(self._end, select.POLLIN)

    def begin_with(self, text: bytes) -> None:
        """Put down what the process lives by."""
        self.memory[START : START + len(text)] = text
        self.end = START + len(text)

    def put(self, what: int, key: int = 0, number: int = 0, t: float = 0.0, h: float = 0.0) -> None:
        """Add a record."""
        HEADER.pack_into(self.memory, self.end, what, key, number, t, h)
        self.end += HEADER.size

    def put_with(self, what: int, key: int, number: int, payload: Any, size: int) -> None:
        """Add a record with `payload`, anything that has its `size` in bytes in one piece."""
        self.put(what, key, number)
        self.memory[self.end : self.end + size] = payload
        self.end += aligned(size)

    def room(self, size: int) -> bool:
        """Return whether a record with `size` bytes finds place in the journal."""
        return self.end + HEADER.size + aligned(size) <= self.answers

    @property
    def at(self) -> int:
        """The number of the record that is being carried out."""
        return WORD.unpack_from(self.memory, 0)[0]

    @property
    def took(self) -> float:
        """Wall time of the last step, s."""
        return TOOK.unpack_from(self.memory, 8)[0]

    def send(self) -> None:
        """Let the journal be carried out."""
        end, self.end = self.end, START
        if self.timeout is not None:
            self.deadline = perf_counter() + self.timeout
        try:
            os.write(self._requests, WORD.pack(end))
        except BrokenPipeError:
            raise Ended from None

    def receive(self) -> bytes:
        """Return bytes of the answer.

        Raises
        ------
        Ended, TooLate
        """
        inbox = self._inbox
        while True:
            ready = self._poll.poll(SLICE_MS if self.timeout is None else self._patience())
            if len(ready) != 1 or ready[0][0] != inbox:  # seldom
                self._look_around({descriptor for descriptor, _ in ready})
            if inbox in (descriptor for descriptor, _ in ready):
                data = os.read(inbox, CHUNK)
                if data:
                    return data
                raise Ended

    def _patience(self) -> float:
        """Return how long to wait in one go, ms."""
        return min(SLICE_MS, max(1e3 * (self.deadline - perf_counter()), 0.0))

    def _look_around(self, ready: set[int]) -> None:
        """Listen to what is printed; see whether the process is there."""
        if self._lines in ready:
            self._listen()
        elif ready and self._inbox not in ready:
            raise Ended
        self.require_patience()

    def require_patience(self) -> None:
        """Raise `TooLate` if the time for an answer is over; ask who waits whether to go on."""
        if self.timeout is not None and perf_counter() >= self.deadline:
            raise TooLate
        for call in _waiting:
            call(self._time())

    def _listen(self) -> None:
        """Take what the process prints, line by line."""
        data = os.read(self._lines, CHUNK)
        if not data:
            self._poll.unregister(self._lines)
        *lines, self._text = (self._text + data).split(b"\n")
        if len(self._text) > CHUNK or (not data and self._text):
            lines, self._text = [*lines, self._text], b""
        for line in lines:
            self._printed(line.decode("utf-8", "replace"))

    def last_words(self) -> None:
        """Take what is left of what the process has printed."""
        while self._lines in (descriptor for descriptor, _ in self._poll.poll(0)):
            self._listen()
        if self._text:
            self._printed(self._text.decode("utf-8", "replace"))

    def hang_up(self) -> None:
        """Say that nothing more will be asked."""
        if self._requests >= 0:
            os.close(self._requests)
            self._requests = -1

    def close(self) -> None:
        """Close our end."""
        self.hang_up()
        for descriptor in (self._inbox, self._lines, self._end):
            if descriptor is not None:
                os.close(descriptor)
