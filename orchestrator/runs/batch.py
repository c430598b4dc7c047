"""Many runs in worker processes: resumable, each made once, and none the victim of another.

A run that crashes its process or hangs costs itself alone. At every moment the store holds whole runs only, so that a
batch that was interrupted goes on where it was.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from concurrent.futures import TimeoutError as RanTooLong
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import current_process
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pebble import ProcessExpired, ProcessPool

from fmus.face.first_use import compile_modules
from fmus.kernels.jit import is_compiled
from orchestrator.coupling.errors import InputError
from orchestrator.runs import cluster, last_net, worker
from orchestrator.runs.job import Done, Job, code_version, found, make, remove_half_done
from orchestrator.scenario.types import LandingScenario

if TYPE_CHECKING:
    from distributed import Client

Counted = Callable[[int, int], None]
"""Told how many runs are done, and of how many."""
Ended = Callable[[Done], None]
"""Told of each run as it has ended."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
ATTEMPTS = 5
"""With new workers, where all were lost at once."""
COMPILED = {"monolithic": "orchestrator.landing.monolithic", "coupled": "fmus.cable"}
"""The package whose kernels each solver needs last."""


def run_batch(
    jobs: Sequence[Job],
    store: Path,
    workers: int | None = None,
    timeout: float | None = None,
    progress: Counted = lambda done, of: None,
) -> list[Done]:
    """Make those of `jobs` that `store` has not, and return all in their order.

    Parameters
    ----------
    jobs : equal ones are run once
    store : folder of finished runs
    workers : processes; None: as many as there are processors
    timeout : s that one run may take; one that takes longer is ended
    progress : called as runs are finished, those found first

    Raises
    ------
    InputError : jobs that cannot be read, all of them at once, before anything is run
    """
    with Batches(store, workers, timeout) as batches:
        return batches.run(jobs, progress)


class Batches:
    """Batches one after another with the same workers, which are started with the first run that has to be made.

    Parameters as for `run_batch`; `dask`: address of a scheduler, whose workers make the runs in the place of this machine.
    """

    def __init__(self, store: Path, workers: int | None = None, timeout: float | None = None, dask: str | None = None):
        self.store, self.workers, self.timeout, self.dask = store, workers or _processors(), timeout, dask
        self._open = ExitStack()
        self._pool: ProcessPool | None = None
        self._client: Client | None = None

    def __enter__(self) -> Self:
        if self.dask is not None:
            self._client = self._open.enter_context(cluster.connected(self.dask))
        return self

    def __exit__(self, *error: Any) -> None:
        self._pool = self._client = None
        self._open.__exit__(*error)

    def run(
        self,
        jobs: Sequence[Job],
        progress: Counted = lambda done, of: None,
        ended: Ended = lambda done: None,
    ) -> list[Done]:
        """Make those of `jobs` that the store has not, and return all in their order; `ended` hears of those it has, too."""
        keys = _keys(jobs)
        unique = dict(zip(keys, jobs, strict=True))
        ready = {key: done for key, job in unique.items() if (done := found(job, self.store)) is not None}
        for done in ready.values():
            ended(done)
        progress(len(ready), len(unique))
        left = {key: job for key, job in unique.items() if key not in ready}
        for key, done in self._made(left) if left else ():
            ready[key] = done
            ended(done)
            progress(len(ready), len(unique))
        return [Done(job, ready[key].directory, ready[key].failure) for key, job in zip(keys, jobs, strict=True)]

    def _made(self, left: dict[str, Job]) -> Iterator[tuple[str, Done]]:
        """Yield each run of `left` as it is finished; those that have left nothing before come last."""
        alone, lost = self._compiling(left), {key for key in left if _lost(self.store, key).is_file()}
        others = sorted((key for key in left if key not in alone), key=lambda key: key in lost)
        solvers = {job.solver for job in left.values()}
        yield from self._tried({key: left[key] for key in alone}, solvers, None)
        yield from self._tried({key: left[key] for key in others}, solvers, self.timeout)

    def _compiling(self, left: Mapping[str, Job]) -> list[str]:
        """Return the runs that go first and alone: they compile what the others load, if that is not done yet."""
        if self.dask is not None:  # each machine does so for itself
            return []
        if any(isinstance(job.loaded(), LandingScenario) for job in left.values()):
            compile_modules()
        return _first_of_its_kind(left)

    def _tried(self, left: dict[str, Job], solvers: Iterable[str], limit: float | None) -> Iterator[tuple[str, Done]]:
        """Yield each run of `left`; should all workers be lost at once, the rest is given to new ones."""
        for attempt in range(ATTEMPTS):
            for key, future in self._ended(left, solvers, limit):
                if isinstance(future.exception(), BrokenProcessPool) and attempt + 1 < ATTEMPTS:
                    continue
                yield key, _outcome(left.pop(key), self.store, future)
            if not left:
                return
            self._pool = None
            self._open.pop_all().close()

    def _ended(
        self, left: Mapping[str, Job], solvers: Iterable[str], limit: float | None
    ) -> Iterator[tuple[str, Future[None]]]:
        """Yield what has ended, however that was."""
        if not left:
            return
        if self._client is not None:
            yield from cluster.ended(self._client, make_elsewhere, left, self.store, limit)
            return
        pool = self._started(solvers)
        futures: dict[Future[None], str] = {
            pool.schedule(worker.guarded, args=(make, job, self.store), timeout=limit): key for key, job in left.items()
        }
        for future in as_completed(futures):
            yield futures[future], future

    def _started(self, solvers: Iterable[str]) -> ProcessPool:
        """Return the workers, started if they are not yet."""
        if self._pool is None:
            self.store.mkdir(parents=True, exist_ok=True)
            remove_half_done(self.store)
            self._pool = self._open.enter_context(worker.pool(self.workers, solvers))
        return self._pool


