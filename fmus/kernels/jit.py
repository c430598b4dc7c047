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
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np

from fmus.kernels.cache import prune, remove, used, user_folder
from fmus.kernels.compilation import Compilation

LIBRARIES = {*sys.stdlib_module_names, "numba", "numpy", "scipy", "llvmlite"} - {"__main__"}
"""What is not looked into: their versions, not their sources, decide over the compiled code."""
VERSIONS = f"{sys.version} {numba.__version__} {llvmlite.__version__} {np.__version__}"
PROCESSOR = (
    f"{numba.config.CPU_NAME or llvm.get_host_cpu_name()} "  # type: ignore[attr-defined]
    f"{numba.config.CPU_FEATURES or llvm.get_host_cpu_features().flatten()}"  # type: ignore[attr-defined]
)
"""Two kinds of processor that share a home do not share a folder of code: each numbers its files by itself."""
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]+))", re.MULTILINE
)

_decorating = threading.RLock()
_folders: dict[str, Path] = {}  # of compiled code, by the name of the module with the kernels
_places: dict[
    str, Path
] = {}  # in there, of what is compiled from the module's file at its path: Numba keeps them apart
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
    options |= {"error_model": "numpy"}
    with _cached_in(code_folder(function.__module__)):
        try:
            made: Any = numba.njit(cache=True, **options)(function)
            _places[function.__module__] = Path(made.stats.cache_path)
            return made
        except RuntimeError:  # it has no file: typed at a prompt
            return numba.njit(**options)(function)


@contextlib.contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """Let Numba keep what is decorated now in `folder`; one thread at a time, as its setting is that of the process."""
    with _decorating:
        before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
        try:
            yield
        finally:
            numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


@cache
def code_folder(module: str) -> Path:
    """Return the folder of compiled code of the kernels in `module`, which has been imported up to them."""
    digest = hashlib.sha256(f"{VERSIONS} {PROCESSOR}".encode())
    for name, content in sorted(sources(module).items()):
        digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
    parent = user_folder("kernels")
    folder = parent / f"{module}-{digest.hexdigest()[:16]}"
    if not folder.is_dir():  # Numba makes it when there is something to keep
        prune(parent)
        _remove_former(parent)
    _folders[module] = used(folder)
    return folder


def is_compiled(package: str) -> bool:
    """Say whether there is compiled code for every file with kernels of `package` that has been imported."""
    places = [place for module, place in _places.items() if module.startswith(f"{package}.")]
    return all(any(place.glob("*.nbi")) for place in places)


def _remove_former(parent: Path) -> None:
    """Remove what former versions have compiled beside their sources and beside `parent`."""
    for place in (Path(__file__).parents[1] / "__pycache__", parent.parent):
        for folder in place.glob("numba-*"):
            remove(folder)


def sources(module: str) -> dict[str, bytes]:
    """Return the source of `module` and of all that it takes names from, by name of the module; libraries are left out.

    Import statements are followed wherever they stand in a file; a module that is found by other means is not. Nor is the
    script that runs, which some libraries look at: what is made of the rest does not hang on who asks.
    """
    found: dict[str, bytes] = {}
    left = [module]
    while left:
        name = left.pop()
        path = _file(name)
        if name not in found and path is not None:
            found[name] = _content(path)
            imported = _imported(found[name].decode(errors="replace"), name, path)
            left += (one for one in imported if one != "__main__")
    return found


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


def _imported(source: str, module: str, path: Path) -> Iterator[str]:
    """Yield the modules that the import statements of `source`, the text of `module`, take something from."""
    plain_text = re.sub(r"#[^\n]*|\\\n", "", source).replace(";", "\n")
    for base, names, plain in IMPORT.findall(plain_text):
        for name in _listed(plain):
            parts = name.split(".")
            yield from (".".join(parts[: i + 1]) for i in range(len(parts)))  # the parents are at hand, too
        if base:
            base = _absolute(base, module, path)
            yield from (_origin(base, name) for name in _listed(names))


def _listed(names: str) -> list[str]:
    """Return the names in ``a, b as c``, with or without brackets around it."""
    return [name.split(" as ")[0].strip() for name in names.strip("() \n\t").split(",") if name.strip()]


def _origin(base: str, name: str) -> str:
    """Return where ``from base import name`` takes the name from: the module of that name in `base`, or `base`."""
    at_hand = getattr(sys.modules.get(base), name, None)
    is_module = at_hand is None or isinstance(at_hand, ModuleType)
    return f"{base}.{name}" if is_module and _file(f"{base}.{name}") else base


def _absolute(base: str, module: str, path: Path) -> str:
    """Return the absolute name of what ``from base import`` means in `module`."""
    dots = len(base) - len(base.lstrip("."))
    if not dots:
        return base
    package = getattr(sys.modules.get(module), "__package__", None)
    if package is None:
        package = module if path.stem == "__init__" else module.rpartition(".")[0]
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - dots + 1], base[dots:]]).strip(".")


@cache
def _file(name: str) -> Path | None:
    """Return the source of the module `name`, imported or not; None if it is a library or no module at all."""
    if not name or name.split(".")[0] in LIBRARIES:
        return None
    place = getattr(sys.modules.get(name), "__file__", None)
    path = Path(place) if place else _beside(name)
    return path if path is not None and path.suffix == ".py" and path.is_file() else None


def _beside(name: str) -> Path | None:
    """Return where a module that is not imported would be imported from, without importing its parents."""
    parent, _, last = name.rpartition(".")
    if not parent:
        with contextlib.suppress(ImportError, ValueError):
            spec = importlib.util.find_spec(name)
            return Path(spec.origin) if spec and spec.origin else None
        return None
    init = _file(parent)
    folders = getattr(sys.modules.get(parent), "__path__", [init.parent] if init and init.stem == "__init__" else [])
    candidates = [Path(folder, last) for folder in folders]
    files = [file for path in candidates for file in (path / "__init__.py", path.with_name(f"{last}.py"))]
    return next((file for file in files if file.is_file()), None)
