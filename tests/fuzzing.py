"""What the fuzz tests mutate: scenarios, settings, archives, descriptions, run folders; and what no case may do."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import signal
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from orchestrator.cli import commands
from orchestrator.coupling.cache import user_folder
from orchestrator.coupling.fmu import instance
from tests.scenarios import SCENARIOS

STATUSES = (0, 1, 2, 3)
FAULTS = f"*-{os.getpid()}-*.txt"
"""Files of faults that this process has met."""
PATIENCE, ASLEEP = 60, 600
"""s that a case may take of a processor, and by the clock, however busy the machine is; none takes one on an idle machine."""
FMUS = Path(__file__).parent / "fmus"
NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
WORDS = (
    "1e400", "-1", "0", "nan", "-inf", "9" * 400, "0x" + "f" * 400, '""', '"x"', "[]", "[1, 2]", "[[[[1]]]]", "{}",
    '{ value = 1.0, unit = "m" }', '{ value = "x", unit = 3 }', '{ value = 1.0, source = "assumed" }', "{ value = {} }",
    "true", "2020-01-01", "12:00:00", '"\\u0000"', '"\\ud7ff"', '"../x.fmu"', '"/"',
    "{ time = [0.0, 1.0], value = [1.0, 2.0] }",
    "{ time = [1.0, 0.0], value = [1.0] }", '{ file = "x.csv" }', '{ time = [0.0], value = ["a"] }', "1_000", "-0.0", "5e-324",
    "1e308", '"ü✓ \\n"', "'''a\nb'''", '"jacobi"', '"iqn_ils"', '"fptlir"', "18446744073709551615", "0.001", "1", "2.5",
)  # fmt: skip
ATTRIBUTES = (
    "", "0", "-1", "4294967295", "4294967296", "1e400", "nan", "x", "9" * 400, "true", "input", "output", "parameter",
    "tunable", "structuralParameter", "independent", "discrete", "continuous", "exact", "2.0", "3.0", "1.0", "..", "a/b",
    "\x7f", "é", "1 2 3",
)  # fmt: skip
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


# -- what no case may do ----------------------------------------------------------------------------------------


@contextmanager
def place() -> Iterator[Path]:
    """Give a folder to work in, and see that nothing is left: in it, in the temporary folder, of FMUs, of faults."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as outer, contextlib.ExitStack() as stack:
        here, temporary, given = (Path(outer, name) for name in ("here", "tmp", "given"))
        for folder in (here, temporary, given):
            folder.mkdir()
        before, faults = (os.environ.get("TMPDIR"), tempfile.tempdir), _own("crashes", FAULTS)
        others = list(instance._instances)  # of tests before
        os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
        stack.callback(_restore, *before)
        stack.enter_context(contextlib.chdir(here))
        yield given
        assert not [*here.iterdir()], "left in the current folder"
        assert not [*temporary.iterdir()], "left in the temporary folder"
        assert instance._instances == others, "an FMU was not freed"
        assert _own("crashes", FAULTS) == faults, "a fault of this program"
        left = [*_own("unpacked", f"line-landing-{os.getpid()}-*"), *_own("instances", f"{os.getpid()}-*")]
        assert not left, "left in the cache"


def _own(kind: str, pattern: str) -> list[Path]:
    """Return what this process has left in a folder of the cache."""
    return sorted(user_folder(kind, plain=True).glob(pattern))


def _restore(variable: str | None, folder: str | None) -> None:
    tempfile.tempdir = folder
    os.environ.pop("TMPDIR") if variable is None else os.environ.update(TMPDIR=variable)


class HangError(BaseException):
    """A case has come to no end; nothing that catches errors may take it for one."""


@contextmanager
def in_time() -> Iterator[None]:
    """Raise `HangError` where a case hangs."""

    def ring(*_: object) -> None:
        raise HangError(f"no end within {PATIENCE} s of a processor or {ASLEEP} s by the clock")

    clocks = {signal.ITIMER_PROF: (signal.SIGPROF, PATIENCE), signal.ITIMER_REAL: (signal.SIGALRM, ASLEEP)}
    before = {number: signal.signal(number, ring) for number, _ in clocks.values()}
    for clock, (_, most) in clocks.items():
        signal.setitimer(clock, most)
    try:
        yield
    finally:
        for clock in clocks:
            signal.setitimer(clock, 0.0)
        for number, former in before.items():
            signal.signal(number, former)


