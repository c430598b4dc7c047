"""The verdict on each claim, with its reason."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.studies.book import Book
from orchestrator.studies.documents import Claim
from orchestrator.studies.identified import is_used
from orchestrator.studies.proofs import PROOFS

MET, NOT_MET, CANNOT_HOLD = "met", "not met", "cannot hold"


@dataclass(frozen=True)
class Row:
    """A claim beside ours.

    Attributes
    ----------
    ours : values by set, in the claim's unit
    difference : the largest, ours less the paper's, by set
    met_by : the sets that meet it
    error : estimated error of ours, in the claim's unit; None if not known
    identified : values by identification: of the parameters that it has found
    fitted : whether one of them was fitted to it
    """

    claim: Claim
    ours: Mapping[str, Sequence[float]]
    verdict: str
    why: str
    difference: Mapping[str, float] = field(default_factory=dict)
    met_by: Sequence[str] = ()
    error: float | None = None
    identified: Mapping[str, Sequence[float]] = field(default_factory=dict)
    fitted: bool = False

    @property
    def used_for_fit(self) -> bool:
        """Whether a number of ours, or an identification, was made from it, so that meeting it proves nothing."""
        return self.claim.used_for_fit or self.fitted

    def content(self) -> dict[str, Any]:
        """Return what ``reproduction.json`` says of it."""
        claim = self.claim
        return {
            "id": claim.id,
            "paper": claim.paper,
            "ours": {name: bare(values) for name, values in (*self.ours.items(), *self.identified.items())},
            "verdict": self.verdict,
            "used_for_fit": self.used_for_fit,
            "why": self.why,
            "unit": claim.unit,
            "what": claim.what,
            "source": claim.source,
            "difference": dict(self.difference),
            "met_by": list(self.met_by),
            "estimated_error": self.error,
        }


def rows_of(book: Book, claims: Iterable[Claim]) -> list[Row]:
    """Return a row for every claim; those made of others come from these."""
    rows: dict[str, Row] = {}
    listed = list(claims)
    for claim in [c for c in listed if not c.parts] + [c for c in listed if c.parts]:
        row = _of_parts(claim, rows) if claim.parts else _row(book, claim)
        values = {f"identified: {one.name}": x for one in book.identified if (x := one.ours(claim.id)) is not None}
        rows[claim.id] = replace(row, identified=values, fitted=is_used(book.identified, claim.id))
    return [rows[claim.id] for claim in listed]


def is_met(claim: Claim, ours: Sequence[float]) -> bool:
    """Return whether `ours`, in the claim's unit, is within its tolerance."""
    if len(ours) != len(claim.values):
        return False
    return all(_within(claim, one, paper) for one, paper in zip(ours, claim.values, strict=True))


def _within(claim: Claim, ours: float, paper: float) -> bool:
    allowed = max(claim.tolerance, claim.relative * abs(paper))
    too_high, too_low = ours > paper + allowed, ours < paper - allowed
    match claim.sense:
        case "at least":
            return not too_low
        case "at most":
            return not too_high
        case _:
            return not (too_low or too_high or ours != ours)


def _row(book: Book, claim: Claim) -> Row:
    if claim.undecidable is not None:
        return Row(claim, {}, NOT_MET, f"not decidable: {claim.undecidable}{_remark(claim)}")
    ours = book.ours(claim)
    met_by = [name for name, values in ours.items() if is_met(claim, values)]
    difference = {name: _difference(claim, values) for name, values in ours.items()}
    judged = "formula" if claim.formula is not None else book.judged_by
    verdict, why = (MET if judged in met_by else NOT_MET), _judged(claim, ours.get(judged), difference.get(judged))
    if claim.cannot_hold is not None:
        proof = PROOFS[claim.cannot_hold.proof](book, claim)
        why = f"{claim.cannot_hold.because}: {proof.words}" if proof.holds else f"{why}; the proof fails: {proof.words}"
        verdict = CANNOT_HOLD if proof.holds else verdict
    return Row(claim, ours, verdict, why + _remark(claim), difference, met_by, book.error(claim))


def _of_parts(claim: Claim, rows: Mapping[str, Row]) -> Row:
    """Return the row of a claim that is made of others: it holds if all can, and is met if all are."""
    parts = [rows[name] for name in claim.parts]
    verdicts = [part.verdict for part in parts]
    verdict = next((v for v in (CANNOT_HOLD, NOT_MET) if v in verdicts), MET)
    ours = {"parts met": [float(verdicts.count(MET))]}
    words = ", ".join(f"{part.claim.id} {part.verdict}" for part in parts)
    return Row(claim, ours, verdict, f"{words}{_remark(claim)}")


def _difference(claim: Claim, ours: Sequence[float]) -> float:
    """Return ours less the paper's where it is largest."""
    if len(ours) != len(claim.values):
        return float("nan")
    return max((one - paper for one, paper in zip(ours, claim.values, strict=True)), key=abs)


def _judged(claim: Claim, ours: Sequence[float] | None, difference: float | None) -> str:
    if ours is None or difference is None:
        return "ours has no result: its run failed or was not made"
    allowed = max(claim.tolerance, claim.relative * max(map(abs, claim.values)))
    sense = {"equal": f"allowed {allowed:.2g}", "at least": "at least that", "at most": "at most that"}[claim.sense]
    return f"differs by {difference:+.3g} {claim.unit if claim.unit != '1' else ''} ({sense}: {claim.reason})".replace(
        "  ", " "
    )


def _remark(claim: Claim) -> str:
    return f". {claim.remark}" if claim.remark else ""


def bare(values: Sequence[float]) -> float | list[float]:
    """Return one value as it is, several as a list."""
    return values[0] if len(values) == 1 else list(values)
