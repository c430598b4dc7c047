"""Pieces of a page in Markdown."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 118
ROUND_OFF = 1e-9
"""Below which ours is 0, in any unit of a claim."""


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def filled(words: str, indent: str = "") -> str:
    """Return a paragraph in lines of the page's width."""
    return textwrap.fill(words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def number(values: Sequence[float] | None, digits: int = 0) -> str:
    """Return values for a reader, with so many digits; 0: as they were written. What is round-off of 0 is 0."""
    if values is None:
        return "–"
    shown = [_shown(value, digits) for value in values]
    return " … ".join(shown) if len(shown) == 2 else ", ".join(shown)


def _shown(value: float, digits: int) -> str:
    if digits and abs(value) < ROUND_OFF:
        return "0"
    if abs(value) >= 1e5:
        return f"{value:.3g}"
    return f"{value:.{digits}g}" if digits else f"{value:g}"