def command(*arguments: object) -> int:
    """Run a command; return its exit status, once it has ended as a command may."""
    out, err = io.StringIO(), io.StringIO()
    status: Any = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), in_time():
        try:
            commands.main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code or 0
    said = err.getvalue()
    assert status in STATUSES and "Traceback" not in said + out.getvalue(), f"status {status}: {said[-3000:]}"
    assert status == 0 or said or out.getvalue(), "not a word"
    return int(status)


# -- texts ------------------------------------------------------------------------------------------------------


def _pick(n: int) -> st.SearchStrategy[int]:
    return st.integers(0, max(n - 1, 0))


@st.composite
def mutated(draw: st.DrawFn, text: str, words: tuple[str, ...] = WORDS) -> str:
    """Return a text with some of its lines, values and characters changed."""
    for _ in range(draw(st.integers(1, 3))):
        text = draw(st.sampled_from(CHANGES))(draw, text, words)
    return text


def _value(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Put another value behind an equals sign."""
    found = [*re.finditer(r"(?<== )[^\n#]+", text)]
    if not found:
        return text
    one = found[draw(_pick(len(found)))]
    return text[: one.start()] + draw(st.sampled_from(words)) + text[one.end() :]


def _line(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Leave out a line, or put it elsewhere once more."""
    lines = text.splitlines() or [""]
    i, j = draw(_pick(len(lines))), draw(_pick(len(lines)))
    line = lines[i] if draw(st.booleans()) else lines.pop(i)
    return "\n".join([*lines[:j], line, *lines[j:]] if draw(st.booleans()) else lines) + "\n"


def _insert(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Write something in between, or over what stands there."""
    i, n = draw(_pick(len(text))), draw(st.integers(0, 5))
    return text[:i] + draw(st.text(max_size=4) | st.sampled_from(words)) + text[i + n :]


def _cut(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    return text[: draw(_pick(len(text)))]


CHANGES = [_value, _value, _value, _line, _insert, _cut]


def scenario_texts(graph: str) -> st.SearchStrategy[str]:
    """Return mutated scenarios: those that are shipped, and a `graph`."""
    texts = [(SCENARIOS / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES]
    return st.sampled_from([graph, graph, *texts]).flatmap(mutated)


KEYS = [
    "simulation.stop_time", "simulation.macro_step", "simulation.master", "simulation.exchange", "simulation.record", "title",
    "simulation.tolerances.p.y", "simulation.timeout", "simulation.start_time", "master.tolerance", "master.max_iterations",
    "components.p.parameters.gain", "components.p.inputs.u", "components.p.fmu", "components.p.model", "components.p.steps",
    "components.p.continuous", "components.p.isolate", "components.q", "components", "connections", "robot.parameters.mass",
    "robot.model", "cable.conductor", "cable.state.sag", "cable.parameters.span", "landing.position", "limits.roll",
    "contact.stiffness_set", "robot.inputs.thrust", "extends", "simulation", "", ".", "a.b",
]  # fmt: skip
settings_texts = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(KEYS), st.sampled_from(WORDS) | st.text(max_size=8)).map("=".join),
        st.tuples(st.sampled_from(KEYS), st.sampled_from(WORDS)).map("=".join).flatmap(mutated),
        st.text(max_size=12),
    ).filter(lambda text: "\0" not in text and not any("\ud800" <= c <= "\udfff" for c in text)),
    min_size=1,
    max_size=3,
)


# -- archives and descriptions ----------------------------------------------------------------------------------


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Return bytes with some changed, left out, repeated or added, most of them near the end, where the directory is."""
    found = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        back = draw(st.sampled_from([100, 400, len(found)]))
        i = max(len(found) - 1 - draw(_pick(min(back, len(found) or 1))), 0)
        n = draw(st.integers(0, 8))
        found[i : i + n] = draw(st.binary(max_size=8))
    return bytes(found[: draw(st.sampled_from([len(found), len(found), draw(_pick(len(found)))]))])


MEMBERS = st.lists(
    st.tuples(
        st.sampled_from(
            ["resources/", "", "/", "../", "binaries/linux64/", "C:", "resources/../", "modelDescription.xml", "a\\"]
        ),
        st.text(max_size=4),
        st.sampled_from([0, 0, 0o120777, 0o010666, 0o040755]),
        st.sampled_from([0, 0, 1, 0x800]),
    ),
    max_size=4,
)  # fmt: skip


def with_members(content: bytes, members: list[tuple[str, str, int, int]]) -> bytes:
    """Return an archive with more members: names, modes, flags."""
    found = io.BytesIO(content)
    with contextlib.suppress(ValueError, UnicodeEncodeError), zipfile.ZipFile(found, "a") as archive:
        for folder, name, mode, flags in members:
            info = zipfile.ZipInfo("x")
            info.filename = info.orig_filename = folder + name
            info.external_attr, info.flag_bits = mode << 16, flags & 0x800
            archive.writestr(info, b"x" * 10)
    return found.getvalue()


@st.composite
def descriptions(draw: st.DrawFn, text: str) -> str:
    """Return a model description with attributes and elements changed."""
    for _ in range(draw(st.integers(1, 3))):
        text = draw(st.sampled_from([_attribute, _attribute, _attribute, _element, _tag, _insert]))(
            draw, text, ATTRIBUTES
        )
    return text


def _attribute(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Give an attribute another value, or take it away."""
    found = [*re.finditer(r' \w+="([^"]*)"', text)]
    if not found:
        return text
    one = found[draw(_pick(len(found)))]
    if draw(st.booleans()):
        return text[: one.start()] + text[one.end() :]
    return text[: one.start(1)] + draw(st.sampled_from(words)) + text[one.end(1) :]


def _element(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Take an element away, or have it twice."""
    found = [*re.finditer(r"<(\w+)[^>]*?(/>|>[^<]*</\1>)", text)]
    if not found:
        return text
    one = found[draw(_pick(len(found)))]
    return text[: one.start()] + one[0] * (2 * draw(st.booleans())) + text[one.end() :]


def _tag(draw: st.DrawFn, text: str, words: tuple[str, ...]) -> str:
    """Call an element otherwise."""
    names = sorted(set(re.findall(r"<(\w+)", text))) or ["x"]
    name = names[draw(_pick(len(names)))]
    return text.replace(f"<{name}", f"<{draw(st.sampled_from(['Real', 'String', 'Clock', 'Binary', 'Int8', 'x']))}")


def repacked(content: bytes, description: str) -> bytes:
    """Return an FMU with another description."""
    found = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(found, "w") as new:
        new.writestr("modelDescription.xml", description.encode("utf-8", "replace"))
        for name in old.namelist():
            if name != "modelDescription.xml":
                new.writestr(name, old.read(name))
    return found.getvalue()


# -- run folders ------------------------------------------------------------------------------------------------


def _garbage(draw: st.DrawFn, path: Path) -> None:
    path.write_bytes(draw(st.binary(max_size=20)))


def _shortened(draw: st.DrawFn, path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: draw(_pick(len(content)))])


def _changed(draw: st.DrawFn, path: Path) -> None:
    path.write_bytes(draw(damaged(path.read_bytes())))


def _gone(draw: st.DrawFn, path: Path) -> None:
    path.unlink()


def _folder(draw: st.DrawFn, path: Path) -> None:
    path.unlink()
    path.mkdir()


def _pipe(draw: st.DrawFn, path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _circle(draw: st.DrawFn, path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


def _other_json(draw: st.DrawFn, path: Path) -> None:
    """Put other values into a JSON file."""
    if path.suffix != ".json":
        return _changed(draw, path)
    content = json.loads(path.read_text(encoding="utf-8"))
    keys = [*content] if isinstance(content, dict) else []
    if keys:
        key = keys[draw(_pick(len(keys)))]
        content.pop(key) if draw(st.booleans()) else content.update({key: draw(JSON)})
    path.write_text(json.dumps(content if keys else draw(JSON)), encoding="utf-8")
    return None


HARM: list[Callable[[st.DrawFn, Path], None]] = [
    _garbage, _shortened, _changed, _gone, _folder, _pipe, _circle, _other_json, _other_json, _other_json,
]  # fmt: skip
NUMBERS = (".json", ".csv", ".h5", ".log", ".bin")


def harmed(data: st.DataObject, whole: Path, folder: Path) -> Path:
    """Copy the folder of a run with one or two of its files damaged; return the copy."""
    copy = folder / "run"
    shutil.copytree(whole, copy)
    names = sorted(str(path.relative_to(copy)) for path in copy.rglob("*") if path.suffix in NUMBERS)
    for name in data.draw(st.lists(st.sampled_from(names), min_size=1, max_size=2, unique=True)):
        data.draw(_harm(copy / name))
    return copy


@st.composite
def _harm(draw: st.DrawFn, path: Path) -> str:
    how = draw(st.sampled_from(HARM))
    how(draw, path)
    return f"{how.__name__} {path.name}"
