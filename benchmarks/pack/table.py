"""The tables of docs/benchmarks.md, from the file of results alone."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.pack.contest import TITLES, orders
from benchmarks.pack.results import DOCS

PAGE = DOCS / "benchmarks.md"
BLOCK = re.compile(r"(<!-- benchmark: (\w+) -->\n).*?(<!-- end -->)", re.S)


def filled(text: str, found: Mapping[str, Any]) -> str:
    """Return the page with the tables of these results."""
    return BLOCK.sub(lambda m: m[1] + (table(found[m[2]]) if m[2] in found else "") + m[3], text)


def table(part: Mapping[str, Any]) -> str:
    """Return the table of a case: a row for each run, the order on the last of a series."""
    signals = list(part["reference"]["error"])
    names = [f"error, `{short(name)}`" for name in signals]
    heads = ["engine", "algorithm", "macro step", *names, "order", "solves a step", "solves", "CPU", "not converged"]
    lines = [heads, ["---"] * len(heads), *_rows(part, signals), _reference(part, signals, len(heads))]
    return re.sub(r"e([-+])0(\d)", r"e\1\2", "".join(f"| {' | '.join(cells)} |\n" for cells in lines))


def short(signal: str) -> str:
    """Return the end of a signal's name: ``position.z``, ``robot.roll``."""
    return ".".join(signal.split(".")[-2:])


def _rows(part: Mapping[str, Any], signals: list[str]) -> Iterator[list[str]]:
    found = orders(part["rows"])
    for one in part["rows"]:
        about = [TITLES[one["engine"]], f"`{one['master']}`", f"{1e3 * one['macro_step']:g} ms"]
        if "why" in one:
            yield [*about, one["why"].replace("|", "\\|"), *[""] * (len(signals) + 4)]
            continue
        errors = [f"{one['error'][name]:.1e}" for name in signals]
        order = _order(found.get((one["engine"], one["master"]), {}), one, part["rows"])
        costs = [f"{one['solves']:.2f}", f"{one['solves_a_second']:.0f}", f"{1e3 * one['cpu']:.0f} ms"]
        yield [*about, *errors, order, *costs, str(one["unconverged"])]


def _order(found: Mapping[str, float], one: Mapping[str, Any], rows: list[dict[str, Any]]) -> str:
    """Return the orders of a series on its shortest step, nothing on the others."""
    same = [r["macro_step"] for r in rows if (r["engine"], r["master"]) == (one["engine"], one["master"])]
    return ", ".join(f"{value:.1f}" for value in found.values()) if one["macro_step"] == min(same) else ""


def _reference(part: Mapping[str, Any], signals: list[str], columns: int) -> list[str]:
    errors = [f"{part['reference']['error'][name]:.1e}" for name in signals]
    cells = ["*reference*", "", "", *errors]
    return [*cells, *[""] * (columns - len(cells))]
