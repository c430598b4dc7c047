"""What a study gives back, and how it looks on the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from inspect import cleandoc
from types import ModuleType

import numpy as np


@dataclass(frozen=True)
class Row:
    """One computed number beside the one expected.

    Attributes
    ----------
    quantity : what it is, with its unit
    computed, expected : both numbers; for a bound, 0 is expected
    source : where the expected value comes from
    tolerance : largest error that passes; from an error estimate, not from the result
    relative : the error is |computed - expected| / |expected|, else |computed - expected|
    """

    quantity: str
    computed: float
    expected: float
    source: str
    tolerance: float
    relative: bool = True

    @property
    def error(self) -> float:
        difference = abs(self.computed - self.expected)
        return difference / abs(self.expected) if self.relative else difference

    @property
    def passed(self) -> bool:
        return bool(self.error <= self.tolerance)


@dataclass(frozen=True)
class Result:
    """The rows of a study, the file names of its figures with their captions, and a remark on what they show."""

    rows: Sequence[Row]
    figures: Sequence[tuple[str, str]] = ()
    remark: str = ""

    @property
    def passed(self) -> bool:
        return all(row.passed for row in self.rows)


LONG = 30
"""Rows above which a table is folded on the page."""


def page_section(study: ModuleType, result: Result) -> str:
    """Return a study's part of the page, in Markdown."""
    parts = [f"### {study.TITLE}", cleandoc(study.__doc__ or "")]
    parts += [f"![{caption}](figures/{name})\n\n*{caption}*" for name, caption in result.figures]
    parts.append(_folded(result.rows) if len(result.rows) > LONG else _table(result.rows))
    if result.remark:
        parts.append(cleandoc(result.remark))
    return "\n\n".join(parts) + "\n"


def _folded(rows: Sequence[Row]) -> str:
    """Return a table behind a line that says how many rows pass and how near the worst one is to its tolerance."""
    worst = max(rows, key=lambda row: row.error / row.tolerance)
    passed = sum(row.passed for row in rows)
    line = f"{passed} of {len(rows)} quantities within their tolerance"
    nearest = f"nearest to it: {worst.quantity}, error {worst.error:.1e} of {worst.tolerance:.0e} allowed"
    return f"<details><summary>{line}; {nearest}</summary>\n\n{_table(rows)}\n\n</details>"


def _table(rows: Sequence[Row]) -> str:
    lines = ["| quantity | computed | expected | error | tolerance | | source |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        kind = "" if row.relative else " abs."
        lines.append(
            f"| {row.quantity} | {_number(row.computed)} | {_number(row.expected)} | {row.error:.1e}{kind} "
            f"| {row.tolerance:.1e} | {'ok' if row.passed else '**missed**'} | {row.source} |"
        )
    return "\n".join(lines)


def _number(x: float) -> str:
    return (
        "0"
        if x == 0
        else f"{x:.3e}"
        if not 1e-3 <= abs(x) < 1e7
        else np.format_float_positional(x, precision=8, fractional=False, trim="-")
    )


def observed_order(steps: Sequence[float], errors: Sequence[float]) -> float:
    """Return the slope of log(error) over log(step), by least squares."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
