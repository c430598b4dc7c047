"""Habits of the tests themselves."""

import re
from pathlib import Path

TESTS = Path(__file__).parent


def test_no_test_module_imports_from_another():
    """What several need lives in `conftest.py`, `systems.py`, `scenarios.py` or `fmus`."""
    pattern = re.compile(r"^\s*(?:from|import)\s+(?:tests)?\.+test_\w+", re.MULTILINE)
    assert not [path.name for path in TESTS.glob("**/*.py") if pattern.search(path.read_text(encoding="utf-8"))]
