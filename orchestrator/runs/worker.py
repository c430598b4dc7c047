"""Worker processes: forked from one that has loaded what they need, with one BLAS thread each, and never orphans."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import get_all_start_methods, get_context, parent_process
from multiprocessing.connection import wait
from typing import Any

from pebble import ProcessPool

from fmus.kernels import notice
from orchestrator.catalogue.documents import read_once_from_now_on
from orchestrator.coupling.errors import OrchestratorError
from orchestrator.runs import last_net

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
FORKED = "forkserver"
"""How workers are started where the system can; elsewhere each loads all for itself (``spawn``)."""
DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux, see prctl(2)."""


@contextmanager
def pool(workers: int, solvers: Iterable[str]) -> Iterator[ProcessPool]:
    """Give worker processes for runs by `solvers`; what still runs at an interruption is ended."""
    with one_thread():
        opened = ProcessPool(workers, initializer=begin, initargs=(dict(os.environ),), context=_context(solvers))
        try:
            yield opened
            opened.close()
        except BaseException:
            opened.stop()
            raise
        finally:
            opened.join()


def _context(solvers: Iterable[str]) -> Any:
    """Return how processes are started."""
    if FORKED not in get_all_start_methods():
        return get_context("spawn")
    found = get_context(FORKED)
    found.set_forkserver_preload([f"orchestrator.runs.warm.{solver}" for solver in sorted(solvers)])
    return found


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the processes started within have one thread each: a library reads that as it is loaded."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def begin(environment: Mapping[str, str]) -> None:
    """Make this process a worker: it leaves Ctrl-C to the process that wants it, says nothing, and ends with that process.

    `environment` is that of the process that wants it; the one it is forked from may be older.
    """
    os.environ.clear()
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    notice.muted = True
    read_once_from_now_on()
    end_with_parent()


def guarded(make: Callable[..., None], *arguments: Any) -> None:
    """Call `make`; a fault of this program leaves its traceback in a file, here where it is known, and comes as its name."""
    try:
        make(*arguments)
    except (OrchestratorError, OSError, MemoryError):
        raise
    except Exception as error:
        raise last_net.caught(error, [f"{make.__name__}{arguments}"]) from None


def end_with_parent() -> None:
    """Let this process be killed when the one that wants it has ended, however that was.

    A thread waits for it. It does not come to run where a library hangs and never gives the interpreter back: there Linux
    kills, as the process that this one was forked from ends with the one that wants it.
    """
    parent = parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    threading.Thread(target=_killed_after, args=(parent.sentinel,), daemon=True).start()


def _killed_after(sentinel: int) -> None:
    wait([sentinel])
    os.kill(os.getpid(), signal.SIGKILL)
