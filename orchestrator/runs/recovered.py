"""Files made of what unfinished runs have left."""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.files import NO_VIEWS, Views, read_run, write_end, write_run
from orchestrator.runs.going_on import FOLDER, goes_on
from orchestrator.runs.result import Run
from orchestrator.runs.unfinished import clean, load_unfinished, unfinished_in


def write_recovered(directory: RunDirectory, views: Views = NO_VIEWS) -> Path:
    """Write what the unfinished runs in a directory have left as files like those of a run that has failed.

    A run that still goes on is left alone: what is made of it goes into a folder of its own.

    Returns
    -------
    Path
        the folder that was written: `directory`, or that of what there is so far
    """
    clean(directory.path)
    runs = [(folder, load_unfinished(folder)) for folder in unfinished_in(directory.path)]
    places = [
        _recovered(RunDirectory.within(RunDirectory.of(folder), _so_far(folder)), run, views) for folder, run in runs
    ]
    if places == [directory.path] or any(goes_on(folder) for folder, _ in runs):
        return places[-1]
    first = read_run(min(path.parent for path in directory.path.glob("*/manifest.json")))
    error = "; ".join(str(run.error) for _, run in runs) or "unfinished: the comparison has not come to its end"
    write_end(directory, first, error, views)
    return directory.path


def _so_far(folder: Path) -> str:
    return f"{FOLDER}/so_far" if goes_on(folder) else "."


def _recovered(place: RunDirectory, run: Run, views: Views) -> Path:
    write_run(place, run, views)
    return place.path
