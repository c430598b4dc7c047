"""What is fitted: data, the landings that they speak of, and the runs that a set of parameters asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.run.results import Table
from orchestrator.runs.job import Job
from orchestrator.scenario.types import Scenario
from orchestrator.studies import reading
from orchestrator.studies.book import job_of, measured, taken
from orchestrator.studies.documents import Claim, Documents
from orchestrator.studies.identification.measured import Series, end_of, read_series
from orchestrator.studies.identification.study import Measurement, Study, Target
from orchestrator.studies.signals import DERIVED

TOLERANCE = 1e-5
"""m; local error of a monolithic step: leaves 1e-4 of the range of the flagship's roll, below any measurement's."""
INTERVAL = 0.01
"""s between the rows in which a measurement is interpolated: 2e-4 of an amplitude at 0.6 Hz."""


@dataclass(frozen=True)
class Datum:
    """Values that a set of parameters should give.

    Attributes
    ----------
    value, uncertainty : (k,) in `unit`
    landings : whose tables `of` takes, in that order
    of : from these tables to ours (k,)
    time : (k,) s, of a measurement; None of a claim
    """

    name: str
    unit: str
    value: np.ndarray
    uncertainty: np.ndarray
    used: bool
    landings: tuple[str, ...]
    of: Callable[[Sequence[Table]], np.ndarray]
    time: np.ndarray | None = None

    def residual(self, ours: np.ndarray) -> np.ndarray:
        """Return the differences in units of the uncertainty (k,)."""
        return (ours - self.value) / self.uncertainty


@dataclass(frozen=True)
class Experiment:
    """All that is calculated for one set of parameters.

    Attributes
    ----------
    landings : name → its run, with the values that do not change
    targets : parameter → unit, and where in the scenarios it goes
    """

    landings: Mapping[str, Job]
    data: Sequence[Datum]
    targets: Mapping[str, tuple[str, Sequence[Target]]]

    @property
    def used(self) -> list[Datum]:
        """The data that are fitted."""
        return [datum for datum in self.data if datum.used]

    def only(self, data: Sequence[Datum]) -> Experiment:
        """Return it with `data` alone, and the landings that these need."""
        names = {name for datum in data for name in datum.landings}
        return replace(self, data=data, landings={n: job for n, job in self.landings.items() if n in names})

    def jobs(self, values: Mapping[str, float]) -> list[Job]:
        """Return the runs of a set of parameters, in the order of the landings."""
        return [replace(job, set={**job.set, **self._settings(name, values)}) for name, job in self.landings.items()]

    def ours(self, tables: Sequence[Table]) -> list[np.ndarray]:
        """Return what each datum is by the runs' tables, in the order of the landings."""
        by_name = dict(zip(self.landings, tables, strict=True))
        return [datum.of([by_name[name] for name in datum.landings]) for datum in self.data]

    def _settings(self, landing: str, values: Mapping[str, float]) -> dict[str, object]:
        found: dict[str, object] = {}
        for name, (unit, targets) in self.targets.items():
            for target in targets:
                if target.landing in ("", landing):
                    value = float(target.offset + target.factor * values[name])
                    found[target.key] = {"value": value, "unit": unit} if unit else value
        return found


def experiment(study: Study) -> Experiment:
    """Return what the study calculates; `InputError` with all that is wrong with its data."""
    landings: dict[str, Job] = {}
    data: list[Datum] = []
    problems: list[str] = []
    for part in (_of_claims, _of_measurements):
        try:
            for jobs, datum in part(study):
                landings |= jobs
                data.append(datum)
        except InputError as error:
            problems += error.problems
    problems += [f"{study.path}: {line}" for line in _unknown_targets(study, landings)]
    if problems:
        raise InputError(problems)
    targets = {name: (one.unit, study.targets(name)) for name, one in study.parameters.items()}
    return Experiment(landings, data, targets)


def _unknown_targets(study: Study, landings: Mapping[str, Job]) -> Iterator[str]:
    for name, one in study.parameters.items():
        for target in one.applies:
            if target.landing and target.landing not in landings:
                known = ", ".join(landings)
                hint = nearest(target.landing, landings)
                yield f"parameters.{name}.applies: no landing {target.landing!r} is run{hint}; there are {known}"


# -- claims ---------------------------------------------------------------------------------------------------


