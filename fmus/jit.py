"""How kernels are compiled.

A *kernel* is a plain loop over ``float64`` arrays that are passed in, workspaces too: no exceptions, no
allocation in the step path, an integer status returned. Compiled code is cached on disk, in a folder named
after the hash of all sources with kernels in the package: Numba itself looks only at the file of the kernel called,
so that a change in a kernel *called by it* would otherwise go on running the old code.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

PACKAGE = Path(__file__).resolve().parent
MARKER = b"kernel\ndef "
"""What the sources with compiled kernels have in common."""


def source_hash(package: Path = PACKAGE, marker: bytes = b"") -> str:
    """Return a hash of the Python sources below `package` that contain `marker` (16 hexadecimal digits)."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if marker in content:
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(content)
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    for base in (PACKAGE / "__pycache__", Path.home() / ".cache" / "line-landing", Path(tempfile.gettempdir())):
        folder = base / f"numba-{source_hash(marker=MARKER)}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    raise OSError("no folder can be written for compiled kernels; make the home folder writable")


numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]


def kernel(function: Callable) -> Callable:
    """Compile a kernel; decorator.

    Without Numba's run time (reference counts) nothing can be allocated: such code does not compile. A kernel whose
    name begins with an underscore is called by kernels only, and gets no wrapper for Python. Both shorten compilation
    by a fifth each.
    """
    return _compiled(function)


def summing_kernel(function: Callable) -> Callable:
    """Compile a kernel whose sums may be formed in any order and with fused multiplication; decorator.

    Long sums of products then use the processor's vector units: an element's force takes 0.6 of the time. The result
    may differ in the last bits from one kind of processor to another, never from call to call.
    """
    return _compiled(function, fastmath={"reassoc", "contract"})


def _compiled(function: Callable, **options: Any) -> Callable:
    inner = function.__name__.startswith("_")
    options |= {"_nrt": False, "no_cfunc_wrapper": True, "no_cpython_wrapper": inner}
    return numba.njit(cache=True, error_model="numpy", **options)(function)
