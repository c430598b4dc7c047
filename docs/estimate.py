"""Calibrate the error estimate; write docs/estimate.json, the figure, the notebook's tables and the section of Verification.

python docs/estimate.py            measures the whole grid (half an hour; goes on where it was stopped)
python docs/estimate.py WORD …     measures anew what has one of these words in its name (``rolling``, ``5 cm``)
python docs/estimate.py --fill     fills the pages from the file alone
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE, PAGE = ROOT / "docs" / "estimate.json", ROOT / "docs" / "notebook" / "estimate.md"
BLOCK = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.S)
STUDY = "coupling.estimate"
sys.path.insert(0, str(ROOT))


def measured(words: list[str]) -> None:
    """Measure what is missing in the file, and what has one of `words` in it."""
    from verification.coupling.estimate_rows import measure

    measure(
        lambda spec: any(word in f"{spec.group}: {spec.words}" for word in words), lambda line: print(line, flush=True)
    )


def filled(text: str, rows: list[dict[str, Any]]) -> str:
    """Return the notebook's page with the tables of these rows."""
    from verification.coupling import estimate

    cases = estimate.judged(rows).cases
    parts = {
        "shares": estimate.brief(cases),
        "groups": estimate.by_group(cases),
        "quantities": estimate.by_quantity(cases),
    }
    return BLOCK.sub(lambda m: f"{m[1]}{parts[m[2]]}\n{m[3]}", text)


def fill() -> None:
    """Write pages and figure from the file."""
    from verification.__main__ import PAGE as VERIFICATION
    from verification.__main__ import read_page, write_page
    from verification.coupling import estimate
    from verification.study import page_section

    rows = json.loads(FILE.read_text(encoding="utf-8"))
    section = page_section(estimate, estimate.result(rows, VERIFICATION.parent / "figures"))
    write_page(VERIFICATION, read_page(VERIFICATION) | {STUDY: section})
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), rows), encoding="utf-8")


def main() -> None:
    """Measure, unless only filling is asked for, and fill the pages."""
    if "--fill" not in sys.argv:
        measured(sys.argv[1:])
    fill()


if __name__ == "__main__":
    main()
