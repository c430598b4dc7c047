"""All pictures of a study, drawn and saved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from orchestrator.report.drawn import drawn
from orchestrator.report.style import saved
from orchestrator.studies import figures, referee_figures
from orchestrator.studies.book import Book

DPI = 110
"""Of pictures that are kept in the repository."""


@dataclass(frozen=True)
class Picture:
    """A picture of the page: `path` relative to it, and what to say of it."""

    path: str
    title: str
    caption: str
    of_paper: bool = True


def draw(book: Book, folder: Path) -> list[Picture]:
    """Draw every picture into `folder`, which lies two levels below the page; return them."""
    pictures = []
    for one in (*figures.DRAWINGS, *referee_figures.DRAWINGS):
        path = folder / f"{one.name}.png"
        if not drawn(lambda one=one, path=path: _drawing(one, book, path)):
            continue
        place = f"{folder.parent.name}/{folder.name}/{path.name}"
        pictures.append(Picture(place, one.title, one.caption, one.of_paper))
    return pictures


def _drawing(one: figures.Drawing, book: Book, path: Path) -> list[Path]:
    with saved(path, one.size, DPI) as figure:
        one.draw(figure, book)
    return [path]
