"""XML of other tools: no document types, so that nothing grows or is fetched while it is read."""

from __future__ import annotations

from pathlib import PurePath
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestrator.coupling.errors import InputError


class _NoDoctype(ElementTree.TreeBuilder):
    """Refuses a document type: entities are declared there, and may grow without bounds or name other files."""

    def doctype(self, *_: object) -> None:
        raise InputError("has a document type (DOCTYPE), which system structures do not need and which is not read")


def parsed(content: bytes, place: str) -> Element:
    """Return the root element of a file; `InputError` names the `place` where it is none."""
    try:
        return ElementTree.fromstring(content, ElementTree.XMLParser(target=_NoDoctype()))
    except InputError as error:
        raise InputError(f"{place}: {error}; take it out") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{place}: not XML: {error}; export it anew") from None


def tag(element: Element) -> str:
    """Return the name of an element without its namespace: versions of a standard differ in it."""
    return str(element.tag).rpartition("}")[2]


def children(element: Element | None, *names: str) -> list[Element]:
    """Return the elements along `names`, below an element: those of the last name."""
    found = [] if element is None else [element]
    for name in names:
        found = [child for one in found for child in one if tag(child) == name]
    return found


def child(element: Element | None, *names: str) -> Element | None:
    """Return the first element along `names`; None where there is none."""
    return next(iter(children(element, *names)), None)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute as a number; `ValueError` says what stands there."""
    text = element.get(name)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError:
        raise ValueError(f"{name} = {text!r} is no number") from None


def is_inside(uri: str) -> bool:
    """Return whether a path stays in the folder that it is relative to."""
    path = PurePath(uri)
    return bool(uri) and not path.is_absolute() and ".." not in path.parts and ":" not in uri and "\\" not in uri
