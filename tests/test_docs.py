"""The documentation does what it says: snippets run, numbers are those of the files, sentences stay short.

Blocks of a page run in order in one folder: Python in one namespace, commands of ours in this process, what else a shell
does in a shell with the program in reach. A block that begins with ``# file: NAME`` is saved under that name instead.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from orchestrator.coupling.masters.options import master_options
from tests.command import orchestrate

pytestmark = pytest.mark.usefixtures("coarse_pictures")
ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
EXECUTED = [DOCS / "start.md", *sorted(page for page in (DOCS / "howto").glob("*.md") if page.stem != "index")]
BY_COMMAND = {
    DOCS / "verification.md",
    DOCS / "reproduction.md",
    DOCS / "robots_on_lines.md",
    DOCS / "setting_down.md",
    *DOCS.glob("reference/generated/*.md"),
    *DOCS.glob("_build/**/*.md"),
}
PAGES = {*DOCS.rglob("*.md"), *ROOT.glob("*.md"), *ROOT.glob("fmus/*/README.md")}
BY_HAND = sorted(PAGES - BY_COMMAND - {ROOT / "CHANGELOG.md"})
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
TO_FILE = re.compile(r"# file: (\S+)\n")


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return language and text of the fenced blocks that are executed or saved."""
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    return [(kind, text) for kind, text in found if kind in ("python", "shell") or TO_FILE.match(text)]


def of_ours_alone(text: str) -> list[list[str]]:
    """Return the arguments of the commands in a block, if it has nothing else in it: no other program, nothing of a shell."""
    lines = [shlex.split(line) for line in text.splitlines() if line]
    plain = all(line[0] == "orchestrator" and not {"|", "||", "&&", ";", ">", "<"} & set(line) for line in lines)
    return [line[1:] for line in lines] if plain else []


def in_shell(text: str, folder: Path) -> None:
    """Run a block as a shell would; the program of this environment is the one in reach."""
    if commands := of_ours_alone(text):
        for arguments in commands:
            end = orchestrate(*arguments, folder=folder)
            assert end.returncode == 0, f"{arguments}\n{end.stdout}\n{end.stderr}"
        return
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    end = subprocess.run(
        ["bash", "-ec", text], cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
    )
    assert end.returncode == 0, f"{text}\n{end.stdout}\n{end.stderr}"


@pytest.mark.parametrize("page", EXECUTED, ids=lambda page: page.stem)
def test_the_snippets_of_the_page_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    namespace: dict[str, Any] = {"__name__": page.stem}
    executed = 0
    for kind, text in blocks(page):
        if name := TO_FILE.match(text):
            (tmp_path / name[1]).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name[1]).write_text(text[name.end() :], encoding="utf-8")
            continue
        if kind == "python":
            exec(compile(text, f"{page.name}: {text.splitlines()[0]}", "exec"), namespace)
        else:
            in_shell(text, tmp_path)
        executed += 1
    assert executed, f"{page}: nothing to execute; a how-to shows how"


def prose(page: Path) -> str:
    """Return the text of a page without code, tables, formulas, pictures and comments."""
    text = re.sub(r"^```.*?^```$|<!--.*?-->", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    return re.sub(r"^(\||    |!\[|:).*$", "", text, flags=re.M)


@pytest.mark.parametrize("page", BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_are_for_a_tired_reader(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    long = [line for line in text.splitlines() if len(line) > 120 and not line.startswith(("|", "!["))]
    assert not long, f"{page}: lines of more than 120 characters: {long}"
    for paragraph in re.split(r"\n\s*\n|\n(?=[*-] |\d\. )|^#.*$", prose(page), flags=re.M):
        assert len(paragraph.split()) <= 100, f"{page}: more than 100 words in a paragraph: {paragraph}"


@pytest.fixture(scope="module")
def from_code() -> Any:
    """What makes the generated pages."""
    sys.path.insert(0, str(DOCS / "_extensions"))
    yield importlib.import_module("from_code")
    sys.path.remove(str(DOCS / "_extensions"))


def test_the_reference_names_every_variable_of_every_module(from_code: Any) -> None:
    for name, table in from_code.tables().items():
        page = from_code.variables_page(name, table)
        missing = [v.name for v in table.variables if f"`{from_code.pattern(v.name)}`" not in page]
        assert not missing, name


def test_the_reference_names_every_master_with_its_options(from_code: Any) -> None:
    page = from_code.masters_page()
    for name, options in master_options().items():
        assert f"## {name}\n" in page
        assert [key for key in options if f"| `{key}` |" not in page] == []


def test_the_reference_names_every_command_and_option(from_code: Any) -> None:
    page = from_code.command_line_page()
    for option in ("--macro-steps", "--robot", "--set", "--contract"):
        assert f"`{option} " in page
    commands = (
        "build",
        "check",
        "compare",
        "export",
        "identify",
        "limits",
        "list",
        "modes",
        "report",
        "reproduce",
        "run",
        "sweep",
        "validate",
    )
    for command in commands:
        assert f"## {command}\n" in page


def test_pages_that_the_code_points_to_exist() -> None:
    folders = ("fmus", "orchestrator", "tests", "verification", "benchmarks", "examples")
    files = [path for folder in folders for kind in ("*.py", "*.md") for path in (ROOT / folder).rglob(kind)]
    for file in [*files, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        named = re.findall(r"(?<![\w/])docs/[\w/]+\.\w+", file.read_text(encoding="utf-8"))
        assert [page for page in named if not (ROOT / page).exists()] == [], file


def test_measured_numbers_are_those_of_the_file() -> None:
    measured = runpy.run_path(str(DOCS / "measured.py"))
    found = json.loads(measured["FILE"].read_text(encoding="utf-8"))
    for page in measured["PAGES"]:
        text = page.read_text(encoding="utf-8")
        assert measured["BLOCK"].search(text), page
        assert measured["filled"](text, found) == text, f"{page}: python docs/measured.py --fill"


def test_the_table_of_engines_is_that_of_its_file() -> None:
    made = runpy.run_path(str(DOCS / "engines.py"))
    text = made["PAGE"].read_text(encoding="utf-8")
    assert made["filled"](text, json.loads(made["FILE"].read_text(encoding="utf-8"))) == text, "docs/engines.py --fill"


def test_the_page_of_robots_on_lines_is_that_of_its_file() -> None:
    made = runpy.run_path(str(DOCS / "robots_on_lines.py"))
    found = json.loads(made["FILE"].read_text(encoding="utf-8"))
    assert made["page"](found) == made["PAGE"].read_text(encoding="utf-8"), "python docs/robots_on_lines.py --fill"


def test_the_page_of_setting_down_is_that_of_its_file() -> None:
    made = runpy.run_path(str(DOCS / "setting_down.py"))
    found = json.loads(made["FILE"].read_text(encoding="utf-8"))
    assert made["page"](found) == made["PAGE"].read_text(encoding="utf-8"), "python docs/setting_down.py --fill"
    assert made["PICTURE"].exists()
