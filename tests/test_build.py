"""Where FMUs and compiled kernels are kept, and what keeps processes that build at the same moment apart."""

import dataclasses
import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fmus.face import build, first_use, lock
from fmus.face.build import ensure_fmu, kept
from fmus.face.lock import locked
from fmus.kernels import cache, jit
from fmus.module import registry
from fmus.module.variables import ModuleError
from orchestrator.catalogue import library
from orchestrator.coupling.errors import InputError

RECIPE = registry.find("oscillator").recipe()
HOLD = "import sys, time; from pathlib import Path; from fmus.face.lock import locked\n"
HOLD += "with locked(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"


@pytest.fixture
def holder(tmp_path):
    """A process that holds the lock of ``tmp_path / "x"``."""
    with subprocess.Popen([sys.executable, "-c", HOLD, tmp_path / "x"], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline() == b"held\n"
        yield process
        process.kill()


@pytest.fixture
def quick(monkeypatch):
    """Builds make files that hold nothing but the record of what they are made from."""

    def pretended(recipe, path):
        path.write_bytes(build.pack({build.RECORD: json.dumps(build.record(recipe)).encode()}))
        return path

    monkeypatch.setattr(build, "_build", pretended)


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("LINE_LANDING_FMUS", raising=False)
    return tmp_path / "cache"


def run_python(code: str, *arguments: object, **environment: object) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-c", code, *map(str, arguments)]
    given = {name: str(value) for name, value in environment.items()}
    return subprocess.run(call, capture_output=True, text=True, env=os.environ | given, timeout=300)


# --- locks -------------------------------------------------------------------------------------------------


def test_a_link_in_place_of_the_lock_file_is_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("kept")
    (tmp_path / ".x.lock").symlink_to(victim)
    with (
        pytest.raises(ModuleError, match=r"\.x\.lock: is a link, which is not followed; remove it"),
        locked(tmp_path / "x"),
    ):
        pass
    assert victim.read_text() == "kept" and (tmp_path / ".x.lock").is_symlink()


def test_a_held_lock_is_waited_for_with_a_message_and_a_limit(tmp_path, holder, monkeypatch, capsys):
    monkeypatch.setattr(lock, "QUIET", 0.1)
    start = time.monotonic()
    message = r"\.x\.lock: another process has held this lock for 0\.5 s; end that process"
    with pytest.raises(ModuleError, match=message), locked(tmp_path / "x", limit=0.5):
        pass
    assert 0.5 < time.monotonic() - start < 10.0
    said = f"line-landing: waiting for another process, which holds {tmp_path / '.x.lock'} …\n"
    assert capsys.readouterr().err == said


def test_a_process_that_is_killed_leaves_no_lock(tmp_path, holder):
    holder.kill()
    holder.wait()
    with locked(tmp_path / "x", limit=5.0):
        pass
    assert list(tmp_path.iterdir()) == []


def test_threads_take_turns_and_leave_no_file(tmp_path):
    inside: list[int] = []

    def work(_: int) -> int:
        with locked(tmp_path / "x"):
            inside.append(1)
            most = len(inside)
            time.sleep(0.01)
            inside.pop()
        return most

    with ThreadPoolExecutor(8) as pool:
        assert set(pool.map(work, range(24))) == {1}
    assert list(tmp_path.iterdir()) == []


# --- FMUs --------------------------------------------------------------------------------------------------


def test_four_processes_that_need_an_fmu_at_once_build_it_once(tmp_path):
    code = "import sys; from pathlib import Path; from fmus.face import build\n"
    code += "from fmus.module.registry import find\n"
    code += "made = []; before = build._build; build._build = lambda *a: (made.append(1), before(*a))[1]\n"
    code += "print(build.kept(find('oscillator').recipe(), Path(sys.argv[1])).ensured().name, len(made))"
    with ThreadPoolExecutor(4) as pool:
        done = list(pool.map(lambda _: run_python(code, tmp_path), range(4)))
    assert [d.returncode for d in done] == [0] * 4, [d.stderr for d in done]
    (name,) = {d.stdout.split()[0] for d in done}
    assert sum(int(d.stdout.split()[1]) for d in done) == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_two_of_one_name_have_a_file_each(quick, tmp_path):
    other = dataclasses.replace(RECIPE, start={**RECIPE.start, "mass": 2.0})
    first, second = kept(RECIPE, tmp_path).ensured(), kept(other, tmp_path).ensured()
    written = first.stat().st_mtime_ns
    assert first.name.startswith("oscillator-") and second.name.startswith("oscillator-") and first != second
    assert kept(RECIPE, tmp_path).ensured() == first and first.stat().st_mtime_ns == written
    first.write_bytes(first.read_bytes()[:100])
    assert kept(RECIPE, tmp_path).ensured() == first and kept(RECIPE, tmp_path).is_there


def test_what_is_up_to_date_needs_no_folder_to_write_to(quick, tmp_path, monkeypatch):
    path = ensure_fmu(RECIPE, tmp_path)
    monkeypatch.setattr(build, "locked", None)
    assert ensure_fmu(RECIPE, tmp_path) == path


def test_runs_keep_fmus_in_a_cache_of_the_users(own_cache, quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    old = own_cache / "fmus" / "robot-0.fmu"
    old.parent.mkdir(parents=True)
    old.touch()
    os.utime(old, (0, 0))
    path = library.module_fmu("oscillator")
    assert path.parent == own_cache / "fmus" and not old.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["cache"]


def test_line_landing_fmus_names_another_folder(own_cache, quick, tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_FMUS", str(tmp_path / "ours und Ähnliches"))
    assert library.module_fmu("oscillator").parent == tmp_path / "ours und Ähnliches"


def test_a_folder_that_cannot_be_made_is_said_with_its_cure(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("LINE_LANDING_FMUS", str(tmp_path / "file" / "fmus"))
    with pytest.raises(InputError, match=r"file/fmus: FMUs cannot be built there \(Not a directory\); choose"):
        library.module_fmu("oscillator")


# --- caches ------------------------------------------------------------------------------------------------


def test_old_entries_of_a_cache_are_removed(tmp_path):
    for name in ("old", "new"):
        (tmp_path / f"{name}_folder" / "deep").mkdir(parents=True)
        (tmp_path / f"{name}.fmu").touch()
    (tmp_path / "old_link").symlink_to(tmp_path / "new_folder")
    for path in tmp_path.glob("old*"):
        os.utime(path, (0, 0), follow_symlinks=False)
    cache.prune(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.fmu", "new_folder"]


def test_where_the_home_cannot_be_written_the_temporary_folder_serves_and_is_said_once(tmp_path):
    (tmp_path / "home").touch()  # a file: nobody can make folders in it, not even root
    (tmp_path / "tmp").mkdir()
    code = "import subprocess, sys; from fmus.kernels.cache import user_folder\n"
    code += "print(user_folder('kernels'), flush=True); user_folder('fmus')\n"
    code += "len(sys.argv) > 1 and subprocess.run([sys.executable, '-c', sys.argv[1]])"
    places = {"HOME": tmp_path / "home", "TMPDIR": tmp_path / "tmp", "XDG_CACHE_HOME": "", "LINE_LANDING_CACHE": ""}
    done = run_python(code, code, **places)
    folder = tmp_path / "tmp" / f"line-landing-{os.getuid()}"
    assert done.stdout.split("\n") == [str(folder / "kernels")] * 2 + [""]
    assert done.stderr == f"line-landing: ~/.cache/line-landing cannot be written; caches are kept in {folder}\n"
    assert folder.stat().st_mode & 0o077 == 0


def test_a_link_in_the_temporary_folder_is_not_taken_for_the_users_own(tmp_path, monkeypatch):
    (tmp_path / "other").mkdir()
    (tmp_path / f"line-landing-{os.getuid()}").symlink_to(tmp_path / "other")
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    assert cache._temporary().parent == tmp_path and not cache._temporary().is_symlink()


def test_what_former_versions_have_compiled_is_removed(own_cache):
    former = [Path(jit.__file__).parents[1] / "__pycache__" / "numba-0123456789abcdef", own_cache / "numba-0"]
    for folder in former:
        folder.mkdir(parents=True)
    jit._remove_former(own_cache / "kernels")
    assert not any(folder.exists() for folder in former)


# --- first use ---------------------------------------------------------------------------------------------


def test_compiling_is_said_before_and_after_and_only_then(tmp_path):
    (tmp_path / "own.py").write_text(
        "from fmus.kernels.jit import kernel\n\n\n@kernel\ndef half(x):\n    return 0.5 * x\n"
    )
    places = {"LINE_LANDING_CACHE": tmp_path / "cache", "PYTHONPATH": tmp_path}
    first, second = (run_python("import own; print(own.half(3.0))", **places) for _ in range(2))
    assert first.stdout == second.stdout == "1.5\n"
    before, after = first.stderr.splitlines()
    assert before.startswith("line-landing: compiling kernels for this machine, once")
    assert re.fullmatch(r"line-landing: kernels were compiled in \d+ s", after)
    assert second.stderr == ""


def test_kernels_of_modules_that_have_none_compiled_are_compiled_side_by_side(own_cache, monkeypatch, capsys):
    compiled, made = ["fmus.contact"], []
    monkeypatch.setattr(first_use, "is_compiled", lambda package: package in compiled)
    monkeypatch.setattr(first_use, "_compile_elsewhere", made.append)
    first_use.compile_modules()
    before, after = capsys.readouterr().err.splitlines()
    assert (
        sorted(made) == ["cable", "robot", "setdown"]
        and "(cable, robot, setdown)" in before
        and "were compiled in" in after
    )
    compiled += ["fmus.cable", "fmus.robot", "fmus.controller"]
    first_use.compile_modules()
    assert len(made) == 3 and capsys.readouterr().err == ""


@pytest.mark.parametrize("name", first_use.LANDING)
def test_all_kernels_that_a_module_needs_are_compiled_by_a_first_step(name):
    first_use.compile_module(name)
    assert jit.is_compiled(f"fmus.{name}")
