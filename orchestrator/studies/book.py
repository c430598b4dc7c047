"""What a study has run, and what it measures there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.runs.job import Done, Job
from orchestrator.studies.documents import Claim, Documents, Landing, Series, Variant
from orchestrator.studies.formulas import FORMULAS
from orchestrator.studies.identified import Identification
from orchestrator.studies.measures import MEASURES
from orchestrator.studies.signals import DERIVED, TO_UNIT, signal

Key = tuple[str, str]
"""Of a run: landing and set; of a series: its name and the variant's."""


@dataclass(frozen=True)
class Book:
    """The runs of a study.

    Attributes
    ----------
    runs : by landing and set
    series : by series and variant
    sensitivity : by the number of the assumed value and ``low`` or ``high``
    identified : what identifications have found before
    """

    documents: Documents
    runs: Mapping[Key, Done]
    series: Mapping[Key, Done]
    sensitivity: Mapping[Key, Done]
    identified: Sequence[Identification] = ()

    @cached_property
    def sets(self) -> list[str]:
        """The names of all sets."""
        return list(self.documents.landings.sets)

    @property
    def judged_by(self) -> str:
        """The set that decides over the verdicts."""
        return self.documents.claims.judged_by

    def table(self, landing: str, parameter_set: str) -> Table | None:
        """Return the signals of a run; None where it was not made, or failed."""
        done = self.runs.get((landing, parameter_set))
        return None if done is None or done.failure is not None else done.table

    def failures(self) -> list[str]:
        """Return why runs have no results, a line each."""
        groups = (self.runs, self.series, self.sensitivity)
        return [f"{a}, {b}: {done.failure}" for group in groups for (a, b), done in group.items() if done.failure]

    def measured(self, claim: Claim, parameter_set: str, measure: str | None = None) -> list[float] | None:
        """Return what a claim's measure (or another) gives with a set, in the claim's unit; None without the runs."""
        name = measure or claim.measure
        found: list[float] = []
        for landing in claim.landings:
            table = self.table(landing, parameter_set)
            if table is None or name is None or claim.signal is None:
                return None
            found += measured(table, name, claim.signal, claim.unit)
        return taken(found, claim.take)

    def ours(self, claim: Claim) -> dict[str, list[float]]:
        """Return ours by set, in the claim's unit; of a formula under the name of no set."""
        if claim.formula is not None:
            return {"formula": list(FORMULAS[claim.formula]())}
        values = {name: self.measured(claim, name) for name in self.sets}
        return {name: value for name, value in values.items() if value is not None}

    def error(self, claim: Claim) -> float | None:
        """Return the largest estimated error of the claim's signal in the judged runs, in its unit; None if not known."""
        runs = [self.runs.get((landing, self.judged_by)) for landing in claim.landings]
        if claim.signal is None or claim.signal in DERIVED or claim.unit == "s" or not runs or None in runs:
            return None
        errors = [done.summary.get("estimated_error", {}).get(claim.signal) for done in runs if done is not None]
        return None if None in errors else max(errors) * TO_UNIT.get(claim.unit, 1.0)


def taken(found: list[float], take: str) -> list[float]:
    """Return what a claim takes of the values of its landings: see `Claim.take`."""
    match take:
        case "range":
            return [min(found), max(found)]
        case "where":
            return [1.0 + int(np.argmax(np.abs(found)))]
        case _:
            return found


def measured(table: Table, measure: str, name: str, unit: str = "1") -> list[float]:
    """Return what a measure gives of a signal, as one value or as several, in `unit`."""
    value = MEASURES[measure](table["time"], signal(table, name))
    return (np.atleast_1d(value) * TO_UNIT.get(unit, 1.0)).tolist()


# -- jobs -----------------------------------------------------------------------------------------------------


def jobs_of(documents: Documents, claims: Iterable[Claim]) -> dict[Key, Job]:
    """Return the runs that `claims` need, by landing and set."""
    names = dict.fromkeys(name for claim in claims for name in claim.landings)
    return {
        (name, parameter_set): job_of(documents, documents.landings.landings[name], parameter_set)
        for name in names
        for parameter_set in documents.landings.landings[name].sets or documents.landings.sets
    }


def jobs_of_series(documents: Documents) -> dict[Key, Job]:
    """Return the runs of all series, by series and variant."""
    named = documents.landings.series
    return {(name, v.name): _variant(documents, series, v) for name, series in named.items() for v in series.variants}


def jobs_of_sensitivity(documents: Documents, landing: str) -> dict[Key, Job]:
    """Return two runs of `landing` with the judged set for each number assumed: at its lower and its upper bound."""
    base, judge = documents.landings.landings[landing], documents.claims.judged_by
    return {
        (assumed.name, end): job_of(documents, base, judge, {assumed.key: value}, estimate=False)
        for assumed in documents.landings.assumed
        for end, value in (("low", assumed.low), ("high", assumed.high))
    }


def _variant(documents: Documents, series: Series, variant: Variant) -> Job:
    landing = documents.landings.landings[variant.landing or series.landing]
    parameter_set = variant.parameter_set or series.parameter_set
    return job_of(documents, landing, parameter_set, variant.set, variant.interval, estimate=False)


def job_of(
    documents: Documents,
    landing: Landing,
    parameter_set: str,
    changes: Mapping[str, object] | None = None,
    interval: float | None = None,
    estimate: bool = True,
) -> Job:
    found = documents.landings
    values = landing.set | found.sets[parameter_set].set | dict(changes or {})
    return Job(
        landing.scenario,
        values,
        landing.robot,
        interval=interval or found.interval,
        tolerance=found.tolerance,
        estimate=estimate,
        signals=tuple(found.signals),
    )
