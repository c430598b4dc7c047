"""What the engine keeps between runs: where, for how long, and what it does not trust."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from stat import S_IMODE
from threading import Barrier
from time import time

import fmpy
import numba
import numpy as np
import pytest
from numba.core import caching

from fmus.kernels.cache import user_folder as folder_of_modules
from orchestrator.coupling import cache, kernel
from orchestrator.coupling.cache import user_folder
from orchestrator.coupling.fmu import unzipped
from orchestrator.coupling.fmu.unzipped import own_copy, unzip
from tests.fmus import build


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder for one test."""
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_said", set())
    return tmp_path / "cache"


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


# -- where ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("variable", ["LINE_LANDING_CACHE", "XDG_CACHE_HOME", "HOME"])
def test_engine_and_modules_share_a_folder(variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LINE_LANDING_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    assert user_folder("kernels") == folder_of_modules("kernels")
    assert tmp_path in user_folder("kernels").parents


def test_a_folder_that_cannot_be_written_has_a_stand_in_of_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], own: Path
) -> None:
    """Said once, and the processes started from here know."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "file" / "below"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folders = [user_folder(kind, plain=plain) for kind in ("kernels", "unzipped") for plain in (False, True)]
    base = folders[0].parent
    assert base.parent == tmp_path and {folder.parent for folder in folders} == {base}
    assert S_IMODE(base.stat().st_mode) == 0o700
    assert os.environ["LINE_LANDING_CACHE"] == str(base)
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"below cannot be written; caches are kept in {base}" in said
    assert folder_of_modules("kernels") == folders[0]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("spoilt", ["a link", "writable by all"])
def test_a_temporary_folder_that_others_can_have_filled_is_not_used(
    spoilt: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "file" / "below"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    place = tmp_path / f"line-landing-{os.getuid()}"
    if spoilt == "a link":
        (tmp_path / "other").mkdir()
        place.symlink_to(tmp_path / "other")
    else:
        place.mkdir()
        place.chmod(0o777)
    assert tmp_path not in user_folder("unzipped").parents


def test_a_home_with_letters_that_loaders_cannot_read(tmp_path: Path) -> None:
    """FMUs run from a folder, and for a user, with blanks and letters of all kinds in their paths; it is said once."""
    home, temporary = tmp_path / "Größe Ω", tmp_path / "tmp"
    for folder in (home, temporary):
        folder.mkdir()
    path = home / "ein öder + FMU #1.fmu"
    path.write_bytes(build("link").read_bytes())
    code = (
        "from orchestrator.coupling import Fmu, Graph, simulate\n"
        f"parts = {{name: Fmu({str(path)!r}) for name in 'ab'}}\n"
        "connections = ['a.position -> b.left.position', 'b.left.force -> a.force']\n"
        "with Graph(parts, connections) as graph:\n"
        "    log = simulate(graph, 'iqn_ils', 0.0, 0.02, 0.01)\n"
        "log.raise_error()\n"
        "print(len(log.time))\n"
    )
    kept = {name: value for name, value in os.environ.items() if name not in ("LINE_LANDING_CACHE", "XDG_CACHE_HOME")}
    environment = {**kept, "HOME": str(home), "TMPDIR": str(temporary)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=home, timeout=120
    )
    assert (done.returncode, done.stdout.strip()) == (0, "3"), done.stderr
    assert done.stderr.count("line-landing: FMUs cannot be loaded from") == 1
    base = temporary / f"line-landing-{os.getuid()}"
    assert S_IMODE(base.stat().st_mode) == 0o700
    assert len(list((base / "unpacked").iterdir())) == 1
    assert str(base).isascii() and not list(home.rglob("unpacked"))


# -- what is in there -------------------------------------------------------------------------------------------


def test_unzipped_once(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = unzip(build("odd"), "abc")
    monkeypatch.setattr(unzipped, "unpack", lambda *_: pytest.fail("unzipped again"))
    assert unzip(build("odd"), "abc") == first == own / "unpacked" / "abc"


def test_what_has_lost_a_file_is_unzipped_anew(own: Path) -> None:
    """Programs that clean temporary folders take files one by one."""
    path = build("odd")
    folder = unzip(path, "abc")
    before = files(folder)
    (folder / "modelDescription.xml").unlink()
    next((folder / "binaries").rglob("*.so")).unlink()
    assert files(unzip(path, "abc")) == before
    with zipfile.ZipFile(path) as archive:
        assert before == {name for name in archive.namelist() if not name.endswith("/")}
    assert [place.name for place in folder.parent.iterdir()] == ["abc"]


@pytest.mark.parametrize("whole", [True, False])
def test_a_link_is_not_followed(whole: bool, own: Path, tmp_path: Path) -> None:
    path, elsewhere = build("odd"), tmp_path / "elsewhere"
    elsewhere.mkdir()
    if whole:
        fmpy.extract(str(path), str(elsewhere))
    (own / "unpacked").mkdir(parents=True)
    (own / "unpacked" / "abc").symlink_to(elsewhere)
    before = files(elsewhere)
    folder = unzip(path, "abc")
    assert not folder.is_symlink() and (folder / "modelDescription.xml").is_file()
    assert files(elsewhere) == before


def test_several_at_once_see_it_whole_and_leave_nothing_else(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, unpack, barrier = build("odd"), unzipped.unpack, Barrier(4)

    def together(*arguments: Path) -> dict[str, str]:
        barrier.wait(10.0)  # all find nothing there, and all unzip
        return unpack(*arguments)

    monkeypatch.setattr(unzipped, "unpack", together)
    with ThreadPoolExecutor(4) as pool:
        folders = list(pool.map(lambda _: unzip(path, "abc"), range(4)))
    assert len(set(folders)) == 1
    assert [place.name for place in folders[0].parent.iterdir()] == ["abc"]


def test_a_damaged_archive_leaves_nothing(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def half(path: Path, folder: Path) -> None:
        folder.mkdir()
        (folder / "modelDescription.xml").write_text("")
        raise OSError("disk full")

    monkeypatch.setattr(unzipped, "unpack", half)
    with pytest.raises(OSError, match="disk full"):
        unzip(build("odd"), "abc")
    assert not list((own / "unpacked").iterdir()) and not (own / "unpacked-hashes").exists()


# -- what is not trusted ----------------------------------------------------------------------------------------


def test_what_was_changed_is_unzipped_anew(own: Path) -> None:
    """By an FMU or whoever else, its size and date as they were; a file more, or a link in the place of one."""
    path = build("odd")
    folder = unzip(path, "abc")
    description, before = folder / "modelDescription.xml", files(folder)
    content, when = description.read_bytes(), description.stat().st_mtime
    description.write_bytes(content.replace(b"x", b"y"))
    os.utime(description, (when, when))
    assert (unzip(path, "abc") / "modelDescription.xml").read_bytes() == content
    (folder / "resources" / "state.txt").write_text("left by a run")
    assert files(unzip(path, "abc")) == before
    description.unlink()
    description.symlink_to("/etc/passwd")
    assert (unzip(path, "abc") / "modelDescription.xml").read_bytes() == content
    (own / "unpacked-hashes" / "abc.json").write_text("{")
    assert files(unzip(path, "abc")) == before


def test_what_python_compiles_is_no_change(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = unzip(build("odd"), "abc")
    (folder / "resources" / "__pycache__").mkdir()
    (folder / "resources" / "__pycache__" / "odd.pyc").write_text("")
    monkeypatch.setattr(unzipped, "unpack", lambda *_: pytest.fail("unzipped again"))
    assert unzip(build("odd"), "abc") == folder


def test_an_instance_has_resources_of_its_own_and_shares_its_library(own: Path) -> None:
    """What one writes, no other sees; one library, so that the system loads it once."""
    folder = unzip(build("odd"), "abc")
    one, two = own_copy(folder), own_copy(folder)
    assert files(one) == files(two) == files(folder)
    script = next((one / "resources").glob("*.py")).relative_to(one)
    with (one / script).open("a") as file:
        file.write("# left by a run")
    assert (two / script).read_bytes() == (folder / script).read_bytes() != (one / script).read_bytes()
    library = next((one / "binaries").rglob("*.so")).relative_to(one)
    assert (one / library).samefile(folder / library)


def test_copies_of_processes_that_are_no_more_are_removed(own: Path) -> None:
    folder = unzip(build("odd"), "abc")
    code = (
        "import os; from pathlib import Path; from orchestrator.coupling.fmu.unzipped import own_copy\n"
        f"print(own_copy(Path({str(folder)!r})), flush=True); os.kill(os.getpid(), 9)"
    )
    lost = Path(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip())
    assert (lost / "modelDescription.xml").is_file()
    mine = own_copy(folder)
    assert [entry for entry in mine.parent.iterdir()] == [mine]


def test_the_oldest_are_removed_where_there_is_too_little_room(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Five of 1 MB in 3.5 MB, the last used today: two go, by age; what was used today stays even beyond the limit."""
    folder = user_folder("unpacked")
    for i in range(5):
        (folder / f"{i}" / "resources").mkdir(parents=True)
        (folder / f"{i}" / "resources" / "data").write_bytes(bytes(10**6))
        age = 0 if i == 4 else 86400 * (10 - i)
        os.utime(folder / f"{i}", (time() - age, time() - age))
    cache.shrink(folder, 3.5)
    assert sorted(entry.name for entry in folder.iterdir()) == ["2", "3", "4"]
    monkeypatch.setenv("LINE_LANDING_CACHE_MB", "0.5")
    cache.shrink(folder, 3.5)
    assert [entry.name for entry in folder.iterdir()] == ["4"]


