"""The process of an FMU: it carries out what the journal says, with the same calls as in ours."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import json
import mmap
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from orchestrator.coupling.fmu.binding import (
    ERROR,
    OK,
    WARNING,
    Call,
    Fmi2,
    Identity,
    SavedState,
    binding_of,
    finalize_python,
)
from orchestrator.coupling.fmu.channel import (
    CALL,
    DEFINE,
    ENDS,
    FINE,
    FORGET,
    GET,
    HEADER,
    MESSAGE,
    PEEK,
    PEEKED,
    RESTORE,
    RESULT,
    SAVE,
    SET,
    START,
    STEP,
    TOOK,
    WORD,
    aligned,
    frame,
)
from orchestrator.coupling.fmu.python_modules import own_modules

DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux, see prctl(2)."""
MEGABYTE = 1 << 20


@dataclass(frozen=True)
class Birth:
    """What a process needs to become that of an FMU.

    Attributes
    ----------
    identity, folder, name : of the FMU, where it is unzipped, and of the instance
    place, environment, path : working directory, environment and Python's search path of the process that wants it
    memory, files : MB that it may take, files that it may open; None: as the system has it
    """

    identity: Identity
    folder: str
    name: str
    place: str
    environment: dict[str, str]
    path: list[str]
    memory: float | None
    files: int | None

    def written(self) -> bytes:
        """Return it as JSON."""
        return json.dumps(asdict(self)).encode()

    @classmethod
    def read(cls, text: bytes) -> Birth:
        """Return what was written."""
        content = json.loads(text)
        return cls(**content | {"identity": Identity(*content["identity"])})


def live(received: int, answered: int, prints: int, shared: int) -> None:
    """Be the process of an FMU, to its end; parameters are the descriptors of `Channel.theirs`."""
    _stand_alone(prints)
    memory = mmap.mmap(shared, os.fstat(shared).st_size)
    os.close(shared)
    end = WORD.unpack(os.read(received, WORD.size) or sys.exit())[0]
    birth = Birth.read(memory[START:end])
    _settle(birth)
    life = _Life(received, answered, memory)
    with np.errstate(over="ignore", invalid="ignore"):  # as in a run within our process
        life.begin(birth)
        life.go_on()


def _stand_alone(prints: int) -> None:
    """Take leave of terminal, input and output of the process that this one is forked from, and end with it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for descriptor, standard in ((nothing, 0), (prints, 1), (prints, 2)):
        os.dup2(descriptor, standard)
    os.close(nothing)
    os.close(prints)
    sys.stdout = os.fdopen(1, "w", buffering=1, errors="replace", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="replace", closefd=False)
    _by_lines()


def _by_lines() -> None:
    """Let C write its standard output line by line too: of one that crashes the last lines would else be lost."""
    with contextlib.suppress(ValueError, AttributeError):
        library = ctypes.CDLL(None)
        line_buffered = 1
        library.setvbuf(ctypes.c_void_p.in_dll(library, "stdout"), None, line_buffered, ctypes.c_size_t(0))


def _settle(birth: Birth) -> None:
    """Take over the surroundings of the process that wants this one, and the limits."""
    os.environ.clear()
    os.environ.update(birth.environment)
    sys.path[:] = birth.path
    with contextlib.suppress(OSError):
        os.chdir(birth.place)
    _limit(birth.memory, birth.files)


def _limit(memory: float | None, files: int | None) -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if files is not None:
        _lower(resource.RLIMIT_NOFILE, files)
    if memory is not None:
        _lower(resource.RLIMIT_AS, _taken() + int(memory * MEGABYTE))


def _lower(kind: int, most: int) -> None:
    import resource

    hard = resource.getrlimit(kind)[1]
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


def _taken() -> int:
    """Return the address space that this process has by now, bytes; zero where the system does not say it."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


