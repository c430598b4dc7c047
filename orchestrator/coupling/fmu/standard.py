"""Model descriptions held to the standard: what an FMU cannot run with is refused, what it only departs in is said.

Refused are descriptions that no reader could take in one sense: references out of range, unknown types, numbers that are
none, names that stand twice. Tools depart from the standard in much else, and their FMUs run all the same; FMPy's
validation finds that.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from math import prod
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from fmpy.model_description import ModelDescription, ModelVariable

MOST_BYTES = 512 * 2**20
"""Of a model description: 500 000 variables have 150 MB."""
MOST_ELEMENTS = 10**6
"""Of the arrays of an FMU, together."""
REFERENCES = 2**32
DOUBLE = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?INF|NaN|[+-]?(inf|nan)")
WHOLE = re.compile(r"[+-]?\d{1,20}")
UNSIGNED = re.compile(r"\+?\d{1,20}")
OLD = ("Real", "Integer", "Boolean", "String", "Enumeration")
"""Types of FMI 1.0 and 2.0."""
INTEGERS = {
    f"{sign}Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1)) if not sign else (0, 2**n)
    for n in (8, 16, 32, 64)
    for sign in ("", "U")
}
"""Type → least value, and the first that is too large."""
REALS = ("Real", "Float32", "Float64")
NEW = (*REALS[1:], *INTEGERS, "Boolean", "String", "Enumeration", "Binary", "Clock")
RANGES = INTEGERS | {"Integer": INTEGERS["Int32"], "Enumeration": INTEGERS["Int64"]}
SHOWN = 3
"""Problems that are named; the others are counted."""


class DescriptionError(ValueError):
    """What is wrong with a model description."""

    def __init__(self, problems: list[str]):
        more = f"; and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
        super().__init__(
            f"its modelDescription.xml is not one: {'; '.join(problems[:SHOWN])}{more}; export the FMU anew"
        )


def parsed_xml(content: bytes) -> ElementTree.Element:
    """Return the root of a model description; `DescriptionError` where it is no XML, or would have others read in."""
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = _refuse
    try:
        parser.Parse(content, True)
        return ElementTree.fromstring(content)
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise DescriptionError([str(error)]) from None


def _refuse(*_: object) -> None:
    raise ValueError("it has a document type, whose entities FMI does not use")


def require_usable(root: ElementTree.Element) -> None:
    """Raise `DescriptionError` where a description cannot be taken in one sense."""
    problems = list(_problems(root))
    if problems:
        raise DescriptionError(problems)


def _problems(root: ElementTree.Element) -> Iterator[str]:
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        yield "no element fmiModelDescription with a fmiVersion"
        return
    if version not in ("1.0", "2.0") and not version.startswith("3."):
        yield f"FMI {version[:20]} is not known; 1.0, 2.0 and 3.0 are"
        return
    yield from _identifiers(root, version)
    variables = root.find("ModelVariables")
    if variables is None:
        yield "no element ModelVariables"
        return
    names = Counter(variable.get("name") for variable in variables)
    yield from (
        f"two variables are called {name!r}" for name, number in names.items() if number > 1 and name is not None
    )
    for variable in variables:
        yield from (f"variable {variable.get('name')!r} {problem}" for problem in _wrong(variable, version))


def _identifiers(root: ElementTree.Element, version: str) -> Iterator[str]:
    """Yield what is wrong with the name of the binary."""
    kinds = [root] if version == "1.0" else [*root.iterfind("CoSimulation"), *root.iterfind("ModelExchange")]
    for kind in kinds:
        name = kind.get("modelIdentifier")
        if not name or name in (".", "..") or re.search(r"[/\\\0]", name):
            yield f"no modelIdentifier that names a binary, but {name!r}" if name else "no modelIdentifier"
    if not (root.get("guid") if version < "3" else root.get("instantiationToken")):
        yield "no guid" if version < "3" else "no instantiationToken"


def _wrong(variable: ElementTree.Element, version: str) -> Iterator[str]:
    if not variable.get("name"):
        yield "has no name"
    reference = variable.get("valueReference") or ""
    if not UNSIGNED.fullmatch(reference.strip()) or int(reference) >= REFERENCES:
        yield f"has the value reference {reference[:40]!r}; it is a number below 2^32"
    value = _value(variable, version)
    if value is None:
        yield f"is of a type that FMI {version} does not have ({variable.tag})"
    else:
        yield from _wrong_numbers(value)


def _value(variable: ElementTree.Element, version: str) -> ElementTree.Element | None:
    """Return the element with type, start and bounds of a variable."""
    if version.startswith("3"):
        return variable if variable.tag in NEW else None
    return next((child for child in variable if child.tag in OLD), None)


def _wrong_numbers(value: ElementTree.Element) -> Iterator[str]:
    """Yield the attributes of a variable that are no numbers of its type."""
    fits = _fits(value.tag)
    for name in ("start", "min", "max"):
        text = value.get(name)
        if text is None or fits is None:
            continue
        wrong = next((word for word in text.split() or [text] if not fits(word)), None)
        if wrong is not None:
            yield f"has {name} = {wrong[:40]!r}, which is no {value.tag}"


def _fits(kind: str) -> Callable[[str], bool] | None:
    """Return whether a word is a value of a type; None for types whose values are any text."""
    if kind in REALS:
        return lambda word: DOUBLE.fullmatch(word) is not None
    if kind == "Boolean":
        return lambda word: word in ("true", "false", "1", "0")
    if kind not in RANGES:
        return None
    least, beyond = RANGES[kind]
    return lambda word: WHOLE.fullmatch(word) is not None and least <= int(word) < beyond


def require_consistent(description: ModelDescription) -> None:
    """Raise `DescriptionError` where sizes, bounds or start values contradict one another."""
    problems = [f"variable {v.name!r} {problem}" for v in description.modelVariables for problem in _contradictions(v)]
    if problems:
        raise DescriptionError(problems)
    require_sizes(description.modelVariables, lambda variable: variable.shape or ())


def require_sizes(variables: Iterable[ModelVariable], shape: Callable[[ModelVariable], tuple[int, ...]]) -> None:
    """Raise `DescriptionError` where arrays of these shapes have no elements, or more than can be kept."""
    shapes = {variable.name: shape(variable) for variable in variables}
    empty = next((name for name, lengths in shapes.items() if any(length < 1 for length in lengths)), None)
    if empty is not None:
        raise DescriptionError([f"variable {empty!r} has the dimensions {shapes[empty]}; each is 1 at least"])
    elements = sum(prod(lengths) for lengths in shapes.values() if lengths)
    if elements > MOST_ELEMENTS:
        raise DescriptionError([f"its arrays have {elements:.3g} elements, more than {MOST_ELEMENTS:.0e}"])


def _contradictions(variable: ModelVariable) -> Iterator[str]:
    least, most = (
        _number(getattr(variable, name) or getattr(variable.declaredType, name, None)) for name in ("min", "max")
    )
    if least is not None and most is not None and least > most:
        yield f"has min = {least:g} above its max = {most:g}"
    elif variable.causality in ("parameter", "structuralParameter", "input"):
        for word in (variable.start or "").split() if _fits(variable.type) and variable.type != "Boolean" else ():
            start = float(word)
            if (least is not None and start < least) or (most is not None and start > most):
                yield f"has start = {start:g} beyond its min or max"
                return


def _number(text: Any) -> float | None:
    """Return a bound; None where there is none, or it belongs to a type and is no number."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
