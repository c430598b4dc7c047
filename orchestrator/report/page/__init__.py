"""The page of a run, a comparison or a sweep: one file that works offline, made from its directory alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError, OrchestratorError
from orchestrator.coupling.run.results import read_json, replacing
from orchestrator.report.drawing import pictures, results_in, run_folders
from orchestrator.report.page import template
from orchestrator.report.page.content import Content, of_results
from orchestrator.report.page.sweep import is_sweep, of_sweep
from orchestrator.report.page.template import DIST, is_built
from orchestrator.runs.files import require_finished

NAME = "report.html"
MOST = 4_000_000
"""Bytes of a page; longer runs are thinned."""
OWN = 1_250_000
"""Bytes of it left to scripts, tables and all else that is not arrays."""


def report(directory: Path, web: Path = DIST) -> Path:
    """Draw the pictures of a finished run or comparison anew, and return the page; of a sweep, the page alone.

    Parameters
    ----------
    web : folder of the template that was built; where it is missing the page has the pictures in it

    Raises
    ------
    InputError : there are no results, or they are damaged
    """
    if is_sweep(directory):
        return _guarded(directory, lambda: write_sweep(directory, web))
    require_finished(directory)
    return _guarded(directory, lambda: _drawn_anew(directory, web))


def _drawn_anew(directory: Path, web: Path) -> Path:
    list(pictures(directory, results_in(directory)))
    return write(directory, read_json(directory / "manifest.json"), web)


def _guarded(directory: Path, make: Callable[[], Path]) -> Path:
    """Return what `make` has made; `InputError` where the directory is damaged."""
    try:
        return make()
    except Exception as error:  # whatever is in a damaged folder: a file of another kind, half a table, a missing key
        if isinstance(error, OrchestratorError) or (isinstance(error, OSError) and error.errno):
            raise  # said already; or the system's word, a full disk for instance
        raise InputError(f"{directory}: damaged results ({type(error).__name__}: {error}); run it again") from error


def write(directory: Path, manifest: Mapping[str, Any], web: Path = DIST) -> Path:
    """Write the page of a run or a comparison from what stands in its directory and its `manifest`, and return its path."""
    return _written(of_results(results_in(directory), manifest, web, MOST - OWN), directory, web)


def write_sweep(directory: Path, web: Path = DIST) -> Path:
    """Write the page of a sweep, finished or not, from what stands in its directory, and return its path."""
    return _written(of_sweep(directory, web, MOST - OWN), directory, web)


def _written(content: Content, directory: Path, web: Path) -> Path:
    head, body = content.head, content.body
    if is_built(web):
        text = template.filled(web, head.title, body, head.content(), content.data.blob.text, content.module)
    else:
        text = template.plain(head.title, body, _drawn(directory))
    with replacing(directory / NAME, lasting=False) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return directory / NAME


def _drawn(directory: Path) -> Iterator[tuple[str, Path]]:
    """Yield the pictures that were drawn, with names that say of what."""
    for folder in dict.fromkeys([*run_folders(directory), directory]):
        for path in sorted([*folder.glob("plots/*.png"), *folder.glob("map.png")]):
            yield path.relative_to(directory).with_suffix("").as_posix(), path
