"""The page of the studies: errors, verdicts, and parts that are written anew without touching the others."""

from types import ModuleType

import pytest

from verification import __main__ as page
from verification.study import Result, Row, observed_order, page_section


def test_errors_and_verdicts():
    assert Row("", 1.01, 1.0, "", 0.02).passed
    assert not Row("", 1.03, 1.0, "", 0.02).passed
    assert Row("", 1e-7, 0.0, "", 1e-6, relative=False).passed
    assert not Row("", float("nan"), 1.0, "", 0.02).passed


def test_observed_order():
    assert observed_order([0.1, 0.05, 0.025], [3e-2, 3e-2 / 8, 3e-2 / 64]) == pytest.approx(3.0)


def test_parts_are_kept(tmp_path, monkeypatch):
    names = ["cable.statics", "cable.vibration"]
    monkeypatch.setattr(page, "studies", lambda: dict.fromkeys(names))
    study = ModuleType("statics", "What it does.\n\nMore.")
    study.TITLE = "Statics"
    text = page_section(study, Result([Row("sag, m", 1.0, 2.0, "theory", 1e-3)]))
    assert "**missed**" in text
    file = tmp_path / "page.md"
    page.write_page(file, {"cable.vibration": "### Vibration\n"})
    page.write_page(file, page.read_page(file) | {"cable.statics": text})
    parts = page.read_page(file)
    assert list(parts) == names and parts["cable.statics"] == text and "### Vibration" in parts["cable.vibration"]


def test_every_study_is_documented():
    for name, study in page.studies().items():
        assert study.TITLE and study.__doc__ and callable(study.run), name
