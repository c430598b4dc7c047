"""Runs on many machines: each in a child of a Dask worker, made and guarded as on one machine; results come back as bytes.

No run can bring a worker down, let alone the scheduler: what crashes or hangs is the child. Workers need this program in the
same version; what a scenario names by its path (an own scenario, robot, FMU) has to be there under the same path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.coupling.errors import InputError
from orchestrator.runs.job import Job, code_version, put

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = "20 s"
"""For a scheduler to answer."""
Packed = dict[str, bytes]
"""The files of a finished run."""
Made = Callable[[Job, str, str, float | None], tuple[Packed | None, str]]
"""Makes a run known by a key, with the version of the program and a time limit; returns its files, or why there are none."""


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
    client: Client, make: Made, left: Mapping[str, Job], store: Path, limit: float | None
) -> Iterator[tuple[str, Future[None]]]:
    """Yield each run as it has ended, its results in `store`; `make` is what a worker does with each."""
    from distributed import as_completed

    store.mkdir(parents=True, exist_ok=True)
    version = code_version()
    futures = {client.submit(make, _bare(job), key, version, limit, pure=False): key for key, job in left.items()}
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
