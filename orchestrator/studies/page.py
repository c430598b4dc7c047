"""``reproduction.md``: the page for a referee, in Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from orchestrator.studies import identified, referee
from orchestrator.studies.book import Book
from orchestrator.studies.documents import PLACE
from orchestrator.studies.markdown import filled, number, table
from orchestrator.studies.pictures import Picture
from orchestrator.studies.verdicts import CANNOT_HOLD, MET, NOT_MET, Row


def text(book: Book, rows: Sequence[Row], pictures: Sequence[Picture], whole: bool) -> str:
    """Return the page: verdicts, reasons, figures, and what a referee asks for."""
    parts = [
        _head(book),
        _findings(book, rows) if whole else "",
        _sets(book),
        _count(rows),
        _verdicts(book, rows),
        _reasons(rows),
        _by_set(book, rows),
        SIGNS,
        _accuracy(book, rows),
    ]
    if whole:
        parts += [_pictures(pictures), *referee.sections(book), identified.section(book.identified)]
    parts += [_failures(book), FURTHER]
    return "\n\n".join(part for part in parts if part) + "\n"


def _head(book: Book) -> str:
    claims = book.documents.claims
    return "\n\n".join([
        "# The paper, claim by claim",
        "<!-- made by `orchestrator reproduce`; edit studies/paper/*.toml, not this page -->",
        filled(
            f"{claims.title}. Each row holds one claim against our runs of the monolithic solver. The set "
            f"`{claims.judged_by}` decides: {claims.reason}. *Cannot hold* has a proof that is checked in numbers: a bound, a "
            "symmetry, or another claim of the paper."
        ),
    ])  # fmt: skip


def _findings(book: Book, rows: Sequence[Row]) -> str:
    """Return what the study says of itself, with the values that were found."""
    ours = {row.claim.id: row.ours for row in rows}

    def value(place: re.Match[str]) -> str:
        return number(ours[place[1]].get(place[2] or book.judged_by), DIGITS - 1)

    lines = (filled(f"- {PLACE.sub(value, finding)}", "  ") for finding in book.documents.claims.findings)
    found = "\n".join(lines)
    return f"## In short\n{found}" if found else ""


def _sets(book: Book) -> str:
    rows = ((f"`{name}`", found.title) for name, found in book.documents.landings.sets.items())
    return "## Sets\n" + table(("set", "what"), rows)


def _count(rows: Sequence[Row]) -> str:
    plain = [row for row in rows if not row.claim.parts]
    predicted = [row for row in plain if row.verdict == MET and not row.used_for_fit]
    fitted = [row for row in plain if row.verdict == MET and row.used_for_fit]
    numbers = {name: sum(row.verdict == name for row in plain) for name in (MET, NOT_MET, CANNOT_HOLD)}
    words = f"Of {len(plain)} claims, parts counted and not their sums, {numbers[MET]} are met, {numbers[NOT_MET]} are not, "
    words += f"{numbers[CANNOT_HOLD]} cannot hold. Of those met, {len(predicted)} are predicted"
    words += (
        f", and {len(fitted)} gave a number of ours or were used for a fit, so that meeting them proves nothing."
        if fitted
        else "."
    )
    return "## Verdicts\n" + filled(words)


def _verdicts(book: Book, rows: Sequence[Row]) -> str:
    head = ("id", "where", "what", "unit", "paper", f"ours, `{book.judged_by}`", "verdict")
    return table(head, (_verdict(book, row) for row in rows))


def _verdict(book: Book, row: Row) -> Iterable[str]:
    claim = row.claim
    ours = number(_in_column(book, row, book.judged_by), DIGITS)
    fit = " (used for a fit)" if row.used_for_fit else ""
    return claim.id, claim.source, claim.what, claim.unit, number(claim.values), ours, f"**{row.verdict}**{fit}"


def _by_set(book: Book, rows: Sequence[Row]) -> str:
    measured = [row for row in rows if row.claim.measure is not None]
    lines = (
        (row.claim.id, row.claim.unit, number(row.claim.values), *(number(row.ours.get(n), DIGITS) for n in book.sets))
        for row in measured
    )
    note = "A time to settle that is that of the whole run, 20, 25 or 40 s, says that it has not settled."
    return f"### Ours by set\n{note}\n\n" + table(("id", "unit", "paper", *(f"`{name}`" for name in book.sets)), lines)


def _in_column(book: Book, row: Row, parameter_set: str) -> Sequence[float] | None:
    """Return ours of a set; what belongs to no set, a formula's, stands under the judged one."""
    if parameter_set in row.ours or parameter_set != book.judged_by:
        return row.ours.get(parameter_set)
    return next(iter(row.ours.values()), None)


def _reasons(rows: Sequence[Row]) -> str:
    lines = (f"- **{row.claim.id}**, {row.verdict}: {row.why}{_by(row)}." for row in rows)
    return "### Why\n" + "\n".join(filled(line, "  ") for line in lines)


def _by(row: Row) -> str:
    if row.verdict == CANNOT_HOLD or not row.met_by or row.claim.formula:
        return ""
    return f"; met by {', '.join(f'`{name}`' for name in row.met_by)}"


DIGITS = 4
"""Of ours in the table."""
SIGNS = """## Signs
Roll is positive where the robot's +y side rises, as in the paper's frames. Seen from the other tower the same landing has
the opposite sign of roll and of yaw, and the paper does not say on which side of midspan its points lie: magnitudes are
compared. Ours lie nearer to the left tower, at y < 100 m, where the largest roll of the judged set at point 9 is negative,
as that of Fig. 15 is; Fig. 19 prints magnitudes. Z is that of b, the centre of the rotor plane: *absolute* from the level
of the supports, *relative* from where the robot stands before it is let go."""

FURTHER = """## Add or dispute a row
The rows are `studies/paper/claims.toml`, the landings `studies/paper/landings.toml`. Change a tolerance, a measure or a
landing, or add a claim, and run `orchestrator reproduce --study FOLDER`; see [how to](howto/reproduce.md)."""


def _accuracy(book: Book, rows: Sequence[Row]) -> str:
    known = [(row, row.error) for row in rows if row.error]
    if not known:
        return ""
    shares = [(error / _allowed(row), row) for row, error in known if _allowed(row) > 0.0]
    worst, row = max(shares, key=lambda pair: pair[0], default=(0.0, None))
    if row is None:
        return ""
    found = book.documents.landings
    return "## How exact ours is\n" + filled(
        f"Rows every {found.interval:g} s, a local tolerance of {found.tolerance:g} m. Each run is made twice, the second time "
        f"with steps twice as long; the difference bounds the error of the first. At its largest, in `{row.claim.id}`, it is "
        f"{100.0 * worst:.2g} % of what the claim is allowed to differ by. The mesh's part is in the study below."
    )


def _allowed(row: Row) -> float:
    claim = row.claim
    return max(claim.tolerance, claim.relative * max(map(abs, claim.values)))


def _pictures(pictures: Sequence[Picture]) -> str:
    shown = (f"### {p.title}\n![{p.title}]({p.path})\n\n{filled(p.caption)}" for p in pictures if p.of_paper)
    return "## The paper's figures, drawn from our runs\n\n" + "\n\n".join(shown)


def _failures(book: Book) -> str:
    lines = book.failures()
    return "## Runs that failed\n" + "\n".join(f"- {line}" for line in lines) if lines else ""
