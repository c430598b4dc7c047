"""Compiled kernels: code that was kept is used again, and never after anything that went into it has changed."""

from __future__ import annotations

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

import orchestrator.coupling
from fmus.kernels import jit

CONSTANTS = "FACTOR = 2.0\n"
CALLEE = """from fmus.kernels.jit import kernel
from probe.constants import FACTOR


@kernel
def callee(x):
    return FACTOR * x + 1.0
"""
CALLER = """from fmus.kernels.jit import kernel
from probe.callee import callee


@kernel
def caller(x):
    return callee(x) + 10.0
"""
REPORT = """
from fmus.kernels.jit import code_folder
from probe.caller import caller
value = caller(3.0)
hits, misses = (sum(counts.values()) for counts in caller.stats[1:])
print(value, hits, misses, code_folder("probe.caller").name)
"""


class Package:
    """A package `probe` of two kernel files and one of constants, run in new processes with a cache of their own."""

    def __init__(self, folder: Path, cache: Path):
        self.folder, self.cache = folder / "probe", cache
        self.folder.mkdir(parents=True)
        self.write(__init__="", constants=CONSTANTS, callee=CALLEE, caller=CALLER)

    def write(self, **files: str) -> None:
        """Write files by their names without ``.py``."""
        for name, text in files.items():
            (self.folder / f"{name}.py").write_text(text, encoding="utf-8")

    def run(self, *arguments: str) -> str:
        """Return what a process prints in the package's parent folder."""
        environment = {**os.environ, "LINE_LANDING_CACHE": str(self.cache)}
        call = [sys.executable, *arguments]
        folder = self.folder.parent
        done = subprocess.run(call, env=environment, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def report(self) -> tuple[float, int, int, str]:
        """Return the caller's result at 3, how often compiled code was found or not, and the name of its folder."""
        value, hits, misses, folder = self.run("-c", REPORT).split()
        return float(value), int(hits), int(misses), folder

    def compiled(self) -> dict[Path, int]:
        """Return the times at which the files of compiled code were written."""
        return {path: path.stat().st_mtime_ns for path in self.cache.rglob("*.nb[ic]")}


@pytest.fixture
def package(tmp_path):
    """In folders with blanks and letters that are not ASCII."""
    return Package(tmp_path / "mein Ordner, größer", tmp_path / "Zwischen speicher é")


def test_a_change_reaches_every_kernel_that_it_goes_into(package):
    """The callee in another file; a constant in a third one, without kernels. What has not changed is found again."""
    first = package.report()
    assert first[:3] == (17.0, 0, 1)
    written = package.compiled()
    assert package.report() == (17.0, 1, 0, first[3])
    assert package.compiled() == written
    package.write(callee=CALLEE.replace("+ 1.0", "+ 2.0"))
    assert package.report()[:3] == (18.0, 0, 1)
    package.write(constants="FACTOR = 5.0\n")
    assert package.report()[:3] == (27.0, 0, 1)
    package.write(constants=CONSTANTS, callee=CALLEE)
    assert package.report() == (17.0, 1, 0, first[3])  # back to where it was
    assert not list(package.folder.parent.rglob("*.nb[ic]"))  # nothing is written beside the sources


def test_two_files_that_call_one_another(package):
    """`forth` calls `back` in the other file, and that one's `again` calls `forth`: an edit of `back` reaches `again`."""
    head = "from fmus.kernels.jit import kernel\nimport probe.{}\n\n\n"
    one = "@kernel\ndef forth(x):\n    return probe.two.back(x) + 10.0\n"
    two = (
        "@kernel\ndef back(x):\n    return x + 1.0\n\n\n@kernel\ndef again(x):\n    return probe.one.forth(x) + 100.0\n"
    )
    package.write(one=head.format("two") + one, two=head.format("one") + two)
    code = "from probe.two import again; print(again(1.0))"
    assert float(package.run("-c", code)) == 112.0
    package.write(two=head.format("one") + two.replace("x + 1.0", "x + 2.0"))
    assert float(package.run("-c", code)) == 113.0


def test_kernels_in_a_script_and_at_a_prompt(package):
    """In a script the cache knows its callees too; what has no file is compiled each time."""
    script = package.folder.parent / "script.py"
    script.write_text(CALLER + "\n\nprint(caller(3.0))\n", encoding="utf-8")
    assert float(package.run("script.py")) == 17.0
    package.write(callee=CALLEE.replace("+ 1.0", "+ 2.0"))
    assert float(package.run("script.py")) == 18.0
    assert float(package.run("-c", CALLER + "\n\nprint(caller(3.0))\n")) == 18.0


def test_nothing_but_content_decides_over_the_folder(package, tmp_path):
    """Not the place, not the time: a copy elsewhere, written later, has the same folder; a comment makes another."""
    here = package.report()[3]
    there = Package(tmp_path / "elsewhere", tmp_path / "other cache")
    shutil.copytree(package.folder, there.folder, dirs_exist_ok=True, copy_function=shutil.copyfile)
    assert there.report()[3] == here
    there.write(constants=CONSTANTS + "# a comment\n")
    assert there.report()[3] != here


# --- which files are looked into ---------------------------------------------------------------------------------


LAYOUTS = {
    "name": ("from layout.callee import callee\n", {"callee"}),
    "module": ("from layout import callee\n", {"callee"}),
    "plain": ("import layout.callee\n", {"", "callee"}),
    "plain, renamed": ("import layout.callee as c, layout.constants\n", {"", "callee", "constants"}),
    "relative name": ("from .callee import callee\n", {"callee"}),
    "relative module": ("from . import callee\n", {"callee"}),
    "of the package": ("from layout import NUMBER\n", {""}),
    "several lines": (
        "from layout import (\n    callee,  # one (of two)\n    constants as c,\n)\n",
        {"callee", "constants"},
    ),
    "continued": ("from layout import callee, \\\n    constants\n", {"callee", "constants"}),
    "one line": ("import layout.callee; from layout import constants\n", {"", "callee", "constants"}),
    "star": ("from layout.star import *\n", {"star", "callee"}),
    "within a function": ("def f():\n    from layout import callee\n    return callee\n", {"callee"}),
    "package below": ("from layout.below import inner\n", {"below.inner", "callee"}),
    "name of a package below": ("from layout.below import DEPTH\n", {"below", "constants"}),
    "circle": ("from layout import circle\n", {"circle", ""}),  # which imports layout.main, and so the package
    "library": ("import numpy as np\nimport numba.core.types\nimport os.path\nfrom math import pi\n", set()),
    "no module": ("import no_such_module\nfrom layout.nowhere import x\n", set()),
}
"""How one file imports others → the modules that it depends on; the empty name is the package's own file."""


@pytest.fixture(params=[False, True], ids=["not imported", "imported"])
def layout(request, tmp_path, monkeypatch):
    """The folder of a package `layout`, its modules imported or not."""
    folder = tmp_path / "layout"
    (folder / "below").mkdir(parents=True)
    files = {"__init__": "NUMBER = 1\n", "callee": "callee = 1\n", "constants": "X = 1\n"}
    files |= {"star": "from layout.callee import *\n", "circle": "import layout.main\n"}
    files |= {"below/__init__": "from ..constants import X as DEPTH\n", "below/inner": "from ..callee import callee\n"}
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    for cached in (jit._file, jit._content):
        cached.cache_clear()
    if request.param:
        for name in ("callee", "constants", "star", "below.inner"):
            importlib.import_module(f"layout.{name}")
    yield folder
    for name in [name for name in sys.modules if name.split(".")[0] == "layout"]:
        del sys.modules[name]


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_import_is_followed(layout, name):
    text, wanted = LAYOUTS[name]
    (layout / "main.py").write_text(text, encoding="utf-8")
    found = set(jit.sources("layout.main")) - {"layout.main"}
    assert found == {f"layout.{part}".strip(".") for part in wanted}
    assert "layout.main" in jit.sources("layout.main")


def test_the_script_that_runs_is_none_of_the_sources(layout):
    """Some libraries import ``__main__``: what is known by its sources would else be another thing for each script."""
    (layout / "main.py").write_text("import __main__\nfrom __main__ import something\n", encoding="utf-8")
    assert set(jit.sources("layout.main")) == {"layout.main"}


def test_a_copy_under_another_name_depends_on_itself_alone(layout):
    """As in an FMU, whose sources stand under a name of their own."""
    copy = layout.with_name("fmus_0123456789abcdef")
    shutil.copytree(layout, copy)
    (copy / "main.py").write_text(f"from {copy.name} import callee\nfrom .below import DEPTH\n", encoding="utf-8")
    assert set(jit.sources(f"{copy.name}.main")) == {
        f"{copy.name}.{part}" for part in ("main", "callee", "below", "constants")
    }


# --- the folders of compiled code -----------------------------------------------------------------------------


def test_old_folders_are_removed_when_a_new_one_is_made(tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path))
    now = time.time()
    for name, days in (("old-0123", 40), ("young-0123", 20)):
        (tmp_path / "kernels" / name).mkdir(parents=True)
        os.utime(tmp_path / "kernels" / name, (now - 86400 * days,) * 2)
    folder = jit.code_folder.__wrapped__("fmus.kernels.banded")
    assert [path.name for path in (tmp_path / "kernels").iterdir()] == ["young-0123"]
    folder.mkdir()
    os.utime(folder, (now - 86400 * 40,) * 2)
    assert jit.code_folder.__wrapped__("fmus.kernels.banded") == folder  # what is used stays
    assert folder.stat().st_mtime > now - 60.0


