"""How processes for FMUs come and go: forked from one that has loaded what they need, so that one costs milliseconds.

That one, the nursery, is started with the first of them, and runs nothing of an FMU itself. It ends, and all its children
with it, when the process that wants it has ended, however that was. Where the system cannot fork safely each child loads all
for itself, which takes some tenths of a second.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter, sleep
from typing import Any, Protocol

FORKS = sys.platform == "linux"
"""Whether children are forked; on macOS system libraries do not bear that."""
POSSIBLE = os.name == "posix"
"""Whether FMUs can have processes of their own here."""
PATIENCE, GRACE = 2.0, 0.5
"""s that a process may take to end by itself; until those are ended that are left when nobody wants them any more."""
MOST = 1 << 16
"""Bytes of a request or an answer."""
START = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from orchestrator.coupling.fmu.{0} import {1}; {1}({2})"
)


@dataclass(frozen=True)
class End:
    """How a process has ended.

    Attributes
    ----------
    code : its exit code; that of the signal which ended it, negative
    killed : it did not end by itself
    memory : the most that it had, MB; nan where that is not known
    """

    code: int
    killed: bool = False
    memory: float = float("nan")

    def __str__(self) -> str:
        if self.killed and self.code == -signal.SIGKILL:
            return "went on as another program, or without its connection, and was ended"
        return f"was ended by {_signal_name(-self.code)}" if self.code < 0 else f"ended with exit code {self.code}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


class Process(Protocol):
    """The process of an FMU."""

    pid: int

    def end(self, patience: float) -> End:
        """Wait for its end, `patience` s, then kill it; return how it has ended."""
        ...


def born(descriptors: Sequence[int]) -> Process:
    """Return a new process that lives by these `descriptors` (`orchestrator.coupling.fmu.child.live`)."""
    if not FORKS:
        return _Spawned(descriptors)
    try:
        return _nursery().born(descriptors)
    except OSError:  # somebody has ended it
        _one.clear()
        return _nursery().born(descriptors)


# -- on our side ----------------------------------------------------------------------------------------------


class _Spawned:
    """A process that has loaded all for itself."""

    def __init__(self, descriptors: Sequence[int]):
        self._process = _started("child", "live", descriptors)
        self.pid = self._process.pid

    def end(self, patience: float) -> End:
        killed = False
        try:
            self._process.wait(patience)
        except subprocess.TimeoutExpired:
            _kill_all(self.pid)
            killed = True
        return End(self._process.wait(), killed)


def _started(module: str, function: str, descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    """Return a new interpreter that calls a function of this package with descriptors of ours."""
    code = START.format(module, function, ", ".join(map(str, descriptors)))
    return subprocess.Popen(
        [sys.executable, "-c", code, json.dumps(sys.path)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=None if _is_open(2) else subprocess.DEVNULL,
        pass_fds=descriptors,
        start_new_session=True,
    )


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


@dataclass
class _Child:
    """A process of the nursery."""

    pid: int
    nursery: _Nursery

    def end(self, patience: float) -> End:
        try:
            return End(*self.nursery.ask({"end": self.pid, "patience": patience}))
        except OSError:  # with the nursery its children are ended
            return End(-signal.SIGKILL)


class _Nursery:
    """The nursery as seen from here; one for all threads."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket, self._turn, self.owner = ours, threading.Lock(), os.getpid()
        self._process = _started("nursery", "tend", [theirs.fileno()])
        theirs.close()

    @property
    def pid(self) -> int:
        """The number of its process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it is there, and ours."""
        return self.owner == os.getpid() and self._process.poll() is None

    def born(self, descriptors: Sequence[int]) -> Process:
        return _Child(self.ask({"fork": True}, descriptors), self)

    def ask(self, what: dict[str, Any], descriptors: Sequence[int] = ()) -> Any:
        """Return its answer; `OSError` where there is none."""
        with self._turn:
            socket.send_fds(self._socket, [json.dumps(what).encode()], list(descriptors))
            answer = self._socket.recv(MOST)
        if not answer:
            raise OSError("the process from which those of FMUs are forked has ended")
        return json.loads(answer)

    def close(self) -> None:
        """Let it end."""
        self._socket.close()
        if self.owner == os.getpid():
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(PATIENCE + GRACE)


_one: list[_Nursery] = []
_making = threading.Lock()


def _nursery() -> _Nursery:
    with _making:
        if not (_one and _one[0].alive):
            _one[:] = [_Nursery()]
        return _one[0]


def prepare() -> None:
    """Start what processes are forked from, without waiting for it."""
    if POSSIBLE and FORKS:
        _nursery()


@atexit.register
def _close() -> None:
    for one in _one:
        one.close()


# -- in the nursery -------------------------------------------------------------------------------------------


def tend(control: int) -> None:
    """Fork processes for whom asks through the socket `control`, to the end of that one."""
    from orchestrator.coupling.fmu.child import live  # with all that an FMU needs

    life = _Tended(socket.socket(fileno=control)).wait_upon()
    if life is not None:  # we are a child
        live(*life)


class _Tended:
    """The nursery itself."""

    def __init__(self, control: socket.socket):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self.control, self.children = control, set[int]()
        self.poll = select.poll()
        self.poll.register(control, select.POLLIN)
        with contextlib.suppress(OSError, AttributeError):
            self.poll.register(os.pidfd_open(os.getppid()), select.POLLIN)

    def wait_upon(self) -> list[int] | None:
        """Answer until nobody asks any more; return what a child lives by, in that child."""
        for what, descriptors in self.requests():
            if "fork" not in what:
                self.control.send(json.dumps(self.ended(what["end"], what["patience"])).encode())
                continue
            pid = os.fork()
            if not pid:
                os.setsid()
                self.control.close()
                return descriptors
            self.children.add(pid)
            for descriptor in descriptors:
                os.close(descriptor)
            self.control.send(json.dumps(pid).encode())
        self.leave()
        return None

    def requests(self) -> Iterator[tuple[dict[str, Any], list[int]]]:
        """Yield what is asked for, with the descriptors that come with it."""
        while True:
            ready = [descriptor for descriptor, _ in self.poll.poll()]
            if self.control.fileno() not in ready:
                return
            text, descriptors, _, _ = socket.recv_fds(self.control, MOST, 4)
            if not text:
                return
            for descriptor in descriptors:
                os.set_inheritable(descriptor, False)
            yield json.loads(text), descriptors

    def ended(self, pid: int, patience: float) -> tuple[int, bool, float]:
        """Wait for the end of a child, kill it at last, and what it has left behind; return how it ended."""
        self.children.discard(pid)
        killed = not _has_ended(pid, perf_counter() + patience)
        _kill_all(pid)
        _, status, usage = os.wait4(pid, 0)
        return os.waitstatus_to_exitcode(status), killed, usage.ru_maxrss / 1024

    def leave(self) -> None:
        """Give the children that are left a moment to end, then end them."""
        until = perf_counter() + GRACE
        for pid in self.children:
            _has_ended(pid, until)
            _kill_all(pid)


def _has_ended(pid: int, until: float) -> bool:
    """Return whether a child ends before that time; its number stays its own."""
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if perf_counter() > until:
            return False
        sleep(1e-3)
    return True


def _kill_all(pid: int) -> None:
    """Kill a process with all that it has started in its session."""
    for kill in (os.killpg, os.kill):
        with contextlib.suppress(OSError):
            kill(pid, signal.SIGKILL)
