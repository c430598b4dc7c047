"""Carry out an identification: every set of parameters is a handful of landings, run side by side and each made once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.coupling.errors import RunError
from orchestrator.runs.batch import Batches
from orchestrator.runs.job import Done
from orchestrator.studies.fit import Effort, Fit, fit
from orchestrator.studies.identification.data import Datum, Experiment, experiment
from orchestrator.studies.identification.study import Study

Told = Callable[[str, int, float], None]
"""Told the stage, the sets of parameters calculated so far, and the least sum of squares."""
RUN_TIMEOUT = 600.0
"""s that a landing may take; one that takes longer counts as one that cannot be calculated."""


@dataclass(frozen=True)
class Outcome:
    """A datum beside what the parameters found give.

    Attributes
    ----------
    ours : (k,) in the datum's unit; not a number where its landing failed
    """

    datum: Datum
    ours: np.ndarray

    @property
    def residual(self) -> np.ndarray:
        """Differences in units of the datum's uncertainty (k,)."""
        return self.datum.residual(self.ours)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals: 1 is as near as the uncertainty lets expect."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def met(self) -> bool:
        """Whether all values are within their uncertainty; of a measurement, whether they are by their root mean square."""
        return self.rms <= 1.0 if self.datum.time is not None else bool(np.all(np.abs(self.residual) <= 1.0))


@dataclass(frozen=True)
class Identified:
    """What an identification has found.

    Attributes
    ----------
    outcomes : every datum of the study, used or foretold
    failures : sets of parameters whose landings could not be calculated
    """

    study: Study
    fit: Fit
    outcomes: list[Outcome]
    failures: int

    @property
    def doubts(self) -> list[str]:
        """What keeps the parameters from being taken at their word, a line each."""
        return list(_doubts(self))


def _doubts(found: Identified) -> Iterator[str]:
    for one in found.fit.estimates:
        if not one.determined:
            yield f"{one.name}: the data do not determine it; any value does that keeps to its correlation with others"
        if one.at_bound:
            yield f"{one.name}: lies at its {one.at_bound} bound; the data ask for more"
    missed = [one.datum.name for one in found.outcomes if one.datum.used and not one.met]
    if missed:
        yield f"fitted and yet missed by more than their uncertainty: {', '.join(missed)}"
    if found.fit.scale > 1.0:
        yield (
            f"variances and intervals are widened by {found.fit.scale:.3g}, as if every uncertainty were "
            f"{found.fit.scale**0.5:.3g} times as large"
        )
    elif found.fit.residual.size <= len(found.fit.estimates):
        yield "as many parameters as values or more: what is met says nothing of the model"
    if any(one.datum.time is not None for one in found.outcomes) and found.fit.scale > 1.0:
        yield "values of a time series are counted as independent; where their errors are not, deviations are larger"


def identify(
    study: Study, store: Path, workers: int | None = None, told: Told = lambda stage, count, least: None
) -> Identified:
    """Find the parameters of a study.

    Parameters
    ----------
    store : folder of the finished runs; an identification that was interrupted goes on with them where it was
    workers : processes; None: as many as there are processors
    told : told how far it is

    Raises
    ------
    InputError : the study is wrong; nothing was run
    RunError : the landings cannot be calculated in the middle of the bounds
    """
    whole = experiment(study)
    used = whole.only(whole.used)
    effort = Effort(study.search.population, study.search.generations, study.seed, study.search.intervals)
    with Batches(store, workers, RUN_TIMEOUT) as batches:
        _probe(study, whole, batches)
        residuals = _Residuals(study, used, batches)
        found = fit(study.sought, residuals, effort, lambda stage, least: told(stage, residuals.count, least))
        ours = _calculated(whole, batches, [found.values])[0]
    outcomes = [Outcome(datum, values) for datum, values in zip(whole.data, ours, strict=True)]
    return Identified(study, found, outcomes, residuals.failures)


class _Residuals:
    """Residuals of the data that are fitted at many points."""

    def __init__(self, study: Study, used: Experiment, batches: Batches):
        self._names, self._used, self._batches = list(study.parameters), used, batches
        self.count = self.failures = 0

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return residuals (m, k) at points (m, n)."""
        values = [dict(zip(self._names, map(float, point), strict=True)) for point in points]
        rows = []
        for ours in _calculated(self._used, self._batches, values):
            rows.append(np.concatenate([d.residual(x) for d, x in zip(self._used.data, ours, strict=True)]))
        self.count += len(rows)
        self.failures += sum(not np.all(np.isfinite(row)) for row in rows)
        return np.array(rows)


def _calculated(what: Experiment, batches: Batches, values: Sequence[dict[str, float]]) -> list[list[np.ndarray]]:
    """Return what each datum is for every set of parameters; not a number where a landing of it failed."""
    jobs = [job for one in values for job in what.jobs(one)]
    done, n = batches.run(jobs), len(what.landings)
    return [_ours(what, done[i * n : (i + 1) * n]) for i in range(len(values))]


def _ours(what: Experiment, done: Sequence[Done]) -> list[np.ndarray]:
    by_name = dict(zip(what.landings, done, strict=True))
    failed = {name for name, one in by_name.items() if one.failure is not None}
    return [
        np.full(datum.value.shape, np.nan)
        if failed & set(datum.landings)
        else datum.of([by_name[name].table for name in datum.landings])
        for datum in what.data
    ]


def _probe(study: Study, whole: Experiment, batches: Batches) -> None:
    """Run all landings once in the middle of the bounds, so that what can never work is said before a search begins."""
    middle = {one.name: float(one.value(np.asarray(0.5))) for one in study.sought}
    done = batches.run(whole.jobs(middle))
    names = zip(whole.landings, done, strict=True)
    failures = [
        f"{study.path}: {name}, in the middle of the bounds: {one.failure}" for name, one in names if one.failure
    ]
    if failures:
        raise RunError("\n".join(failures))
