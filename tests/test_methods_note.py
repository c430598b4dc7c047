"""The methods note: its tables are those of their file, its pictures are there, the printed whole has every page."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_tables_are_those_of_the_file():
    made = runpy.run_path(str(DOCS / "methods.py"))
    found = json.loads(made["FILE"].read_text(encoding="utf-8"))
    filled = set()
    for page in made["PAGES"]:
        text = page.read_text(encoding="utf-8")
        filled |= {match[1] for match in made["BLOCK"].findall(text)}
        assert made["filled"](text, found) == text, f"{page}: python docs/methods.py --fill"
    assert filled == set(made["BLOCKS"])


def test_the_whole_has_every_page_of_the_note():
    whole = (DOCS / "methods" / "whole.md").read_text(encoding="utf-8")
    pages = {page.name for page in (DOCS / "methods").glob("*.md")} - {"whole.md"}
    assert [page for page in sorted(pages) if f"{{include}} {page}" not in whole] == []


def test_formulas_are_numbered_once():
    numbers = [
        int(line.rsplit("(", 1)[1].rstrip(")"))
        for page in sorted((DOCS / "methods").glob("*.md"))
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("    ") and line.rstrip().endswith(")") and line.rsplit("(", 1)[1].rstrip(")").isdigit()
    ]
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
