"""A sweep is run: look by look, until all is made or enough is known."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

from orchestrator.catalogue.documents import read_once
from orchestrator.coupling.errors import InputError
from orchestrator.runs.batch import Batches
from orchestrator.runs.job import Done, Job
from orchestrator.studies.sweep import probability
from orchestrator.studies.sweep.design import Row, job, rows, sensitivity_rows
from orchestrator.studies.sweep.outcome import Chances, Outcome, chances
from orchestrator.studies.sweep.ranges import all_ranges
from orchestrator.studies.sweep.refine import more_rows
from orchestrator.studies.sweep.sensitivity import Sensitivity, sensitivities
from orchestrator.studies.sweep.study import FEWEST_SCRAMBLES, Study

Told = Callable[[int, int, int], None]
"""Told how many runs are done, of how many, and how many of them failed."""
Save = Callable[["Swept"], None]
SAVED_EVERY = 10.0
"""s between tables that are written while runs are made; 1,000 rows take 0.1 s."""
FEWEST_SAMPLES = 25
"""After which a study of independent samples looks first."""
MOST_PROBLEMS = 5
"""Of a study whose runs cannot be read: more of them say no more."""


@dataclass
class Swept:
    """A sweep as far as it has come.

    Attributes
    ----------
    outcomes : of the runs that are done, by their numbers
    looks : how often it may look whether it knows enough
    complete, stopped : whether it came to its end; whether that was before all its samples
    """

    study: Study
    looks: int
    outcomes: list[Outcome] = field(default_factory=list)
    complete: bool = False
    stopped: bool = False
    _sensitivities: tuple[int, list[Sensitivity]] = field(default_factory=lambda: (0, []), repr=False)

    @property
    def failed(self) -> list[Outcome]:
        """The runs that have no results."""
        return [outcome for outcome in self.outcomes if outcome.done.failure is not None]

    @property
    def chances(self) -> list[Chances]:
        """How probable it is that limits hold."""
        return chances(self.study, self.outcomes, self.looks)

    @property
    def sensitivities(self) -> list[Sensitivity]:
        """What margins and extremes hang on, as far as all runs are there that this is taken from."""
        if self._sensitivities[0] != len(self.outcomes):
            self._sensitivities = len(self.outcomes), sensitivities(self.study, self.outcomes)
        return self._sensitivities[1]

    @property
    def counts(self) -> dict[str, int]:
        """How many runs there are of each kind."""
        kinds = {"safe": True, "not_safe": False, "not_judged": None}
        well = [outcome for outcome in self.outcomes if outcome.done.failure is None]
        found = {name: sum(outcome.safe is kind for outcome in well) for name, kind in kinds.items()}
        return {"runs": len(self.outcomes), **found, "failed": len(self.failed)}


def sweep(
    study: Study,
    store: Path,
    save: Save,
    workers: int | None = None,
    timeout: float | None = None,
    told: Told = lambda done, of, failed: None,
    dask: str | None = None,
) -> Swept:
    """Make the runs that `store` has not, and return all.

    Parameters
    ----------
    save : writes what is known so far; called every `SAVED_EVERY` seconds, and at the end, be it an interruption
    workers, timeout, dask : as for `Batches`; timeout None: the study's
    told : how far it is
    """
    ends = _looks(study)
    found = Swept(study, len(ends))
    first = 0
    with read_once(), Batches(store, workers, timeout or study.timeout, dask) as batches:
        for end in ends:
            _Look(found, rows(study, first, end), save, told).made(batches)
            first, found.stopped = end, end < ends[-1]
            if _knows_enough(found):
                break
        if asked := sensitivity_rows(study):
            _Look(found, asked, save, told).made(batches)
        while added := more_rows(study, found.outcomes):
            _Look(found, added, save, told).made(batches)
    found.complete = True
    save(found)
    return found


def _looks(study: Study) -> list[int]:
    sample = study.sample
    if sample is None:
        return [1]
    independent = sample.method == "random"
    total, fewest = (sample.count, FEWEST_SAMPLES) if independent else (sample.scrambles, FEWEST_SCRAMBLES)
    return probability.looks(total, fewest, sample.stop_when is not None)


def _knows_enough(found: Swept) -> bool:
    stop = found.study.sample.stop_when if found.study.sample is not None else None
    if stop is None:
        return False
    widths = [c.of[stop.of].half_width if stop.of in c.of else 1.0 for c in found.chances]
    return max(widths) <= stop.half_width


class _Look:
    """The runs from one look to the next."""

    def __init__(self, found: Swept, wanted: Sequence[Row], save: Save, told: Told):
        self.found, self.save, self.told = found, save, told
        self.before = list(found.outcomes)
        self.jobs: list[Job] = [job(found.study, row) for row in wanted]
        self.rows, self.done, self.saved = wanted, dict[str, Done](), -inf

    def made(self, batches: Batches) -> None:
        """Make the runs; what is done is saved even if they are interrupted."""
        try:
            ended = batches.run(self.jobs, self._counted, self._ended)
        except InputError as error:
            raise self._in_words(error) from None
        except BaseException:
            self._gather()
            with suppress(OSError):  # of a full disk the table that is there stays
                self.save(self.found)
            raise
        self.done |= {one.job.key: one for one in ended}
        self._gather()

    def _ended(self, done: Done) -> None:
        self.done[done.job.key] = done

    def _counted(self, done: int, of: int) -> None:
        """Tell how far it is, and save it now and then; at first before anything is run, so that the folder is known."""
        failed = sum(one.failure is not None for one in self.done.values())
        failed += sum(outcome.done.failure is not None for outcome in self.before)
        self.told(len(self.before) + done, len(self.before) + of, failed)
        if time.monotonic() > self.saved + SAVED_EVERY:
            self._gather()
            self.save(self.found)
            self.saved = time.monotonic()

    def _gather(self) -> None:
        mine = [
            Outcome(row, self.done[one.key])
            for row, one in zip(self.rows, self.jobs, strict=True)
            if one.key in self.done
        ]
        self.found.outcomes = [*self.before, *mine]

    def _in_words(self, error: InputError) -> InputError:
        """Return what is wrong with the runs: in the study's file, a few of many."""
        path, problems = self.found.study.path, list(dict.fromkeys(map(_without_option, error.problems)))
        more = [f"and {len(problems) - MOST_PROBLEMS} more like these"] if len(problems) > MOST_PROBLEMS else []
        return InputError(f"{path}: {problem}" for problem in [*problems[:MOST_PROBLEMS], *more])


def _without_option(problem: str) -> str:
    """Return a problem without the option of a command that a study has no need of."""
    return problem.removeprefix("--set: ").removeprefix("--set ").removeprefix("--robot: ")


def describe(found: Swept) -> dict[str, Any]:
    """Return what ``study.json`` says of it."""
    study = found.study
    return {
        "study": study.name,
        "title": study.title,
        "hash": study.hash,
        "complete": found.complete,
        "stopped_early": found.stopped,
        "counts": found.counts,
        "failures": [{"run": o.row.number, "reason": o.done.failure} for o in found.failed],
        "probability": [one.content() for one in found.chances],
        "sensitivity": [one.content() for one in found.sensitivities],
        "safe_ranges": all_ranges(study, found.outcomes) if found.complete else [],
        "content": study.model_dump(by_alias=True, exclude_none=True),
    }