def test_threads_decorate_one_after_the_other(tmp_path):
    """Numba's setting is the process's; it is the right one for each, and as before in the end."""
    before, entered, leave, seen = numba.config.CACHE_DIR, threading.Event(), threading.Event(), []

    def first():
        with jit._cached_in(tmp_path / "a"):
            entered.set()
            leave.wait(10.0)
            seen.append(numba.config.CACHE_DIR)

    def second():
        entered.wait(10.0)
        with jit._cached_in(tmp_path / "b"):
            seen.append(numba.config.CACHE_DIR)

    threads = [threading.Thread(target=target) for target in (first, second)]
    for thread in threads:
        thread.start()
    entered.wait(10.0)
    time.sleep(0.05)
    assert not seen  # the second one waits
    leave.set()
    for thread in threads:
        thread.join(10.0)
    assert seen == [str(tmp_path / "a"), str(tmp_path / "b")] and before == numba.config.CACHE_DIR


# --- the kernels of the coupling engine -------------------------------------------------------------------------


def engine_kernels() -> list[Dispatcher]:
    """Return all kernels of the coupling engine."""
    found = []
    for info in pkgutil.walk_packages(orchestrator.coupling.__path__, "orchestrator.coupling."):
        module = importlib.import_module(info.name)
        found += [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    return list(dict.fromkeys(found))


def test_the_engines_kernels_use_nothing_from_other_files():
    """Numba looks at a kernel's own file alone, and the engine relies on that: no callee, no constant from elsewhere."""
    kernels = engine_kernels()
    assert {one.py_func.__name__ for one in kernels} >= {"quasi_newton", "relative_residual"}
    for one in kernels:
        function = one.py_func
        used = {name: function.__globals__[name] for name in function.__code__.co_names if name in function.__globals__}
        assert not [name for name, value in used.items() if isinstance(value, Dispatcher)], function.__name__
        own = Path(function.__code__.co_filename).read_text(encoding="utf-8")
        foreign = [name for name in used if f"\n{name} = " not in own and name not in ("np", "math")]
        assert not foreign, f"{function.__name__} takes {foreign} from another file"
