"""FMUs in Python share the interpreter of this process, and its cache of modules: each gets its own files all the same.

Scripts and helper modules of a pythonfmu FMU lie in its resources and are imported by their bare names; a second FMU with a
module of the same name would run the first one's code.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

SHARED = {"pythonfmu"}
"""What every such FMU brings along, and all may share."""
INSTALLED = tuple({Path(prefix).resolve() for prefix in (sys.prefix, sys.base_prefix)})
"""Modules from there may be compiled, and cannot be loaded twice: FMUs that bring such a one get that of the process."""
_kept: dict[Path, dict[str, ModuleType]] = {}


@contextmanager
def own_modules(folder: Path, others: Iterable[Path]) -> Iterator[None]:
    """Let the FMU unzipped in `folder` import its own modules; those of the same names are put aside.

    Modules of other FMUs come back when these are loaded once more, those of the program itself at once.

    Parameters
    ----------
    others : folders of the FMUs that are loaded

    Raises
    ------
    ValueError : an FMU imports such a module only while it runs, when nobody can tell whose is wanted
    """
    names = module_names(folder)
    for other in {other for other in others if other != folder} if names else ():
        _require_early(folder, other, names & module_names(other))
    aside, hidden = _put_aside(names, folder), _hide(folder)
    sys.modules.update(_kept.pop(folder, {}))
    try:
        yield
    finally:
        for full in aside:
            if full in sys.modules:
                _kept.setdefault(folder, {})[full] = sys.modules.pop(full)
        sys.modules.update(aside)
        sys.path += hidden


def _put_aside(names: set[str], folder: Path) -> dict[str, ModuleType]:
    """Take the modules of these names that are not those of `folder` out of the cache; return those of no FMU."""
    aside: dict[str, ModuleType] = {}
    for full, module in list(sys.modules.items()) if names else ():
        file = _file(module) if full.partition(".")[0] in names else None
        if file is None or file.is_relative_to(folder) or _is_installed(file):
            continue
        root = folder.parent
        home = root / file.relative_to(root).parts[0] if file.is_relative_to(root) else None
        (aside if home is None else _kept.setdefault(home, {}))[full] = sys.modules.pop(full)
    return aside


def _hide(folder: Path) -> list[str]:
    """Take the folders of other FMUs, which pythonfmu leaves there, out of the search path; return them."""
    hidden = [
        place
        for place in sys.path
        if Path(place).is_relative_to(folder.parent) and not Path(place).is_relative_to(folder)
    ]
    sys.path[:] = [place for place in sys.path if place not in hidden]
    return hidden


def _file(module: ModuleType) -> Path | None:
    files = [getattr(module, "__file__", None), *getattr(module, "__path__", [])]
    return next((Path(file) for file in files if file), None)


def _is_installed(file: Path) -> bool:
    return any(file.resolve().is_relative_to(prefix) for prefix in INSTALLED)


def is_python(folder: Path) -> bool:
    """Return whether the FMU unzipped in `folder` is one in Python (pythonfmu)."""
    return (folder / "resources" / "slavemodule.txt").is_file()


def module_names(folder: Path) -> set[str]:
    """Return the names of the modules that an FMU in Python has of its own; an empty set for any other FMU."""
    resources = folder / "resources"
    if not is_python(folder):
        return set()
    files = {path.name.partition(".")[0] for path in resources.iterdir() if path.suffix in (".py", ".so", ".pyd")}
    packages = {path.name for path in resources.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    return (files | packages) - SHARED


def _require_early(folder: Path, other: Path, names: set[str]) -> None:
    """Raise `ValueError` where one of two FMUs that share module `names` imports one of them inside a function."""
    for path in (folder, other) if names else ():
        for file in sorted((path / "resources").glob("*.py")):
            late = names & set(_late_imports(file))
            if late:
                raise ValueError(
                    f"{file.name} imports {min(late)} inside a function, and another FMU of this run has a module of that "
                    "name, which it may get in its place; import it at the top of the file, or rename it in one of the two"
                )


def _late_imports(file: Path) -> Iterator[str]:
    """Yield the top names of the modules that a file imports inside functions."""
    try:
        tree = ast.parse(file.read_bytes())
    except SyntaxError:
        return
    for function in (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)):
        for node in ast.walk(function):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            yield from (name.partition(".")[0] for name in names)
