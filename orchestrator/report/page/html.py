"""Pieces of HTML; what comes from files is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape as escape


class Html(str):
    """Text that is HTML already; a plain string in its place is escaped."""


Cell = str | Html


def text(cell: Cell) -> Html:
    """Return a cell as HTML."""
    return cell if isinstance(cell, Html) else Html(escape(cell))


def tag(name: str, content: Cell | Iterable[Cell] = "", **attributes: str) -> Html:
    """Return an element; an attribute's underscore stands for a hyphen, one at its end for nothing."""
    inner = text(content) if isinstance(content, str) else "".join(map(text, content))
    given = "".join(f' {key.strip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items())
    return Html(f"<{name}{given}>{inner}</{name}>")


def table(head: Sequence[Cell], rows: Iterable[Sequence[Cell]]) -> Html:
    """Return a table with a row of headings; what is wider than the page scrolls."""
    top = tag("thead", tag("tr", (tag("th", cell, scope="col") for cell in head)))
    body = tag("tbody", (tag("tr", (tag("td", cell) for cell in row)) for row in rows))
    return tag("div", tag("table", (top, body)), class_="scroll")


def pairs(rows: Iterable[Sequence[Cell]]) -> Html:
    """Return a table of names and values, without headings."""
    lines = (tag("tr", (tag("th", name, scope="row"), tag("td", value))) for name, value in rows)
    return tag("div", tag("table", tag("tbody", lines)), class_="scroll")


def card(name: str, title: str, content: Cell | Iterable[Cell], wide: bool = False) -> Html:
    """Return a section of the page with its heading; a `wide` one is as wide as the page."""
    inner = [content] if isinstance(content, str) else list(content)
    return tag("section", [tag("h2", title), *inner], class_="card wide" if wide else "card", id=name)


def folded(title: str, content: Cell) -> Html:
    """Return what is shown on demand."""
    return tag("details", (tag("summary", title), content))


def seek(time: float, what: str) -> Html:
    """Return a button that takes the replay to `time` (s)."""
    return tag("button", "show", type="button", data_seek=f"{time:.9g}", aria_label=f"show {what} at {time:.2f} s")