def _of_claims(study: Study) -> Iterator[tuple[dict[str, Job], Datum]]:
    """Yield the claims that the study names, each with the runs of its landings."""
    if study.claims is None:
        return
    paper = reading.load_study(reading.shipped())
    known = {claim.id: claim for claim in paper.claims.claim}
    problems = list(_claim_problems(study, known))
    if study.claims.parameter_set not in (sets := paper.landings.sets):
        problems.append(
            f"no set {study.claims.parameter_set!r}{nearest(study.claims.parameter_set, sets)}; there are {', '.join(sets)}"
        )
    if problems:
        raise InputError(f"{study.path}: claims: {problem}" for problem in problems)
    wanted = [known[name] for name in (*study.claims.used, *study.claims.predicted)]
    kept = tuple(dict.fromkeys(str(claim.signal) for claim in wanted))
    for claim in wanted:
        jobs = {landing: _job(study, paper, landing, kept) for landing in claim.landings}
        yield jobs, _datum(claim, claim.id in study.claims.used)


def _claim_problems(study: Study, known: Mapping[str, Claim]) -> Iterator[str]:
    assert study.claims is not None
    for name in (*study.claims.used, *study.claims.predicted):
        if name not in known:
            yield f"no claim {name!r}{nearest(name, known)}; studies/paper/claims.toml has them all"
        elif known[name].measure is None:
            yield f"{name} is not measured in a landing, nothing can be fitted to it; leave it out"
        elif known[name].sense != "equal":
            yield f"{name} is a bound ({known[name].sense}), no value to fit; leave it out"


def _job(study: Study, paper: Documents, landing: str, kept: tuple[str, ...]) -> Job:
    """Return a landing of the paper with the values of the study, keeping the signals that are measured."""
    assert study.claims is not None
    base = job_of(paper, paper.landings.landings[landing], study.claims.parameter_set, study.set, estimate=False)
    return base if any(name in DERIVED for name in kept) else replace(base, signals=kept)


def _datum(claim: Claim, used: bool) -> Datum:
    value = np.array(claim.values, float)
    uncertainty = np.maximum(claim.tolerance, claim.relative * np.abs(value))
    return Datum(
        claim.id, claim.unit, value, uncertainty, used, tuple(claim.landings), lambda tables: _claimed(claim, tables)
    )


def _claimed(claim: Claim, tables: Sequence[Table]) -> np.ndarray:
    """Return ours of a claim (k,), in its unit."""
    assert claim.measure is not None and claim.signal is not None
    found = [x for table in tables for x in measured(table, claim.measure, claim.signal, claim.unit)]
    return np.array(taken(found, claim.take))


# -- measurements ---------------------------------------------------------------------------------------------


def _of_measurements(study: Study) -> Iterator[tuple[dict[str, Job], Datum]]:
    """Yield the columns of the study's measurements, each with the run of its landing."""
    problems: list[str] = []
    for i, measurement in enumerate(study.measurement, start=1):
        name = f"measurement {i}"
        try:
            job, series = _measured(study, measurement)
        except InputError as error:
            problems += error.problems
            continue
        for one in series:
            yield {name: job}, _of_series(one, name)
    if problems:
        raise InputError(problems)


def _measured(study: Study, measurement: Measurement) -> tuple[Job, list[Series]]:
    base = Job(
        _near(measurement.scenario or study.scenario, study.path.parent),
        {**study.set, **measurement.set},
        interval=INTERVAL,
        tolerance=TOLERANCE,
        estimate=False,
    )
    scenario: Scenario = base.loaded()
    series = read_series(measurement, study.path.parent, scenario)
    stop = end_of(series, scenario.simulation.macro_step)
    signals = tuple(dict.fromkeys(one.signal for one in series))
    return replace(base, set={**base.set, "simulation.stop_time": stop}, signals=signals), series


def _near(scenario: str, folder: Path) -> str:
    """Return a scenario's name, or its path: files are looked for beside the study."""
    beside = folder / scenario
    return str(beside) if scenario.endswith(".toml") and beside.is_file() else scenario


def _of_series(series: Series, landing: str) -> Datum:
    uncertainty = np.full(series.value.size, series.uncertainty)
    return Datum(
        series.name,
        series.unit,
        series.value,
        uncertainty,
        series.used,
        (landing,),
        lambda tables: series.of(tables[0]),
        series.time,
    )
