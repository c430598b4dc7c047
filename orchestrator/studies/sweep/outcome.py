"""What became of the runs of a sweep: a row of the table a run, and how probable it is that limits hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Literal

from orchestrator.landing.safety import UNITS, is_exceeded
from orchestrator.runs.job import Done
from orchestrator.studies.sweep import probability
from orchestrator.studies.sweep.design import Row, bare, groups
from orchestrator.studies.sweep.study import EXTREMES, Study

ALL = "all"
"""Limits together."""
Standing = Literal["unsafe", "unclear", "none", "safe"]
"""``unclear``: a margin is smaller than its estimated error. ``none``: the run failed, or nothing was judged."""
WORST_FIRST: Sequence[Standing] = ("unsafe", "unclear", "none", "safe")


@dataclass(frozen=True)
class Outcome:
    """A run, and what is kept of it."""

    row: Row
    done: Done

    @cached_property
    def limits(self) -> Mapping[str, Mapping[str, Any]]:
        """The limits that were judged, as in ``summary.json``."""
        return {} if self.done.failure is not None else self.done.summary.get("limits", {})

    @property
    def safe(self) -> bool | None:
        """Whether it is safe; None where that is not known: the run failed, or nothing was judged."""
        return None if self.done.failure is not None else self.done.summary.get("safe")

    @property
    def verdict(self) -> Standing:
        """Whether it is safe, and why that is not known."""
        if self.safe is None:
            return "none"
        return "safe" if self.safe else "unsafe" if is_exceeded(self.done.summary) else "unclear"

    @cached_property
    def is_recorded(self) -> bool:
        """Whether its signals are there."""
        return self.done.directory is not None and (self.done.directory / "results.csv").is_file()

    def keeps(self, limit: str) -> bool | None:
        """Return whether a limit is kept, or ``all``; None where that is not known."""
        if limit == ALL:
            return self.safe
        judged = self.limits.get(limit)
        return None if judged is None else judged["verdict"] == "kept"

    @property
    def margins(self) -> dict[str, float]:
        """Margin of each limit as a share of the limit: 1 where nothing was used up, below 0 where it is exceeded."""
        shares = {name: judged["share"] for name, judged in self.limits.items()}
        return {name: -float("inf") if share is None else 1.0 - share for name, share in shares.items()}

    @property
    def binding(self) -> str:
        """The limit with the least margin."""
        return min(self.margins, key=lambda name: self.margins[name], default="")


def cells(study: Study, outcome: Outcome) -> dict[str, Any]:
    """Return a row of the table; None where something is not known."""
    summary = outcome.done.summary
    found: dict[str, Any] = {"run": outcome.row.number, **outcome.row.inputs}
    if study.sample is not None:
        found["scramble"] = outcome.row.block
    if study.sensitivity is not None:
        found["part"] = outcome.row.part
    found |= {
        "safe": outcome.safe,
        "least_margin": None,
        "binding": outcome.binding,
        "verdict": summary.get("safety", ""),
    }
    found |= measured(study, outcome)
    return found | {"failure": outcome.done.failure or "", "folder": outcome.done.job.key}


def measured(study: Study, outcome: Outcome) -> dict[str, Any]:
    """Return the columns of how a landing went, in numbers; None where one is not known."""
    margins = outcome.margins
    found: dict[str, Any] = {"least_margin": margins.get(outcome.binding)}
    for name in UNITS:
        judged = outcome.limits.get(name, {})
        found |= {f"margin.{name}": margins.get(name), f"worst.{name}": judged.get("worst")}
        found[f"error.{name}"] = judged.get("estimated_error")
    return found | dict(_extremes(study, outcome.done.summary))


def _extremes(study: Study, summary: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield least and largest value of the signals that are asked for, and their estimated error."""
    errors = summary.get("estimated_error", {})
    for name in EXTREMES if study.extremes is None else study.extremes:
        extremes, error = summary.get("extremes", {}).get(name, {}), errors.get(name)
        yield f"{name}.min", extremes.get("min")
        yield f"{name}.max", extremes.get("max")
        yield f"{name}.error", error.get("total") if isinstance(error, Mapping) else error


# -- probability ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Chances:
    """How probable it is that limits hold, for one combination of what varies; ``all`` of them, and each."""

    where: Mapping[str, Any]
    of: Mapping[str, probability.Probability]

    def content(self) -> dict[str, Any]:
        """Return what ``study.json`` says."""
        return {"where": self.where, **{name: asdict(one) for name, one in self.of.items()}}


def chances(study: Study, outcomes: Sequence[Outcome], looks: int = 1) -> list[Chances]:
    """Return how probable it is that limits hold, for each combination of what varies; none without a sample."""
    if study.sample is None or not outcomes:
        return []
    sampled = [outcome for outcome in outcomes if not outcome.row.part]
    there = {outcome.row.group for outcome in sampled}
    return [_chances(study, i, where, sampled, looks) for i, where in enumerate(groups(study)) if i in there]


def _chances(study: Study, group: int, where: Mapping[str, Any], every: Sequence[Outcome], looks: int) -> Chances:
    assert study.sample is not None
    mine, independent = [o for o in every if o.row.group == group], study.sample.method == "random"
    judged = [name for name in UNITS if any(name in o.limits for o in mine)]
    blocks = [o.row.block for o in mine]
    of = {
        name: probability.probability([o.keeps(name) for o in mine], blocks, independent, looks)
        for name in (ALL, *judged)
    }
    return Chances({key: bare(value) for key, value in where.items()}, of)
