"""How the few kernels of the engine are compiled: each calls nothing, so that Numba's own check of its file suffices."""

from __future__ import annotations

from collections.abc import Callable

import numba

OPTIONS = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def kernel(function: Callable) -> Callable:
    """Compile a kernel that calls no other one; decorator. It is kept beside its file, else in the user's cache folder."""
    try:
        return numba.njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # no folder can be written
        return numba.njit(**OPTIONS)(function)
