"""The files of a study, as types: ``landings.toml``, what is run, and ``claims.toml``, what is held against it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.types import Section

Settings = dict[str, Any]
Value = float | list[float]
PLACE = re.compile(r"\{([\w-]+)(?::(\w+))?\}")
"""Where a finding has ours of a claim, and of which set."""
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]


class StudyFile(Section):
    """A study that is one file, and knows which."""

    _path: Path = PrivateAttr(default=Path("study.toml"))

    @property
    def path(self) -> Path:
        """The study's file."""
        return self._path

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self._path.stem


class ParameterSet(Section):
    """Other values that every landing is run with; a column of the tables."""

    title: str
    set: Settings = Field(default_factory=dict)


class Landing(Section):
    """A scenario with other values; run with each of `sets` (none given: with all)."""

    title: str
    scenario: str
    robot: str | None = None
    set: Settings = Field(default_factory=dict)
    sets: list[str] | None = None


class Variant(Section):
    """One run of a series: its `name`, the number it stands for, if it has one, and what of the series it has not."""

    name: str
    value: float | None = None
    parameter_set: str | None = None
    set: Settings = Field(default_factory=dict)
    landing: str | None = None
    interval: Positive | None = None


class Series(Section):
    """One landing with one thing varied: a parameter (`key`, `values`), or named variants."""

    title: str
    landing: str
    parameter_set: str
    key: str | None = None
    values: list[float | int] = Field(default_factory=list)
    variant: list[Variant] = Field(default_factory=list)

    @property
    def variants(self) -> list[Variant]:
        """All runs of the series."""
        made = [Variant(name=f"{value:g}", value=float(value), set={str(self.key): value}) for value in self.values]
        return [*made, *self.variant]


class Assumed(Section):
    """A number that the paper leaves open: its `key`, and between what it may lie, for a `reason`."""

    name: str
    key: str
    low: float
    high: float
    reason: str


class Landings(Section):
    """``landings.toml``. `interval` (s) and `tolerance` (m) are those of `Job`; `signals` are kept."""

    interval: Positive = 0.02
    tolerance: Positive = 1e-5
    signals: list[str] = Field(default_factory=list)
    sets: Annotated[dict[str, ParameterSet], Field(min_length=1)]
    landings: dict[str, Landing]
    series: dict[str, Series] = Field(default_factory=dict)
    assumed: list[Assumed] = Field(default_factory=list)


class CannotHold(Section):
    """Why no model can meet a claim: in words, and the check of `proofs` that says so in numbers."""

    proof: str
    because: str


class Claim(Section):
    """One row: what the paper says, how ours is measured, and within what it is met.

    Attributes
    ----------
    paper : value, or several, in `unit`
    measure, signal, landings : a key of `MEASURES`, of which signal, in which landings
    take : of several landings: ``each``, the ``range`` of all, or ``where`` in the list, from 1, the largest magnitude is
    formula : a key of `FORMULAS`, in the place of a measure
    parts : ids of the rows that make up this one, in the place of a measure
    undecidable : why there is nothing to hold against it, in the place of a measure
    sense : whether ours must be ``equal``, ``at least`` or ``at most`` the paper's
    tolerance, relative : within which it is met, in `unit` and as a part of the paper's value; the larger one counts
    reason : of the tolerance
    """

    id: str
    source: str
    what: str
    unit: str = "1"
    paper: Value
    measure: str | None = None
    signal: str | None = None
    landings: list[str] = Field(default_factory=list)
    take: Literal["each", "range", "where"] = "each"
    formula: str | None = None
    parts: list[str] = Field(default_factory=list)
    undecidable: str | None = None
    sense: Literal["equal", "at least", "at most"] = "equal"
    tolerance: NonNegative = 0.0
    relative: NonNegative = 0.0
    reason: str = ""
    used_for_fit: bool = False
    remark: str = ""
    cannot_hold: CannotHold | None = None

    @property
    def values(self) -> list[float]:
        """The paper's values."""
        return self.paper if isinstance(self.paper, list) else [self.paper]

    @model_validator(mode="after")
    def _one_way(self) -> Claim:
        ways = [self.measure, self.formula, self.parts or None, self.undecidable]
        if sum(way is not None for way in ways) != 1:
            raise ValueError("give one of measure, formula, parts or undecidable: how it is held against ours")
        if self.measure is not None and not (self.signal and self.landings):
            raise ValueError('a measure needs its signal and its landings; add signal = "…" and landings = ["…"]')
        if (self.measure or self.formula) and not self.reason:
            raise ValueError('a tolerance needs its reason; add reason = "…"')
        return self


class Claims(Section):
    """``claims.toml``. `judged_by`: the set that decides whether a claim is met.

    `findings`: what the page begins with; in them ``{F19-z}`` stands for ours of that claim with the judged set,
    ``{F19-z:table1}`` with another.
    """

    title: str
    judged_by: str
    reason: str
    findings: list[str] = Field(default_factory=list)
    claim: Annotated[list[Claim], Field(min_length=1)]


@dataclass(frozen=True)
class Documents:
    """Both files of a study."""

    folder: Path
    landings: Landings
    claims: Claims

    def chosen(self, ids: Iterable[str]) -> list[Claim]:
        """Return the claims `ids` with the parts they are made of; all, if none is named. `InputError` for an unknown one."""
        known = {claim.id: claim for claim in self.claims.claim}
        wanted = list(ids)
        where = f"{self.folder / 'claims.toml'} has them all"
        unknown = [f"--only: no claim {name!r}{nearest(name, known)}; {where}" for name in wanted if name not in known]
        if unknown:
            raise InputError(unknown)
        names = dict.fromkeys([*wanted, *(part for name in wanted for part in known[name].parts)])
        return [claim for claim in self.claims.claim if not wanted or claim.id in names]
