"""The files of a study, read and checked: all that is wrong with them is said at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from orchestrator.catalogue.documents import read
from orchestrator.catalogue.quantities import complaints
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.studies.documents import PLACE, Claims, Documents, Landings
from orchestrator.studies.formulas import FORMULAS
from orchestrator.studies.measures import MEASURES
from orchestrator.studies.proofs import PROOFS

PACKAGE = Path(__file__).parent
Read = TypeVar("Read", bound=BaseModel)


def shipped(name: str = "paper") -> Path:
    """Return the folder of a shipped study: in the package, or beside it in a clone."""
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parents[1] / "studies" / name


def load_study(folder: Path) -> Documents:
    """Read the two files in `folder`; `InputError` with all that is wrong with them."""
    landings = _read(folder / "landings.toml", Landings)
    claims = _read(folder / "claims.toml", Claims)
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
        sets = [series.parameter_set, *(v.parameter_set for v in series.variant if v.parameter_set is not None)]
        yield from _unknown(f"series.{name}.parameter_set", sets, found.sets, "set")
        if bool(series.values) != (series.key is not None):
            yield f"series.{name}: key and values belong together; give both, or variants alone"


def _of_claims(found: Claims, landings: Landings) -> Iterator[str]:
    yield from _unknown("judged_by", [found.judged_by], landings.sets, "set")
    ids = [claim.id for claim in found.claim]
    places = [place for finding in found.findings for place in PLACE.findall(finding)]
    yield from _unknown("findings", (name for name, _ in places), ids, "claim")
    yield from _unknown("findings", (name for _, name in places if name), landings.sets, "set")
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