# -- compiled kernels -------------------------------------------------------------------------------------------


def double(x):
    """A kernel: twice `x` (n,)."""
    for i in range(x.size):
        x[i] *= 2.0


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Neither beside its file nor in a folder of the user's can Numba keep what it compiles."""
    for locator in (caching.InTreeCacheLocator, caching.UserWideCacheLocator):
        monkeypatch.setattr(locator, "from_function", classmethod(lambda *_: None))
    return lambda: monkeypatch.setattr(caching.UserProvidedCacheLocator, "from_function", classmethod(lambda *_: None))


def twice(function: Callable[[np.ndarray], None]) -> list[float]:
    values = np.array([1.0, 2.0])
    function(values)
    return values.tolist()


def test_kernels_are_kept_in_the_engines_cache_where_numba_finds_no_place(
    own: Path, nowhere: Callable[[], None]
) -> None:
    with pytest.raises(RuntimeError, match="cannot cache"):
        numba.njit(cache=True)(double)
    before = numba.config.CACHE_DIR
    compiled = kernel.kernel(double)
    assert twice(compiled) == [2.0, 4.0]
    assert list((own / "kernels").rglob("*.nbc"))
    assert before == numba.config.CACHE_DIR
    again = kernel.kernel(double)
    assert twice(again) == [2.0, 4.0] and sum(again.stats.cache_hits.values()) == 1


def test_kernels_work_where_nothing_can_be_kept(own: Path, nowhere: Callable[[], None]) -> None:
    nowhere()
    assert twice(kernel.kernel(double)) == [2.0, 4.0]
