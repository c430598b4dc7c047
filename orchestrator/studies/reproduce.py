"""The paper held against our runs, claim by claim: from the files of a study to ``reproduction.md`` and ``.json``."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from orchestrator.coupling.errors import DONE, FAILED
from orchestrator.coupling.run.results import replacing, write_json
from orchestrator.runs.batch import Counted, run_batch
from orchestrator.runs.directory import folder_for
from orchestrator.runs.job import Done, Job
from orchestrator.studies import identified
from orchestrator.studies.book import Book, jobs_of, jobs_of_sensitivity, jobs_of_series
from orchestrator.studies.documents import Claim, Documents
from orchestrator.studies.reading import load_study, shipped
from orchestrator.studies.verdicts import Row, rows_of

STORE = Path("runs/reproduce")
DOCS = Path("docs")
PICTURES = "figures/reproduction"
SENSITIVE = "point9"
"""The landing at which the numbers assumed are varied."""
TIMEOUT = 600.0
"""s that one run may take; the longest takes ten."""
K = TypeVar("K")


@dataclass(frozen=True)
class Reproduction:
    """What ``orchestrator reproduce`` has found.

    Attributes
    ----------
    rows : one a claim
    page : the file written, ``reproduction.json`` beside it
    wall_s : of all that was run now
    """

    book: Book
    rows: Sequence[Row]
    page: Path
    wall_s: float

    @property
    def exit_status(self) -> int:
        """0; 3 where a run has failed."""
        return FAILED if self.book.failures() else DONE


def reproduce(
    study: Path | None = None,
    out: Path = STORE,
    docs: Path | None = None,
    only: Sequence[str] = (),
    workers: int | None = None,
    progress: Counted = lambda done, of: None,
) -> Reproduction:
    """Run what the claims need, and write page, JSON and pictures.

    Parameters
    ----------
    study : folder with ``claims.toml`` and ``landings.toml``; None: the paper's
    out : folder of finished runs, which are not made again
    docs : folder of the page; None: ``docs``, or `out` where only some claims are asked for
    only : ids of claims; empty: all, with the series and the sensitivity
    workers : processes
    progress : told how many runs are done, and of how many
    """
    documents = load_study(study or shipped())
    claims = documents.chosen(only)
    page = folder_for(docs or (out if only else DOCS), "--docs") / "reproduction.md"
    start = clock.monotonic()
    book = _run(documents, claims, out, whole=not only, workers=workers, progress=progress)
    rows = rows_of(book, claims)
    _write(book, rows, page, whole=not only)
    return Reproduction(book, rows, page, clock.monotonic() - start)


def _run(
    documents: Documents, claims: Sequence[Claim], out: Path, whole: bool, workers: int | None, progress: Counted
) -> Book:
    jobs = jobs_of(documents, claims)
    series = jobs_of_series(documents) if whole else {}
    ends = jobs_of_sensitivity(documents, SENSITIVE) if whole and documents.landings.assumed else {}
    done = run_batch([*jobs.values(), *series.values(), *ends.values()], out, workers, TIMEOUT, progress)
    first, second = len(jobs), len(jobs) + len(series)
    groups = (_named(jobs, done[:first]), _named(series, done[first:second]), _named(ends, done[second:]))
    return Book(documents, *groups, identified.load(documents.folder))


def _named(jobs: dict[K, Job], done: Sequence[Done]) -> dict[K, Done]:
    return dict(zip(jobs, done, strict=True))


def _write(book: Book, rows: Sequence[Row], page: Path, whole: bool) -> None:
    from orchestrator.studies.page import text
    from orchestrator.studies.pictures import draw  # Matplotlib takes a second, and a wrong id is said before

    write_json(page.with_suffix(".json"), [row.content() for row in rows])
    drawn = draw(book, page.parent / PICTURES) if whole else []
    with replacing(page) as temporary:
        temporary.write_text(text(book, rows, drawn, whole), encoding="utf-8")
