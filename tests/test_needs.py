"""What our FMUs need of the interpreter that loads them: said inside each, and true."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from fmus.face.fmu_start import NEEDS, PYTHON, needs
from fmus.module import registry
from orchestrator.catalogue.library import kept, module_recipe
from tests.scenarios import ROOT

WITHOUT_SCIPY = """
import sys
sys.modules["scipy"] = None  # an import of it fails
from fmus.module import registry
for key in registry.OURS:
    module = registry.find(key).recipe().make_module()
    module.initialize(0.0)
    module.step(0.0, 1e-3)
    module.refresh()
"""


def test_versions_are_those_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {name + version for name, version in NEEDS.items()} <= set(project["dependencies"])
    assert project["requires-python"] == PYTHON


@pytest.fixture(scope="module")
def archives() -> dict[str, Path]:
    return dict(zip(registry.OURS, kept(map(module_recipe, registry.OURS)), strict=True))


@pytest.mark.parametrize("key", registry.OURS)
def test_each_says_what_its_sources_import(archives, key):
    with zipfile.ZipFile(archives[key]) as archive:
        page = archive.read("documentation/index.html").decode()
        listed = archive.read("resources/requirements.txt").decode().split()
    assert sorted(listed) == sorted(name + version for name, version in NEEDS.items())
    assert ", ".join(listed).replace("<", "&lt;").replace(">", "&gt;") in page and "Python &gt;=3.11" in page


def test_nothing_else_is_needed():
    """Not SciPy, which Numba takes where it is."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_SCIPY], cwd=ROOT, env={**os.environ}, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr


def test_an_interpreter_that_lacks_something_is_told():
    assert needs() == "Python >=3.11 with numpy>=1.26,<3 and numba>=0.60"
