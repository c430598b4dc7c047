"""The page of a run, a comparison or a sweep: one file that works offline, made from its directory alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError, OrchestratorError
from orchestrator.coupling.run.results import read_json, replacing
from orchestrator.report.drawing import pictures, results_in, run_folders
from orchestrator.report.page import template
from orchestrator.report.page.content import Content, of_results
from orchestrator.report.page.template import DIST, is_built
from orchestrator.runs.files import require_finished

NAME = "report.html"
MOST = 4_000_000
"""Bytes of a page; longer runs are thinned."""
OWN = 1_250_000
"""Bytes of it left to scripts, tables and all else that is not arrays."""


def report(directory: Path, web: Path = DIST) -> Path:
    """Draw the pictures of a finished run or comparison anew, and return the page.

    Parameters
    ----------
    web : folder of the template that was built; where it is missing the page has the pictures in it

    Raises
    ------
    InputError : there are no results, or they are damaged
    """
    require_finished(directory)
    try:
        list(pictures(directory, results_in(directory)))
        return write(directory, read_json(directory / "manifest.json"), web)
    except Exception as error:  # whatever is in a damaged folder: a file of another kind, half a table, a missing key
        if isinstance(error, OrchestratorError) or (isinstance(error, OSError) and error.errno):
            raise  # said already; or the system's word, a full disk for instance
        raise InputError(f"{directory}: damaged results ({type(error).__name__}: {error}); run it again") from error


def write(directory: Path, manifest: Mapping[str, Any], web: Path = DIST) -> Path:
    """Write the page of a directory from what stands there and its `manifest`, and return its path."""
    content = of_results(results_in(directory), manifest, MOST - OWN)
    text = _interactive(content, web) if is_built(web) else _plain(content, directory)
    with replacing(directory / NAME) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return directory / NAME


def _interactive(content: Content, web: Path) -> str:
    head = content.head
    return template.filled(web, head.title, content.body, head.content(), content.data.blob.text)


def _plain(content: Content, directory: Path) -> str:
    return template.plain(content.head.title, content.body, _drawn(directory))


def _drawn(directory: Path) -> Iterator[tuple[str, Path]]:
    """Yield the pictures that were drawn, with names that say of what."""
    folders = dict.fromkeys([*run_folders(directory), directory])
    for folder in folders:
        for path in sorted(folder.glob("plots/*.png")):
            yield path.relative_to(directory).with_suffix("").as_posix(), path
