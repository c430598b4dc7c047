"""The last net: whatever happens, a command ends with a message and a status, never with a traceback on the screen."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from stat import S_IMODE

import pytest

import orchestrator
from orchestrator.catalogue import listing
from orchestrator.cli import commands, modes, net, terminal
from orchestrator.coupling.errors import INTERNAL, InputError
from orchestrator.coupling.steps import MOST, number_of
from orchestrator.report import drawing, style
from orchestrator.report.drawn import drawn
from orchestrator.runs import batch, last_net, worker
from tests.scenarios import OSCILLATOR, ROOT

Command = Callable[..., tuple[int, str]]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder for one test."""
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Run one command in this process; return its exit status and what it says on stderr."""

    def run(*arguments: object) -> tuple[int, str]:
        with pytest.raises(SystemExit) as ended:
            commands.main([str(argument) for argument in arguments])
        return int(ended.value.code or 0), capsys.readouterr().err

    return run


def broken(error: BaseException) -> Callable[..., object]:
    def fails(*_: object, **__: object) -> object:
        raise error

    return fails


# -- a fault of this program ------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [KeyError("shape"), EOFError(), AssertionError("never"), RecursionError("deep")])
def test_what_nobody_catches_has_a_status_and_a_file(
    error: Exception, command: Command, cache: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(listing, "scenarios", broken(error))
    status, said = command("list")
    (path,) = (cache / "crashes").iterdir()
    text = path.read_text(encoding="utf-8")
    assert status == INTERNAL and said.count("\n") == 1 and said.endswith(f"please report it with {path}\n")
    assert type(error).__name__ in said and "Traceback" in text and "['list']" not in said
    assert all(word in text for word in ("'list'", "platform: ", "line-landing ", "numpy ", type(error).__name__))
    assert S_IMODE(path.stat().st_mode) == 0o600


def test_a_panic_that_is_no_exception_of_python_s_is_caught(command: Command, cache: Path, monkeypatch):
    class Panic(BaseException):
        """As libraries in Rust raise."""

    monkeypatch.setattr(listing, "scenarios", broken(Panic("index out of bounds")))
    assert command("list")[0] == INTERNAL and len(list((cache / "crashes").iterdir())) == 1


def test_where_no_file_can_be_written_the_screen_has_it(command: Command, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(listing, "scenarios", broken(KeyError("shape")))
    monkeypatch.setattr(last_net, "user_folder", broken(OSError("read-only")))
    status, said = command("list")
    assert status == INTERNAL and "no file could be written (read-only)" in said and "KeyError: 'shape'" in said


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (MemoryError(), 3, "out of memory"),
        (ModuleNotFoundError("No module named 'h5py'", name="h5py"), 2, "h5py cannot be loaded"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(36, "File name too long", "x" * 300), 2, "check the path"),
        (OSError(28, "No space left on device", "out"), 3, "make room"),
    ],
)
def test_what_is_known_has_its_own_message(error, status, said, command: Command, cache: Path, monkeypatch):
    monkeypatch.setattr(listing, "scenarios", broken(error))
    found, message = command("list")
    assert found == status and said in message and not (cache / "crashes").exists()


def test_an_import_of_our_own_that_fails_is_a_fault_of_ours(cache: Path):
    error = ImportError("cannot import name 'x'", name="orchestrator.runs.job")
    assert net.ended(error, []) == INTERNAL
    assert net.ended(ImportError("libhdf5.so: cannot open", name="h5py.defs"), []) == 2


def test_what_a_thread_or_a_callback_loses_is_in_a_file(cache: Path, capsys: pytest.CaptureFixture[str]):
    with net.under_the_net([]):
        thread = threading.Thread(target=broken(KeyError("lost")))
        thread.start()
        thread.join()
    assert "internal error, KeyError: 'lost'" in capsys.readouterr().err
    assert len(list((cache / "crashes").iterdir())) == 1


def test_a_fault_in_a_worker_comes_as_the_name_of_its_file(cache: Path):
    with pytest.raises(
        last_net.InternalError, match=r"internal error, KeyError: 'shape'; please report it with .*\.txt"
    ):
        worker.guarded(broken(KeyError("shape")), "job", Path("store"))
    (path,) = (cache / "crashes").iterdir()
    assert "KeyError: 'shape'" in path.read_text() and "('job', " in path.read_text()
    with pytest.raises(InputError):  # no fault of ours
        worker.guarded(broken(InputError("wrong")))


def test_a_command_whose_worker_met_a_fault_does_not_end_with_1(command: Command, monkeypatch: pytest.MonkeyPatch):
    fault = last_net.InternalError("internal error, KeyError: 'shape'; please report it with FILE")
    monkeypatch.setattr(listing, "scenarios", lambda: batch._failure(fault) and {})
    assert command("list")[0] == INTERNAL
    monkeypatch.undo()
    assert command("list")[0] == 0  # the next command knows nothing of it


def started(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, env=os.environ | environment, timeout=120)


def test_an_import_that_fails_at_the_start_has_its_message(tmp_path: Path):
    (tmp_path / "typer").mkdir()
    (tmp_path / "typer" / "__init__.py").write_text("raise ImportError('libtyper.so: wrong ELF class', name='typer')")
    first = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv[1:] = ['list']"
    done = started(f"{first}\nfrom orchestrator.__main__ import main; main()")
    assert done.returncode == 2 and done.stdout == b""
    assert (
        done.stderr.startswith(b"orchestrator: typer cannot be loaded: libtyper.so") and done.stderr.count(b"\n") == 1
    )


# -- odd terminals ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("environment", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "LANG": "C"},
                                         {"PYTHONIOENCODING": "latin-1"}, {"PYTHONIOENCODING": "utf-16"}])  # fmt: skip
def test_every_terminal_shows_what_it_can(environment: dict[str, str], tmp_path: Path):
    """The list has °, ², – and a name of bytes that are no text."""
    name = os.fsdecode(b"caf\xe9 \xe2\x9c\x93.toml")
    code = (
        "import sys; from orchestrator.cli import commands\n"
        "for arguments in (['list'], ['validate', sys.argv[1]], ['--help']):\n"
        "    try: commands.main(arguments)\n"
        "    except SystemExit as end: print(end.code)\n"
    )
    done = started(code, name, **environment)
    assert done.returncode == 0 and b"Traceback" not in done.stderr and b"internal" not in done.stderr
    assert "no such scenario file" in done.stderr.decode(
        "utf-16" if "utf-16" in str(environment) else "ascii", "replace"
    )


def test_what_an_fmu_says_cannot_command_the_terminal():
    assert terminal.shown("a \x1b[2J\x07 b\nc\tü") == "a \\x1b[2J\\x07 b\nc\tü"
    assert len(terminal.shown("x" * 10**6)) < terminal.MOST + 100


@pytest.mark.parametrize("closed", ["1>&- 2>&-", ">/dev/full 2>&1"])
def test_a_message_to_nobody_ends_nothing(closed: str):
    line = f"{sys.executable} -m orchestrator validate nothing {closed}"
    assert subprocess.run(["bash", "-c", line], cwd=ROOT, capture_output=True, timeout=60).returncode == 2


# -- odd input --------------------------------------------------------------------------------------------------

TEXT = OSCILLATOR.read_text(encoding="utf-8")
ODD_FILES = {
    "a byte that is no UTF-8": (TEXT.encode() + b"# \xe9", "no UTF-8 text"),
    "UTF-16": (TEXT.encode("utf-16"), "no UTF-8 text"),
    "a NUL byte": (TEXT.encode() + b"\0", "not a TOML file"),
    "arrays in one another": (TEXT.encode() + b"\nx = " + b"[" * 5000 + b"]" * 5000, "deep in one another"),
    "tables in one another": (TEXT.encode() + b"\n" + b".".join([b"a"] * 500) + b" = 1", "deep in one another"),
    "a number of 400 digits": (f"n = {'9' * 400}\n{TEXT}".encode(), "n: a whole number has 64 bits"),
    "a number of 5000 digits": (f"n = {'9' * 5000}\n{TEXT}".encode(), "not a TOML file"),
    "a number of 5000 hexadecimal digits": (f"n = 0x{'f' * 5000}\n{TEXT}".encode(), "n: a whole number has 64 bits"),
}  # fmt: skip


@pytest.mark.parametrize("kind", ODD_FILES)
def test_a_file_that_is_no_scenario_is_refused(kind: str, command: Command, tmp_path: Path):
    content, message = ODD_FILES[kind]
    path = tmp_path / "odd.toml"
    path.write_bytes(content)
    status, said = command("validate", path)
    assert status == 2 and f"{path}: " in said and message in said and len(said) < 5000


@pytest.mark.parametrize("content", [b"\xef\xbb\xbf" + TEXT.encode(), TEXT.replace("\n", "\r\n").encode()])
def test_a_byte_order_mark_and_other_line_ends_change_nothing(content: bytes, tmp_path: Path):
    (tmp_path / "odd.toml").write_bytes(content)
    read, plain = orchestrator.load_scenario(tmp_path / "odd.toml"), orchestrator.load_scenario(OSCILLATOR)
    assert read.model_dump() == plain.model_dump()


def test_what_is_no_file_is_not_waited_for(command: Command, tmp_path: Path):
    """A pipe that nobody writes to, a folder, a device without an end: as scenario, robot, table, FMU, run."""
    pipe, folder = tmp_path / "pipe.toml", tmp_path / "folder.toml"
    os.mkfifo(pipe)
    folder.mkdir()
    for path in (pipe, folder, "/dev/zero"):
        table = f'components.left.inputs.force={{file="{path}"}}'
        for arguments in (
            ("validate", path), ("validate", "drop_5cm", "--robot", path), ("check", path), ("report", path),
            ("validate", OSCILLATOR, "--set", table), ("sweep", path), ("identify", path),
            ("validate", OSCILLATOR, "--set", f'components.left.fmu="{path}"'),
        ):  # fmt: skip
            assert command(*arguments)[0] == 2, arguments


@pytest.mark.parametrize("name", ["x" * 300, "x/" * 3000, "\x00"])
def test_a_name_that_no_file_can_have_is_refused(name: str, command: Command):
    for arguments in (("validate", name), ("check", name), ("report", name), ("validate", "drop_5cm", "--robot", name)):
        assert command(*arguments)[0] == 2, arguments


def test_no_run_makes_more_steps_than_anybody_can_wait_for(command: Command):
    for options in (["--stop", "1e300"], ["--macro-step", "5e-324"], ["--macro-step", "1e-9"]):
        status, said = command("run", OSCILLATOR, *options)
        assert status == 2 and "steps are more than 1e+09" in said
    assert number_of(1.0, 0.3) == 3 and number_of(1e-9, 1.0) == 1 and number_of(1.0, 1.0 / MOST) == MOST


@pytest.mark.parametrize(
    "text",
    ["a." * 2000 + "b=1", f"title={'[' * 3000}", "title='a'\nb=2", f"master.tolerance={'9' * 400}"],
)
def test_a_setting_that_is_none_is_refused(text: str, command: Command):
    status, said = command("validate", OSCILLATOR, "--set", text)
    assert status == 2 and "--set" in said and len(said) < 5000


# -- a picture costs no run -------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [RuntimeError("no font"), ImportError("libpng.so"), MemoryError()])
def test_a_picture_that_fails_costs_no_run(error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(drawing, "draw", broken(error))
    out = tmp_path / "out"
    run = orchestrator.run(OSCILLATOR, stop=0.05, estimate="none", out=out)
    assert run.manifest["complete"] is True and type(error).__name__ in run.manifest["pictures"]


def test_the_pictures_before_one_that_fails_are_kept():
    def some():
        yield Path("first.png")
        raise RuntimeError("no font")

    with pytest.warns(UserWarning, match="a picture is missing: RuntimeError: no font"):
        assert drawn(some) == [Path("first.png")]


def test_modes_are_written_where_their_picture_fails(command: Command, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(style.Figure, "savefig", broken(RuntimeError("no font")))
    assert modes
    status, said = command("modes", "rig_10m", "--without-robot", "--out", tmp_path / "out")
    assert status == 0 and "a picture is missing: RuntimeError: no font" in said
    assert (tmp_path / "out" / "modes.csv").is_file()


# -- damaged run folders ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run."""
    out = tmp_path_factory.mktemp("whole") / "run"
    orchestrator.run(OSCILLATOR, stop=0.05, estimate="none", out=out, pictures=False)
    return out


