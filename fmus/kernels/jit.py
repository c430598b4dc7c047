"""How kernels are compiled, and where the compiled code is kept.

A *kernel* is a plain loop over ``float64`` arrays that are passed in, workspaces too: no exceptions, no
allocation in the step path, an integer status returned.

Compiled code holds all that the kernel calls, and the constants it uses, from whatever file. Numba itself looks only at
the file of the kernel: a callee edited in another one would go on running as it was. So each file with kernels has a
folder of compiled code whose name holds a hash of that file and of all files it imports.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba

from fmus.kernels.cache import prune, remove, used, user_folder
from fmus.kernels.compilation import Compilation

LIBRARIES = {*sys.stdlib_module_names, "numba", "numpy", "scipy", "llvmlite"}
"""What is not looked into: their versions, not their sources, decide over the compiled code."""
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n#]*)|import[ \t]+([^\n#]+))", re.MULTILINE
)

_folders: dict[str, Path] = {}  # of compiled code, by the name of the module with the kernels
COMPILATION = Compilation(_folders)
"""Says that this process compiles kernels."""


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
    with _cached_in(code_folder(function.__module__)):
        return numba.njit(cache=True, error_model="numpy", **options)(function)


@contextlib.contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """Let Numba keep what is decorated now in `folder`."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


@cache
def code_folder(module: str) -> Path:
    """Return the folder of compiled code of the kernels in `module`, which has been imported up to them."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for name, content in sorted(sources(module).items()):
        digest.update(name.encode() + b"\0" + content)
    parent = user_folder("kernels")
    folder = parent / f"{module}-{digest.hexdigest()[:16]}"
    if not folder.is_dir():  # Numba makes it when there is something to keep
        prune(parent)
        _remove_former(parent)
    _folders[module] = used(folder)
    return folder


def is_compiled(package: str) -> bool:
    """Say whether there is compiled code for every file with kernels of `package` that has been imported."""
    folders = [folder for module, folder in _folders.items() if module.startswith(f"{package}.")]
    return all(any(folder.glob("*/*.nbi")) for folder in folders)


def _remove_former(parent: Path) -> None:
    """Remove what former versions have compiled beside their sources and beside `parent`."""
    for place in (Path(__file__).parents[1] / "__pycache__", parent.parent):
        for folder in place.glob("numba-*"):
            remove(folder)


def sources(module: str) -> dict[str, bytes]:
    """Return the content of the source of `module` and of all that it imports, by name; libraries are left out."""
    found: dict[str, bytes] = {}
    left = [module]
    while left:
        name = left.pop()
        path = _file(name)
        if name not in found and path is not None:
            found[name] = path.read_bytes()
            left += _imported(found[name].decode(errors="replace"), name)
    return found


def _imported(source: str, module: str) -> Iterator[str]:
    """Yield the names that the import statements of `source` may mean; those that are no modules have no file."""
    for base, names, plain in IMPORT.findall(source):
        for name in plain.split(","):
            yield name.split(" as ")[0].strip()
        if base:
            base = _absolute(base, module)
            yield base
            for name in names.strip("() \n").split(","):
                yield f"{base}.{name.split(' as ')[0].strip()}"


def _absolute(base: str, module: str) -> str:
    """Return the absolute name of what ``from base import`` means in `module`."""
    dots = len(base) - len(base.lstrip("."))
    is_package = hasattr(sys.modules.get(module), "__path__")
    parts = module.split(".")
    return ".".join([*parts[: len(parts) - dots + is_package], base[dots:]]).strip(".") if dots else base


def _file(name: str) -> Path | None:
    if not name or name.split(".")[0] in LIBRARIES - {"__main__"}:
        return None
    module = sys.modules.get(name)
    if module is None and name.rpartition(".")[0] in ("", *sys.modules):
        with contextlib.suppress(ImportError, ValueError, AttributeError):
            module = importlib.util.find_spec(name)  # imported further down, or not a module at all
    place = getattr(module, "__file__", None) or getattr(module, "origin", None)
    return Path(place) if place and place.endswith(".py") and Path(place).is_file() else None
