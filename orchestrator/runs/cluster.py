"""Runs on many machines: each in a child of a Dask worker, made and guarded as on one machine; results come back as bytes.

No run can bring a worker down, let alone the scheduler: what crashes or hangs is the child. Workers need this program in the
same version; what a scenario names by its path (an own scenario, robot, FMU) has to be there under the same path.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import fields
from multiprocessing import current_process
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.coupling.errors import InputError
from orchestrator.runs.job import Job, code_version, put

if TYPE_CHECKING:
    from distributed import Client

    from orchestrator.runs.batch import Batches

PATIENCE = "20 s"
"""For a scheduler to answer."""
Packed = dict[str, bytes]
"""The files of a finished run."""
_here = threading.local()
"""Of a thread of a Dask worker: its child, which is kept from run to run."""


class LostError(Exception):
    """A run has left nothing; the message says why, as it would be said on one machine."""


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """Give a client of the scheduler at `address`; `InputError` where there is none, or Dask is not installed."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask needs Dask, which is not installed: pip install 'line-landing[cluster]'") from None
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--dask {address}: no scheduler answers ({error}); start one with `dask scheduler`, and give its address"
        ) from None
    with client:
        yield client


def ended(
    client: Client, left: Mapping[str, Job], store: Path, limit: float | None
) -> Iterator[tuple[str, Future[None]]]:
    """Yield each run as it has ended, its results in `store`."""
    from distributed import as_completed

    store.mkdir(parents=True, exist_ok=True)
    version = code_version()
    futures = {
        client.submit(make_elsewhere, _bare(job), key, version, limit, pure=False): key for key, job in left.items()
    }
    try:
        for future in as_completed(futures):
            yield futures[future], _stored(future, futures[future], store)
            future.release()
    finally:
        client.cancel(list(futures))


def _bare(job: Job) -> Job:
    """Return a job without what was found out about it here: it is found out anew, there."""
    return type(job)(**{field.name: getattr(job, field.name) for field in fields(job)})


def _stored(future: Any, key: str, store: Path) -> Future[None]:
    """Return how a run has ended; what has come back is in `store`."""
    known = Future[None]()
    error = future.exception()
    packed, failure = (None, f"the cluster has lost it: {error}") if error is not None else future.result()
    if packed is None:
        known.set_exception(LostError(failure))
    else:
        with put(store, key) as directory:
            directory.path.mkdir(parents=True, exist_ok=True)
            for name, content in packed.items():
                (directory.path / name).write_bytes(content)
        known.set_result(None)
    return known


# -- in a Dask worker -------------------------------------------------------------------------------------------


def make_elsewhere(job: Job, key: str, version: str, limit: float | None) -> tuple[Packed | None, str]:
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
    from orchestrator.runs.batch import Batches

    if not hasattr(_here, "batches"):
        current_process().daemon = (
            False  # Dask's workers are daemons, which may have no children; this one ends with it
        )
        _here.folder = tempfile.TemporaryDirectory(prefix="line-landing-")
        _here.batches = Batches(Path(_here.folder.name), 1)
    return _here.batches