def _leave() -> None:
    """End this process as a program ends, but without taking Python apart, which takes longer than all the rest."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    ctypes.CDLL(None).exit(0)


class _Life:
    """Carries out one journal after the other."""

    def __init__(self, received: int, answered: int, memory: mmap.mmap):
        self.received, self.answered, self.memory = received, answered, memory
        self.base = ctypes.addressof(ctypes.c_char.from_buffer(memory))
        self.accessors: dict[int, tuple[Callable[[int], int], int]] = {}
        self.states: dict[int, SavedState] = {}
        self.kept: list[np.ndarray] = []
        self.peeked: list[tuple[int, str]] | None = None
        self.result: Any = None
        self.fmi: Fmi2
        self.folder: Path
        self.freed = False
        self.do: dict[int, Callable[..., tuple[int, int]]] = {
            DEFINE: self.define, SET: self.set, GET: self.get, PEEK: self.peek, STEP: self.step,
            SAVE: self.save, RESTORE: self.restore, FORGET: self.forget, CALL: self.call,
        }  # fmt: skip

    def begin(self, birth: Birth) -> None:
        """Load the FMU and make the instance."""
        import resource

        self.folder, before = Path(birth.folder), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        try:
            with own_modules(self.folder, ()), contextlib.chdir("."):
                self.fmi = binding_of(birth.identity.version)(birth.identity, self.folder, birth.name, self.hear)
        except Exception as error:
            self.say(RESULT, [0, ERROR, str(error)])
            sys.exit()
        self.say(RESULT, [0, OK, before])

    def go_on(self) -> None:
        """Do what is asked for, until the instance is freed or nobody wants it any more."""
        while not self.freed and (word := os.read(self.received, WORD.size)):
            self.carry_out(WORD.unpack(word)[0])
        if self.freed:
            finalize_python(self.fmi.slave.dll)
        _leave()

    def hear(self, status: int, text: str) -> None:
        """Take a message of the FMU."""
        if self.peeked is None:
            self.say(MESSAGE, [status, text])
        else:
            self.peeked.append((status, text))

    def say(self, kind: bytes, content: Any) -> None:
        """Send a frame."""
        data = frame(kind, content)
        while data:
            data = data[os.write(self.answered, data) :]

    def carry_out(self, end: int) -> None:
        """Carry out a journal; the first call that fails ends it."""
        place, number, self.result = START, 0, None
        while place < end:
            WORD.pack_into(self.memory, 0, number)
            record = HEADER.unpack_from(self.memory, place)
            place += HEADER.size
            try:
                status, size = self.do[record[0]](place, *record[1:])
            except Exception as error:
                self.hear(ERROR, f"{type(error).__name__}: {error}")
                status, size = ERROR, 0
            if status > WARNING:
                return self.say(RESULT, [number, status, None])
            place, number = place + size, number + 1
        if self.result is not None:
            return self.say(RESULT, [number - 1, OK, self.result])
        os.write(self.answered, ENDS if self.fmi.ends else FINE)

    # -- records: each returns the status and the bytes of its payload --------------------------------------

    def define(self, place: int, key: int, size: int, *_: float) -> tuple[int, int]:
        verb, kind, dtype, vr, values = json.loads(self.memory[place : place + size])
        buffer = np.zeros(values, dtype=dtype)
        references = np.array(vr, dtype=np.uint32)
        call = self.fmi.accessor(verb, kind, references, buffer)
        self.accessors[key] = self._moved(verb, call, buffer), aligned(buffer.nbytes)
        self.kept += [references, buffer]  # the call knows their addresses alone
        return OK, aligned(size)

    def _moved(self, verb: str, call: Call, buffer: np.ndarray) -> Callable[[int], int]:
        """Return what makes a call with the values at a place of the shared memory."""
        base, address, size, move = self.base, buffer.ctypes.data, buffer.nbytes, ctypes.memmove

        def set_from(place: int) -> int:
            move(address, base + place, size)
            return call()

        def get_into(place: int) -> int:
            status = call()
            move(base + place, address, size)
            return status

        return set_from if verb == "Set" else get_into

    def set(self, place: int, key: int, *_: float) -> tuple[int, int]:
        call, size = self.accessors[key]
        return call(place), size

    def get(self, place: int, key: int, into: int, *_: float) -> tuple[int, int]:
        return self.accessors[key][0](into), 0

    def peek(self, place: int, key: int, into: int, *_: float) -> tuple[int, int]:
        self.peeked = []
        status = self.accessors[key][0](into)
        heard, self.peeked = self.peeked, None
        if heard or status > WARNING:
            self.say(PEEKED, [key, status, heard])
        return OK, 0

    def step(self, place: int, key: int, none_before: int, t: float, h: float) -> tuple[int, int]:
        clock = perf_counter()
        status = self.fmi.do_step(t, h, bool(none_before))
        TOOK.pack_into(self.memory, 8, perf_counter() - clock)
        return status, 0

    def save(self, place: int, key: int, *_: float) -> tuple[int, int]:
        state = SavedState()
        status = self.fmi.get_state(state)
        if status <= WARNING:
            self.states[key] = state
        return status, 0

    def restore(self, place: int, key: int, *_: float) -> tuple[int, int]:
        if key not in self.states:
            self.hear(ERROR, "the state to go back to could not be saved")
            return ERROR, 0
        return self.fmi.set_state(self.states[key]), 0

    def forget(self, place: int, key: int, *_: float) -> tuple[int, int]:
        state = self.states.pop(key, None)
        if state is not None:
            self.fmi.free_state(state)
        return OK, 0

    def call(self, place: int, key: int, size: int, *_: float) -> tuple[int, int]:
        name, *arguments = json.loads(self.memory[place : place + size])
        result = DERIVED[name](self.fmi, *arguments) if name in DERIVED else getattr(self.fmi, name)(*arguments)
        self.freed = name == "free"
        if isinstance(result, int) and not isinstance(result, bool):
            return result, aligned(size)
        self.result = result
        return OK, aligned(size)


def _derivative(fmi: Fmi2, unknown: list[int], known: list[int], seed: list[float], size: int) -> list[Any]:
    """Return the status of a directional derivative, and the derivative."""
    out = np.zeros(size)
    of, by = (np.array(vr, dtype=np.uint32) for vr in (unknown, known))
    status = fmi.directional_derivative(of, by, np.array(seed), out)
    return [status, out.tolist()]


DERIVED: dict[str, Callable[..., Any]] = {"directional_derivative": _derivative}
"""Calls that fill arrays."""
