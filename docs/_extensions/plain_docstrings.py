"""Sphinx extension: docstrings are plain text with backticks and sections in NumPy's layout, and are shown as such.

An entry of a section is ``name : what it is, its unit``; what stands after the colon is a description, not a type. An
indented paragraph is shown as it stands (an equation). Nothing but backticks is markup, so that ``|x|``, ``x_k`` and
``2 * y`` mean themselves.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

SECTIONS = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes", "Source", "Reference", "Examples")
LITERAL = re.compile(r"(``.+?``|`[^`]+`)")
EMPHASIS = re.compile(r"((?<![\w*])\*\w[^*\n]*\*(?![\w*]))")
MARKUP = re.compile(r"([\\*_|])")


def escaped(text: str) -> str:
    """Return `text` with all markup of reStructuredText disarmed but for what is in backticks, and emphasis."""
    parts = LITERAL.split(text)
    return "".join(f"``{part.strip('`')}``" if i % 2 else _escaped(part) for i, part in enumerate(parts))


def _escaped(text: str) -> str:
    parts = EMPHASIS.split(text)
    return "".join(part if i % 2 else MARKUP.sub(r"\\\1", part) for i, part in enumerate(parts))


def sections(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the heading of each section and its lines; the text before the first has none."""
    heading, body = "", []
    for line in lines:
        if body and re.fullmatch(r"-{3,}\s*", line) and body[-1].strip() in SECTIONS:
            title = body.pop().strip()
            yield heading, body
            heading, body = title, []
        else:
            body.append(line)
    yield heading, body


def paragraphs(lines: list[str]) -> Iterator[str]:
    """Yield the lines of running text; an indented paragraph becomes a block that is shown as it stands."""
    before_blank, literal = True, False
    for line in lines:
        indented = line.startswith(" ") and bool(line.strip())
        if indented and before_blank and not literal:
            yield from ("::", "")
            literal = True
        literal = literal and (indented or not line.strip())
        yield line if literal else escaped(line.strip())
        before_blank = not line.strip()


def entries(lines: list[str]) -> Iterator[str]:
    """Yield a list item for each entry of a section: its names in code, then what it is."""
    items: list[list[str]] = []
    for line in lines:
        if line.strip() and not line.startswith(" "):
            items.append([line.strip()])
        elif line.strip() and items:
            items[-1].append(line.strip())
    for item in items:
        head, _, rest = " ".join(item).partition(" : ")
        first, *more = item
        if rest:
            names = ", ".join(f"``{name.strip()}``" for name in head.split(","))
            yield f"* {names}: {escaped(rest)}"
        elif more:
            yield f"* ``{first}``: {escaped(' '.join(more))}"
        else:
            yield f"* {escaped(first)}"


def converted(lines: list[str]) -> list[str]:
    """Return the docstring `lines` as reStructuredText."""
    result: list[str] = []
    for heading, body in sections(lines):
        if heading:
            listed = heading in ("Parameters", "Attributes", "Returns", "Yields", "Raises")
            result += ["", f"**{heading}**", "", *(entries(body) if listed else paragraphs(body)), ""]
        else:
            result += paragraphs(body)
    return result


def shortened(signature: str) -> str:
    """Return a signature without the bounds of its types, and readable where Sphinx cannot read it (a field's factory)."""
    signature = re.sub(r"~?[\w.]*\bAnnotated\[([^,\[\]]+), [^\[\]]*\]", r"\1", signature)
    if "<factory>" in signature:
        signature = re.sub(r"~[\w.]+\.(\w+)", r"\1", signature).replace("<factory>", "…")
    return signature


def setup(app: Any) -> dict[str, bool]:
    """Register the extension."""

    def process(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
        lines[:] = converted(lines)

    def shorten(
        _app: Any, _what: str, _name: str, _object: Any, _options: Any, signature: str | None, returns: str | None
    ) -> tuple[str, str | None] | None:
        return signature and (shortened(signature), returns)

    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", shorten)
    return {"parallel_read_safe": True}
