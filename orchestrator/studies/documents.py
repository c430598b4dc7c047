"""The files of a study: ``landings.toml``, what is run, and ``claims.toml``, what is held against it; read and checked once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError, model_validator

from orchestrator.catalogue.documents import read
from orchestrator.catalogue.quantities import complaints
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.types import Section
from orchestrator.studies.formulas import FORMULAS
from orchestrator.studies.measures import MEASURES
from orchestrator.studies.proofs import PROOFS

PACKAGE = Path(__file__).parent
Read = TypeVar("Read", bound=BaseModel)
Settings = dict[str, Any]
Value = float | list[float]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]


class ParameterSet(Section):
    """Other values that every landing is run with; a column of the tables."""

    title: str
    set: Settings = {}


class Landing(Section):
    """A scenario with other values; run with each of `sets` (none given: with all)."""

    title: str
    scenario: str
    robot: str | None = None
    set: Settings = {}
    sets: list[str] | None = None


class Variant(Section):
    """One run of a series: its `name`, and the number it stands for, if it has one."""

    name: str
    value: float | None = None
    set: Settings = {}
    landing: str | None = None
    interval: Positive | None = None


class Series(Section):
    """One landing with one thing varied: a parameter (`key`, `values`), or named variants."""

    title: str
    landing: str
    parameter_set: str
    key: str | None = None
    values: list[float | int] = []
    variant: list[Variant] = []

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
    signals: list[str] = []
    sets: Annotated[dict[str, ParameterSet], Field(min_length=1)]
    landings: dict[str, Landing]
    series: dict[str, Series] = {}
    assumed: list[Assumed] = []


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
    take : of several landings: ``each``, or the ``range`` of all
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
    landings: list[str] = []
    take: Literal["each", "range"] = "each"
    formula: str | None = None
    parts: list[str] = []
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
    """``claims.toml``. `judged_by`: the set that decides whether a claim is met."""

    title: str
    judged_by: str
    reason: str
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
        unknown = [f"--only: no claim {name!r}{nearest(name, known)}; {self.folder}/claims.toml has them all" for name in wanted if name not in known]
        if unknown:
            raise InputError(unknown)
        names = dict.fromkeys([*wanted, *(part for name in wanted for part in known[name].parts)])
        return [claim for claim in self.claims.claim if not wanted or claim.id in names]


def shipped(name: str = "paper") -> Path:
    """Return the folder of a shipped study: in the package, or beside it in a clone."""
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parents[1] / "studies" / name


def load_study(folder: Path) -> Documents:
    """Read the two files in `folder`; `InputError` with all that is wrong with them."""
    landings, claims = (_read(folder / f"{model.__name__.lower()}.toml", model) for model in (Landings, Claims))
    found = Documents(folder, landings, claims)
    problems = [f"{folder / 'landings.toml'}: {line}" for line in _of_landings(landings)]
    problems += [f"{folder / 'claims.toml'}: {line}" for line in _of_claims(claims, landings)]
    if problems:
        raise InputError(problems)
    return found


def _read(path: Path, model: type[Read]) -> Read:
    try:
        return model.model_validate(read(path))
    except ValidationError as error:
        raise InputError(f"{path}: {problem}" for problem in complaints(error, model)) from None


def _of_landings(found: Landings) -> Iterator[str]:
    for name, landing in found.landings.items():
        yield from _unknown(f"landings.{name}.sets", landing.sets or [], found.sets, "set")
    for name, series in found.series.items():
        wanted = [series.landing, *(v.landing for v in series.variant if v.landing is not None)]
        yield from _unknown(f"series.{name}.landing", wanted, found.landings, "landing")
        yield from _unknown(f"series.{name}.parameter_set", [series.parameter_set], found.sets, "set")
        if bool(series.values) != (series.key is not None):
            yield f"series.{name}: key and values belong together; give both, or variants alone"


def _of_claims(found: Claims, landings: Landings) -> Iterator[str]:
    yield from _unknown("judged_by", [found.judged_by], landings.sets, "set")
    ids = [claim.id for claim in found.claim]
    for i, claim in enumerate(found.claim, start=1):
        place = f"claim[{i}] ({claim.id})"
        if ids.count(claim.id) > 1 and ids.index(claim.id) < i - 1:
            yield f"{place}: there is a claim of that id above; give it another id"
        yield from _unknown(f"{place}.landings", claim.landings, landings.landings, "landing")
        yield from _unknown(f"{place}.measure", filter(None, [claim.measure]), MEASURES, "measure")
        yield from _unknown(f"{place}.formula", filter(None, [claim.formula]), FORMULAS, "formula")
        yield from _unknown(f"{place}.parts", claim.parts, ids, "claim")
        if claim.cannot_hold is not None:
            yield from _unknown(f"{place}.cannot_hold.proof", [claim.cannot_hold.proof], PROOFS, "proof")


def _unknown(place: str, names: Iterable[str], known: Iterable[str] | Mapping[str, object], kind: str) -> Iterator[str]:
    have = list(known)
    for name in names:
        if name not in have:
            yield f"{place}: no {kind} {name!r}{nearest(name, have)}; there are {', '.join(have)}"
