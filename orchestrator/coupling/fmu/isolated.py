"""The FMI calls of an instance that lives in a process of its own; for its callers they are those of one in ours.

Whatever the FMU does to its process, ours goes on: a call during which it ends, or takes too long, comes back with `LOST`.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from orchestrator.coupling.fmu.binding import LOST, OK, WARNING, Call, Identity, SavedState, binding_of
from orchestrator.coupling.fmu.channel import (
    CALL,
    DEFINE,
    ENDS,
    FINE,
    FORGET,
    GET,
    MESSAGE,
    PEEK,
    PEEKED,
    RESTORE,
    RESULT,
    SAVE,
    SET,
    STEP,
    Channel,
    Ended,
    TooLate,
    aligned,
    parted,
)
from orchestrator.coupling.fmu.child import Birth
from orchestrator.coupling.fmu.failure import CRASHED, TIMEOUT, FmuError
from orchestrator.coupling.fmu.messages import Messages
from orchestrator.coupling.fmu.nursery import PATIENCE, Process, born

KEPT = 4
"""Steps for which values are read ahead that somebody has read after one."""


@dataclass(frozen=True)
class Limits:
    """What an FMU in a process of its own may take; None: as much as it likes.

    Attributes
    ----------
    timeout : s of wall time for a call
    memory : MB beyond those of a process that has loaded nothing yet
    files : that it may have open, standard streams and libraries at work included
    """

    timeout: float | None = None
    memory: float | None = None
    files: int | None = None


class Owner(Protocol):
    """What is asked of the FMU: its log, and the errors of calls whose answer comes with that of a later one.

    Attributes
    ----------
    fate : status and words of the end of its process, once it has ended
    """

    log: Messages
    time: float
    fate: tuple[int, str] | None

    def error(self, status: int, doing: str) -> FmuError:
        """Return the error for a call that came back with `status`."""
        ...

    def state_error(self, status: int, doing: str) -> FmuError:
        """Return the error for a state that cannot be saved or taken back."""
        ...


Late = Callable[[int], FmuError]
"""The error of a call whose answer comes with that of a later one."""


class _Read:
    """Values that can be read: where they come to, and for which state of the instance they are there already."""

    __slots__ = ("data", "error", "heard", "key", "of", "place", "status", "wanted")

    def __init__(self, key: int, place: int, data: np.ndarray, error: Late):
        self.key, self.place, self.data, self.error = key, place, data, error
        self.of, self.wanted, self.status = -1, -KEPT - 1, OK
        self.heard: list[tuple[int, str]] = []


class Isolated:
    """Calls of one instance; parameters as for `Fmi2`.

    Sets, saves and their like are carried out with the next call whose answer is wanted; what they come back with is raised
    there. Values that were read after one of the last steps are read along with a step.

    Parameters
    ----------
    largest : bytes of all variables together
    """

    python = False

    def __init__(self, identity: Identity, folder: Path, name: str, owner: Owner, largest: int, limits: Limits):
        self.TYPES = binding_of(identity.version).TYPES
        self.limits, self._owner = limits, owner
        self.ends = self._begun = self._saved = False
        self._due: list[Late | None] = []
        self._numbers, self._keys = count(1), dict[tuple, Any]()
        self._saving, self._restoring = (partial(owner.state_error, doing=f"{what} the state") for what in _STATES)
        self._freeing = partial(owner.error, doing="freeing a state")
        self._reads: dict[int, _Read] = {}
        self._reading: list[_Read] = []
        self._state, self._step, self._stepped = 0, 0, -1
        self._result: Any = None
        self._channel = Channel(largest, owner.log.print, lambda: owner.time)
        self._channel.timeout = limits.timeout
        self._common = self._channel.answers
        self._free_place = self._common + aligned(largest)
        self._process = self._born(identity, folder, name)
        self._memory_at_birth = 0.0
        self._require_loaded()

    def _born(self, identity: Identity, folder: Path, name: str) -> Process:
        channel, limits = self._channel, self.limits
        surroundings = os.getcwd(), dict(os.environ), sys.path
        text = Birth(identity, str(folder), name, *surroundings, limits.memory, limits.files).written()
        process = born(channel.theirs)
        channel.handed_over(process.pid)
        channel.begin_with(text)
        self._due.append(None)
        return process

    def _require_loaded(self) -> None:
        status = self._exchange()
        if status == OK:
            self._memory_at_birth = float(self._result)
        if status == LOST:
            error = self._owner.error(LOST, "loading it")
            self.dismiss()
            raise error
        if status > WARNING:
            self.dismiss()
            raise RuntimeError(self._result)

    # -- what is written --------------------------------------------------------------------------------------

    def accessor(self, verb: str, kind: str, vr: np.ndarray, values: np.ndarray, doing: str = "") -> Call:
        """Return the call that gets or sets (`verb`) all of `vr` (n,) from or into `values` (m,); `doing` says so in errors."""
        known, error = (verb, kind, vr.tobytes(), values.size), partial(self._owner.error, doing=doing)
        if known not in self._keys:
            self._keys[known] = self._defined(verb, kind, vr, values, error)
        if verb == "Set":
            return partial(self._set, self._keys[known], values, values.nbytes, error)
        return partial(self._get, self._keys[known], values)

    def _defined(self, verb: str, kind: str, vr: np.ndarray, values: np.ndarray, error: Late) -> Any:
        key = next(self._numbers)
        text = json.dumps([verb, kind, values.dtype.str, vr.tolist(), values.size]).encode()
        self._put_with(DEFINE, key, len(text), text, len(text), error)
        if verb == "Set":
            return key
        read = self._reads[key] = _Read(key, *self._placed(values), error)
        return read

    def _placed(self, values: np.ndarray) -> tuple[int, np.ndarray]:
        """Return where values come to in the shared memory, and a view of it; a place for all where no other is left."""
        place = self._free_place if self._free_place + values.nbytes <= self._channel.size else self._common
        if place != self._common:
            self._free_place += aligned(values.nbytes)
        return place, np.frombuffer(self._channel.memory, values.dtype, values.size, place)

    def _set(self, key: int, values: np.ndarray, size: int, error: Late) -> int:
        self._state += 1
        self._put_with(SET, key, 0, values, size, error)
        return OK

    def _get(self, read: _Read, values: np.ndarray) -> int:
        if read.of != self._state:
            read.status = self._asked(GET, read.key, read.place)
            read.of = self._state if read.place != self._common and read.status <= WARNING else -1
        elif read.heard:
            for status, text in read.heard:
                self._owner.log.add(status, text)
            read.heard = []
        if self._stepped == self._state:
            read.wanted = self._step
        values[:] = read.data
        return read.status

    def begin_step(self, t: float, h: float, none_before: bool) -> None:
        """Let it advance from `t` to `t + h`, without waiting; `do_step` then waits."""
        self._state += 1
        self._step += 1
        self._put(STEP, None, 0, int(none_before), t, h)
        self._reading = self._ahead()
        for read in self._reading:
            read.status, read.heard = OK, []
            self._put(PEEK, read.error, read.key, read.place)
        self._send()
        self._begun = True

    def _ahead(self) -> list[_Read]:
        """Return what is read along with a step."""
        return [r for r in self._reads.values() if self._step - r.wanted <= KEPT and r.place != self._common]

    def do_step(self, t: float, h: float, none_before: bool) -> int:
        """Advance from `t` to `t + h`; `none_before`: no state from before `t` will be restored any more."""
        if not self._begun:
            self.begin_step(t, h, none_before)
        self._begun = False
        status = self._answer()
        if status <= WARNING:
            self._stepped = self._state
            for read in self._reading:
                read.of = self._state
        return status

    def limit(self, timeout: float) -> None:
        """Let a call take no longer than `timeout`, s."""
        self._channel.timeout = timeout

    @property
    def pid(self) -> int:
        """The number of its process."""
        return self._process.pid

    @property
    def took(self) -> float:
        """Wall time of the last step, s, without what the way there takes."""
        return self._channel.took

    def get_state(self, state: SavedState) -> int:
        """Save the FMU's state; `state` becomes its number. Whether an FMU can do so at all is seen at once."""
        state.value = next(self._numbers)
        if self._saved:
            self._put(SAVE, self._saving, state.value)
            return OK
        self._saved = True
        return self._asked(SAVE, state.value)

    def set_state(self, state: SavedState) -> int:
        """Take the state back."""
        self._state += 1
        self._put(RESTORE, self._restoring, state.value or 0)
        return OK

    def free_state(self, state: SavedState) -> int:
        """Free a saved state."""
        self._put(FORGET, self._freeing, state.value or 0)
        return OK

    def directional_derivative(self, unknown: np.ndarray, known: np.ndarray, seed: np.ndarray, out: np.ndarray) -> int:
        """Write d(unknown)/d(known)·seed into `out`; value references are uint32."""
        wanted = unknown.tolist(), known.tolist(), seed.tolist(), out.size
        status = self._called("directional_derivative", *wanted, changes=False)
        if status != OK:
            return status
        status, out[:] = self._result
        return status

    def asks_for_the_end(self, t: float) -> bool:
        """Return whether a step from `t` that was discarded says that the simulation shall end there."""
        return self._called("asks_for_the_end", t, changes=False) == OK and bool(self._result)

    def configure(self, values: Sequence[tuple[str, int, int]]) -> int:
        """Set structural parameters, type, reference and value of each, in configuration mode."""
        return self._called("configure", list(values))

    def enter_initialization(self, start: float, stop: float | None) -> int:
        """Set up the experiment and enter initialisation."""
        return self._called("enter_initialization", start, stop)

    def exit_initialization(self) -> int:
        """Leave initialisation."""
        return self._called("exit_initialization")

    def set_string(self, vr: int, text: str) -> int:
        """Set one string."""
        return self._called("set_string", vr, text)

    def get_string(self, vr: int) -> tuple[int, str]:
        """Return the status, and one string."""
        status = self._called("get_string", vr, changes=False)
        return (status, "") if status != OK else tuple(self._result)

    def terminate(self) -> int:
        """Let the FMU end its run: some write their files only now."""
        return self._called("terminate")

    def free(self) -> int:
        """Free the instance."""
        return self._called("free")

    def dismiss(self) -> None:
        """Let the process end, at once if it is busy."""
        if self._owner.fate is None:
            self._channel.hang_up()
            self._process.end(0.0 if self._begun else PATIENCE)
            self._channel.last_words()
            self._owner.fate = CRASHED, "it has been closed"
        self._channel.close()

    # -- what is said and heard -------------------------------------------------------------------------------

    def _put(
        self, what: int, error: Late | None, key: int = 0, number: int = 0, t: float = 0.0, h: float = 0.0
    ) -> None:
        if not self._channel.room(0):
            self._exchange()
        self._channel.put(what, key, number, t, h)
        self._due.append(error)

    def _put_with(self, what: int, key: int, number: int, payload: Any, size: int, error: Late | None) -> None:
        if not self._channel.room(size):
            self._exchange()
            if not self._channel.room(size):
                raise ValueError(f"{size} bytes are more than an FMU in a process of its own can be given at once")
        self._channel.put_with(what, key, number, payload, size)
        self._due.append(error)

    def _called(self, name: str, *arguments: Any, changes: bool = True) -> int:
        """Make one of the calls that are made seldom."""
        self._state += changes
        text = json.dumps([name, *arguments]).encode()
        self._put_with(CALL, 0, len(text), text, len(text), None)
        return self._exchange()

    def _asked(self, what: int, key: int, number: int = 0) -> int:
        self._put(what, None, key, number)
        return self._exchange()

    def _exchange(self) -> int:
        """Have all carried out that was put down; return what the last of it came back with."""
        self._send()
        return self._answer()

    def _send(self) -> None:
        try:
            if self._owner.fate is None:
                self._channel.send()
        except Ended:
            self._lost(PATIENCE)

    def _answer(self) -> int:
        """Return the status of the last call; raise the error of an earlier one."""
        number, status = -1, LOST
        try:
            if self._owner.fate is None:
                number, status = self._heard()
        except TooLate:
            self._lost(0.0, (TIMEOUT, f"no answer within {self._channel.timeout:g} s; raise the time-out?"))
        except (Ended, ValueError, TypeError, KeyError, IndexError):  # it says what has no sense
            self._lost(PATIENCE)
        except BaseException:
            self._lost(0.0)
            raise
        due, self._due = self._due, []
        if status == LOST:
            number = self._channel.at
        if status > WARNING and 0 <= number < len(due):
            error = due[number]
            if error is not None:
                raise error(status)
        return status

    def _heard(self) -> tuple[int, int]:
        """Wait for the answer; return the number of the last record carried out, and its status."""
        data = self._channel.receive()
        if data == FINE:
            return -1, OK
        while True:
            found, rest = parted(data)
            for kind, content in found:
                if kind in (FINE, ENDS):
                    self.ends = kind == ENDS
                    return -1, OK
                if kind == RESULT:
                    number, status, self._result = json.loads(content)
                    return int(number), int(status)
                self._take(kind, json.loads(content))
            self._channel.require_patience()
            data = rest + self._channel.receive()

    def _take(self, kind: bytes, content: Any) -> None:
        """Take a message, or what a value that was read ahead came back with."""
        if kind == MESSAGE:
            self._owner.log.add(int(content[0]), str(content[1]))
        elif kind == PEEKED:
            read = self._reads[content[0]]
            read.status, read.heard = int(content[1]), [(int(status), str(text)) for status, text in content[2]]

    def _lost(self, patience: float, fate: tuple[int, str] | None = None) -> None:
        """Note that there is no process any more, and why."""
        end = self._process.end(patience)
        self._channel.last_words()
        self._owner.fate = fate or (CRASHED, f"its process {end}{self._limited(end.memory)}")

    def _limited(self, memory: float) -> str:
        """Return what is to be said of its files and its memory."""
        files = self.limits.files
        said = "" if files is None else f"; it may have {files} files open ([simulation] file_limit)"
        if self.limits.memory is None:
            return said
        had = memory - self._memory_at_birth
        reached = f", of which it had {had:.0f}" if had > 0 else ""
        return f"{said}; its memory is limited to {self.limits.memory:g} MB{reached} ([simulation] memory_limit)"


_STATES = "saving", "restoring"
