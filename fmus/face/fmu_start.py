"""How an FMU finds its physics; the text of this file, after that of kernels/cache.py, opens the script inside every FMU.

All FMUs of a process share one interpreter and one module cache, so that two FMUs with a module of the same
name would run the first one's code. The installed package is therefore used only if it is, byte for byte,
what the FMU was built from. Else the copy inside the FMU is used, under a name made of its own hash; it is
kept in a folder of the user, so that compiled kernels are found again at the next start.
Standard library only.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib
import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

from fmus.kernels.cache import prune, used, user_folder

PYTHON = ">=3.11"
NEEDS = {"numpy": ">=1.26,<3", "numba": ">=0.60"}
"""What our modules need of the interpreter that loads them, as in pyproject.toml. Numba brings llvmlite."""


def digest(folder: Path) -> str:
    """Return a hash of all Python sources below `folder` (16 hexadecimal digits)."""
    total = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        total.update(path.relative_to(folder).as_posix().encode() + b"\0")
        total.update(path.read_bytes() + b"\0")
    return total.hexdigest()[:16]


def package_folder(name: str) -> Path | None:
    """Return the folder of the importable package `name`, without importing it; None if there is none."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    locations = list(spec.submodule_search_locations or ()) if spec else []
    return Path(locations[0]) if locations else None


def is_installed(sources: dict[str, str]) -> bool:
    """Say whether every package in `sources` (name → digest) can be imported and is unchanged."""
    folders = {name: package_folder(name) for name in sources}
    return all(folder is not None and digest(folder) == sources[name] for name, folder in folders.items())


def keep_copy(bundle: Path, expected: str) -> Path:
    """Copy the package `bundle` once into a folder of the user; return the folder that holds it."""
    try:
        folder = user_folder("sources") / expected
        if folder.is_dir() and digest(folder / bundle.name) != expected:
            shutil.rmtree(folder)
        if not folder.is_dir():
            place_copy(bundle, folder)
            prune(folder.parent)
        return used(folder)
    except OSError as error:
        raise ImportError(f"the FMU's sources can be copied nowhere: {error}") from None


def place_copy(bundle: Path, folder: Path) -> None:
    """Copy `bundle` into `folder` in one move, so that no other process sees half of it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(dir=folder.parent))
    shutil.copytree(bundle, draft / bundle.name, ignore=shutil.ignore_patterns("__pycache__"))
    try:
        draft.rename(folder)
    except OSError:
        shutil.rmtree(draft)
        if not folder.is_dir():  # else another process was faster
            raise


def import_bundle(bundle: Path, expected: str) -> None:
    """Import the FMU's own copy of the sources."""
    sys.path.insert(0, str(keep_copy(bundle, expected)))
    try:
        importlib.import_module(bundle.name + ".face.slave")
    finally:
        sys.path.pop(0)


def load_package(resources: Path, sources: dict[str, str], bundle: str, expected: str) -> str:
    """Import the physics; return the name of the package that serves: ``fmus`` or `bundle`."""
    try:
        if is_installed(sources):
            importlib.import_module("fmus.face.slave")
            return "fmus"
        if bundle not in sys.modules:
            import_bundle(resources / bundle, expected)
        return bundle
    except ModuleNotFoundError as error:
        where = f"Python {sys.version.split()[0]} at {sys.prefix}"
        raise ImportError(f"{error}. The FMU needs {needs()}; install that in the running {where}.") from error


def needs() -> str:
    """Return what our FMUs need, in words."""
    return f"Python {PYTHON} with {' and '.join(name + version for name, version in NEEDS.items())}"


def hold(namespace: dict[str, object]) -> None:
    """Give pythonfmu the reference to the script's namespace that it releases at each instantiation.

    It does not own one: without this gift the namespace vanishes after a few instances.
    """
    with contextlib.suppress(AttributeError, OSError):  # a host may hide the interpreter's symbols
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(namespace))
