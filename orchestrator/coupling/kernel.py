"""How the few kernels of the engine are compiled: each calls nothing, so that Numba's own check of its file suffices."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numba

from orchestrator.coupling.cache import user_folder

OPTIONS = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def kernel(function: Callable) -> Callable:
    """Compile a kernel that calls no other one; decorator.

    The code is kept where Numba finds a place: beside the file, else in a folder of the user's. Where neither can be
    written, in the engine's cache.
    """
    with contextlib.suppress(RuntimeError):
        return numba.njit(cache=True, **OPTIONS)(function)
    with contextlib.suppress(RuntimeError, OSError), _kept_in_cache():
        return numba.njit(cache=True, **OPTIONS)(function)
    return numba.njit(**OPTIONS)(function)


@contextlib.contextmanager
def _kept_in_cache() -> Iterator[None]:
    """Let Numba keep what is decorated now in the engine's cache."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(user_folder("kernels"))  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