def a_pipe(path: Path) -> None:
    path.unlink(missing_ok=True)
    os.mkfifo(path)


DAMAGED = {
    "a pipe in the place of a table": ("results.csv", a_pipe, "is no regular file"),
    "a pipe in the place of JSON": ("summary.json", a_pipe, "is no regular file"),
    "no HDF5": ("fields.h5", lambda path: path.write_bytes(b"no"), "cannot be read"),
    "a list in the place of a table": ("summary.json", lambda path: path.write_text("[]"), "holds no table but list"),
    "JSON in JSON": ("summary.json", lambda path: path.write_text("[" * 10**5), "cannot be read"),
    "half a row": ("results.csv", lambda path: path.write_text(path.read_text() + "0.1,"), "results.csv"),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_a_damaged_run_is_refused_by_name(kind: str, whole: Path, tmp_path: Path):
    name, damage, message = DAMAGED[kind]
    copy = tmp_path / "run"
    shutil.copytree(whole, copy)
    damage(copy / name)
    with pytest.raises(InputError, match=message) as found:
        orchestrator.load_run(copy)
    assert str(copy) in str(found.value)


def test_a_log_with_bytes_that_are_no_text_is_read(whole: Path, tmp_path: Path):
    shutil.copytree(whole, tmp_path / "run")
    (tmp_path / "run" / "fmu.log").write_bytes(b"a: [ok] caf\xe9\n")
    assert orchestrator.load_run(tmp_path / "run").messages == ["a: [ok] caf\ufffd"]


def test_a_scenario_whose_name_is_no_text_runs(tmp_path: Path):
    """Its path is in the manifest."""
    path = tmp_path / os.fsdecode(b"caf\xe9.toml")
    path.write_text(TEXT, encoding="utf-8")
    run = orchestrator.run(path, stop=0.05, estimate="none", out=tmp_path / "out", pictures=False)
    assert run.manifest["complete"] and orchestrator.load_run(tmp_path / "out").summary["title"] == run.summary["title"]
