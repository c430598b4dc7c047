"""TOML files that build on one another: ``extends``, merged key by key; and which file says what."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.reading import text_of

Document = dict[str, Any]
EXTENDS = "extends"
WHAT = "a TOML file"
DEEPEST, LONGEST = 24, 2**64
"""Tables and arrays in one another; the least whole number that is too long, for an FMU's may have 64 bits without a sign."""
TOO_DEEP = f"its tables lie more than {DEEPEST} deep in one another"


def is_quantity(value: Any) -> bool:
    """Whether `value` is a table that stands for one value and says where it comes from."""
    return isinstance(value, dict) and "value" in value


def bare(value: Any) -> Any:
    """Return the value of a quantity, or what is none as it is."""
    return value["value"] if is_quantity(value) else value


def is_over_time(value: Any) -> bool:
    """Whether `value` is a table that stands for an input over time: of times, or of a file."""
    return isinstance(value, dict) and (isinstance(value.get("time"), list) or isinstance(value.get("file"), str))


def is_whole(value: Any) -> bool:
    """Whether `value` is a table that stands for one value or one input over time, and no table of names."""
    return is_quantity(value) or is_over_time(value)


def table_of(document: Document, key: str) -> Document:
    """Return the table at `key`; an empty one where there is none."""
    value = document.get(key)
    return value if isinstance(value, dict) else {}


def parameters_of(document: Document, key: str) -> Document | None:
    """Return the parameters of a section, made where there are none; None if they are no table."""
    section = document.get(key)
    found = section.setdefault("parameters", {}) if isinstance(section, dict) else None
    return found if isinstance(found, dict) else None


@dataclass
class Stack:
    """A document made of several: files that extend one another, then what the command line replaces.

    Attributes
    ----------
    document : as it stands
    layers : who said what, the last word last: a file's path (or an option) → the paths of its values
    """

    document: Document = field(default_factory=dict)
    layers: list[tuple[str, frozenset[str]]] = field(default_factory=list)

    def put(self, above: Document, place: str) -> None:
        """Merge `above` into the document: its values win, tables merge key by key, arrays and quantities are replaced."""
        self.document = merged(self.document, above)
        self.note(place, leaves(above))

    def note(self, place: str, paths: Iterable[str]) -> None:
        """Note that `place` said what stands at `paths`."""
        self.layers.append((place, frozenset(paths)))

    def place_of(self, path: str) -> str:
        """Return who spoke last of the value at `path`, of what it belongs to or of what belongs to it; else the last file."""
        for place, paths in reversed(self.layers):
            if path and any(_belongs(path, known) or _belongs(known, path) for known in paths):
                return place
        return next(place for place, _ in reversed(self.layers) if not place.startswith("--"))


def _belongs(path: str, to: str) -> bool:
    return path == to or path.startswith((f"{to}.", f"{to}["))


def merged(below: Document, above: Document) -> Document:
    """Return both documents as one; where both speak, `above` wins."""
    found = dict(below)
    for key, value in above.items():
        there = found.get(key)
        both = isinstance(value, dict) and isinstance(there, dict) and not (is_whole(value) or is_whole(there))
        found[key] = merged(there, value) if both and isinstance(there, dict) else value
    return found


def leaves(document: Document, prefix: str = "") -> Iterator[str]:
    """Yield the path of every value of `document`."""
    for key, value in document.items():
        if isinstance(value, dict) and value and not is_whole(value):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key


_known: ContextVar[dict[Path, Document] | None] = ContextVar("known", default=None)


@contextmanager
def read_once() -> Iterator[None]:
    """Within it each file is read once, so that a command sees one state of it, however many ask."""
    if _known.get() is not None:
        yield
        return
    token = _known.set({})
    try:
        yield
    finally:
        _known.reset(token)


def read_once_from_now_on() -> None:
    """Read each file once until this process ends."""
    _known.set({})


def _parsed(path: Path) -> Document:
    """Return the content of a file, which whoever asks may change."""
    known = _known.get()
    if known is None:
        return parsed(text_of(path, WHAT))
    place = path.resolve()
    if place not in known:
        known[place] = parsed(text_of(path, WHAT))
    return _copied(known[place])


def parsed(text: str) -> Document:
    """Return what a text in TOML says; `ValueError` says what is wrong with it."""
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    _require_plain(content)
    return content


def _require_plain(content: Document) -> None:
    """Raise `ValueError` where tables lie too deep in one another, or a whole number is longer than TOML's."""
    level: list[tuple[str, Any]] = [("", content)]
    for _ in range(DEEPEST):
        level = [item for path, value in level for item in _below(path, value)]
        long = next((path for path, value in level if isinstance(value, int) and abs(value) >= LONGEST), None)
        if long is not None:
            raise ValueError(f"{long}: a whole number has 64 bits at most; write a real one, 1e30")
    if any(isinstance(value, dict | list) for _, value in level):
        raise ValueError(TOO_DEEP)


def _below(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield what a table or an array holds, with its path."""
    items = value.items() if isinstance(value, dict) else enumerate(value, 1) if isinstance(value, list) else ()
    for key, item in items:
        yield (f"{path}[{key}]" if isinstance(value, list) else f"{path}.{key}".lstrip(".")), item


def _copied(content: Any) -> Any:
    """Return tables and arrays anew; other values of a TOML file cannot be changed."""
    if isinstance(content, dict):
        return {key: _copied(value) for key, value in content.items()}
    return [_copied(value) for value in content] if isinstance(content, list) else content


def read(path: Path) -> Document:
    """Return the content of a TOML file; `InputError` names file, cause and cure."""
    try:
        return _parsed(path)
    except ValueError as error:
        cure = "; mend that line" if isinstance(error, tomllib.TOMLDecodeError) else ""
        raise InputError(f"{path}: not {WHAT}: {error}{cure}") from None


def chain(
    path: Path, find: Callable[[str, Path], Path], content: Callable[[Path], Document] = read
) -> list[tuple[Path, Document]]:
    """Return the file at `path` and those that it extends, each with its content, the farthest base first.

    Parameters
    ----------
    find : what ``extends = "…"`` names, and the folder of the file in which it stands → the file's path
    content : what a file says
    """
    found: list[tuple[Path, Document]] = []
    base: Path | None = path
    while base is not None:
        if base.resolve() in [one.resolve() for one, _ in found]:
            circle = " → ".join(str(one) for one in [*(one for one, _ in found), base])
            raise InputError(
                f"{found[-1][0]}: {EXTENDS}: {circle} is a circle; extend a file that does not lead back here"
            )
        document = content(base)
        found.append((base, document))
        base = _base(base, document.pop(EXTENDS, None), find)
    return found[::-1]


def _base(path: Path, name: Any, find: Callable[[str, Path], Path]) -> Path | None:
    if name is None:
        return None
    if not isinstance(name, str):
        raise InputError(f"{path}: {EXTENDS}: {name!r} must be a string: a name, or a path relative to this file")
    try:
        return find(name, path.parent)
    except InputError as error:
        raise InputError(f"{path}: {EXTENDS}: {problem}" for problem in error.problems) from None
