"""Pieces of a page in Markdown."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 118


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def filled(words: str, indent: str = "") -> str:
    """Return a paragraph in lines of the page's width."""
    return textwrap.fill(words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def number(values: Sequence[float] | None, digits: int = 0) -> str:
    """Return values for a reader, with so many digits; 0: as they were written."""
    if values is None:
        return "–"
    form = f"{{:.{digits}g}}" if digits else "{:g}"
    shown = [form.format(v) if abs(v) < 1e5 else f"{v:.3g}" for v in values]
    return " … ".join(shown) if len(shown) == 2 else ", ".join(shown)