def _keys(jobs: Sequence[Job]) -> list[str]:
    """Return the keys of `jobs`; `InputError` with what is wrong with any of them."""
    keys, problems = [], list[str]()
    for job in jobs:
        try:
            keys.append(job.key)
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(dict.fromkeys(problems))
    return keys


def _processors() -> int:
    count = getattr(os, "sched_getaffinity", None)
    return len(count(0)) if count else os.cpu_count() or 1


def _first_of_its_kind(left: Mapping[str, Job]) -> list[str]:
    """Return the runs that go first, alone and without a time limit: they compile the kernels that the others load."""
    kinds = {job.solver: key for key, job in reversed([*left.items()])}
    return [key for solver, key in kinds.items() if not is_compiled(COMPILED[solver])]


def _outcome(job: Job, store: Path, future: Future[Any]) -> Done:
    """Return how a run has ended; one that left nothing will be tried again by the next batch, last of all.

    Raises
    ------
    OSError : there is no room for its results, nor for those of others
    """
    failure = _failure(future.exception())
    done = found(job, store) if failure is None else None
    if done is None:
        done = Done(job, None, failure or "left no results")
        _lost(store, job.key).write_text(str(done.failure), encoding="utf-8")
    else:
        _lost(store, job.key).unlink(missing_ok=True)
    return done


def _failure(error: BaseException | None) -> str | None:
    """Return why a run has left nothing; None where it came to its end."""
    match error:
        case None:
            return None
        case RanTooLong():
            return "took longer than it may, and was ended; give it more time (timeout)"
        case ProcessExpired():
            return f"its process died (exit code {error.exitcode}); run the scenario alone to see why"
        case cluster.LostError():
            return str(error)
        case last_net.InternalError():
            last_net.noted.append(str(error))
            return str(error)
        case OSError() if error.errno in NO_ROOM:
            raise error
        case _:  # whatever it is, it is that run's alone
            return f"{type(error).__name__}: {error}"


def _lost(store: Path, key: str) -> Path:
    """Return the file that says why a run has left nothing."""
    return store / f"{key}.failed"


# -- in a Dask worker -------------------------------------------------------------------------------------------


_here = threading.local()
"""Of a thread of a Dask worker: its child, which is kept from run to run."""


def make_elsewhere(job: Job, key: str, version: str, limit: float | None) -> tuple[cluster.Packed | None, str]:
    """Make a run in a child of this process; return its folder, or why it has left nothing."""
    if version != code_version():
        return (
            None,
            "the cluster's worker has another version of this program, or of its libraries; install the same there",
        )
    try:
        if job.key != key:
            return None, f"{job.scenario}: the cluster's worker has other files under the same paths; share a folder"
    except InputError as error:
        return None, f"on the cluster's worker: {error}"
    batches = _batches()
    batches.timeout = limit
    (done,) = batches.run([job])
    if done.directory is None:
        return None, str(done.failure)
    packed = {file.name: file.read_bytes() for file in done.directory.iterdir()}
    shutil.rmtree(done.directory)
    return packed, ""


def _batches() -> Batches:
    """Return what makes runs in a child of this thread."""
    if not hasattr(_here, "batches"):
        current_process().daemon = (
            False  # Dask's workers are daemons, which may have no children; this one ends with it
        )
        _here.folder = tempfile.TemporaryDirectory(prefix=f"line-landing-{os.getpid()}-")
        _here.batches = Batches(Path(_here.folder.name), 1)
    return _here.batches
