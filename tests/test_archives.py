"""Archives and descriptions that are not what they should be: refused by name, before anything is unpacked."""

from __future__ import annotations

import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.cli import commands
from orchestrator.coupling.fmu import archive
from orchestrator.coupling.fmu.archive import ArchiveError, files_of, unpack
from orchestrator.coupling.fmu.description import departures, parsed, read_description
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.standard import DescriptionError
from tests.fmus import compiled, described, needs_compiler

TEXT = (Path(__file__).parent / "fmus" / "lag2.xml").read_text(encoding="utf-8")
THREE = (Path(__file__).parent / "fmus" / "lag3.xml").read_text(encoding="utf-8")


def made(path: Path, *members: str | zipfile.ZipInfo, size: int = 0) -> Path:
    """Write an archive of a description and empty files, or files of `size` zeros."""
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        warnings.simplefilter("ignore")  # names that stand twice
        file.writestr("modelDescription.xml", TEXT)
        for member in members:
            file.writestr(member, bytes(size))
    return path


def link(name: str, mode: int = 0o120777) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


def raw(name: str) -> zipfile.ZipInfo:
    """Return a member of that name as it is, which `ZipInfo` would mend."""
    info = zipfile.ZipInfo("x")
    info.filename = info.orig_filename = name
    return info


WRONG = {
    "beside": (["resources/../../evil"], "does not lie within it"),
    "absolute": (["/etc/evil"], "does not lie within it"),
    "a drive": (["C:/evil"], "does not lie within it"),
    "backslashes": ([raw("resources\\evil")], "does not lie within it"),
    "a link": ([link("resources/evil")], "a link or a device"),
    "a pipe": ([link("resources/evil", 0o010666)], "a link or a device"),
    "twice": (["resources/a", "resources/a"], "has 'resources/a' twice"),
    "the description twice": (["modelDescription.xml"], "has 'modelDescription.xml' twice"),
    "case": (["resources/a", "resources/A"], "one where case does not count"),
    "folder and file": (["resources/a", "resources/a/b"], "both as a file and as a folder"),
    "a long name": ([f"resources/{'x' * 300}"], "whose name no file can have"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_an_archive_that_must_not_be_unpacked_is_refused(kind: str, tmp_path: Path):
    members, message = WRONG[kind]
    path = made(tmp_path / "odd.fmu", *members)
    with zipfile.ZipFile(path) as file, pytest.raises(ArchiveError, match=message):
        files_of(file)
    with pytest.raises(ArchiveError, match=message):
        unpack(path, tmp_path / "new")
    assert [entry.name for entry in tmp_path.rglob("*") if entry.is_file()] == ["odd.fmu"]


def test_names_beyond_ascii_and_folders_of_their_own_are_fine(tmp_path: Path):
    path = made(tmp_path / "odd.fmu", "resources/", "resources/Größe.txt", "./documentation//a", "resources/empty/")
    assert set(unpack(path, tmp_path / "new")) == {"modelDescription.xml", "resources/Größe.txt", "documentation/a"}
    assert (tmp_path / "new" / "resources" / "Größe.txt").is_file()


def test_a_bomb_is_refused_by_what_its_directory_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """10 MB of zeros in 10 kB, held against limits a hundredth of ours; more is allowed to whoever asks for it."""
    path = made(tmp_path / "bomb.fmu", *(f"resources/{i}" for i in range(10)), size=10**6)
    monkeypatch.setattr(archive, "DENSE_MEGABYTES", 2.56)
    with pytest.raises(ArchiveError, match=r"to 10 MB, as no model does; .* set LINE_LANDING_UNZIPPED_MB=11"):
        unpack(path, tmp_path / "new")
    monkeypatch.setattr(archive, "MOST_MEGABYTES", 8.0)
    with pytest.raises(ArchiveError, match=r"unpacks to 10 MB, more than 8; if you trust it"):
        unpack(path, tmp_path / "new")
    monkeypatch.setenv(archive.MEGABYTES, "11")
    assert len(unpack(path, tmp_path / "new")) == 11
    monkeypatch.setattr(archive, "MOST_FILES", 5)
    with pytest.raises(ArchiveError, match=r"has 11 files, more than 5; .* LINE_LANDING_UNZIPPED_FILES=11"):
        unpack(path, tmp_path / "more")
    monkeypatch.setenv(archive.FILES, "many")
    with pytest.raises(ArchiveError, match="many is no number"):
        unpack(path, tmp_path / "more")


def test_files_that_share_their_bytes_are_refused(tmp_path: Path):
    """Of two entries of the directory the second is led to the first one's bytes (Fifield 2019)."""
    path = made(tmp_path / "bomb.fmu", "resources/a", "resources/b", size=1000)
    content = bytearray(path.read_bytes())
    entries = [i for i in range(len(content)) if content[i : i + 4] == b"PK\1\2"]
    content[entries[2] + 42 : entries[2] + 46] = content[entries[1] + 42 : entries[1] + 46]
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match="overlap"):
        unpack(path, tmp_path / "new")


def test_an_archive_that_lies_about_a_size_or_is_damaged_is_refused(tmp_path: Path):
    path = made(tmp_path / "odd.fmu", "resources/a", size=1000)
    content = path.read_bytes()
    entry = content.rindex(b"PK\1\2")
    shorter = content[: entry + 24] + struct.pack("<I", 100) + content[entry + 28 :]
    damaged = content[:60] + b"\xff" * 20 + content[80:]
    for i, changed in enumerate((shorter, damaged)):
        path.write_bytes(changed)
        with pytest.raises(ArchiveError, match="its archive is damaged"):
            unpack(path, tmp_path / f"new{i}")


@needs_compiler
@pytest.mark.parametrize("isolate", [False, True])
def test_an_fmu_whose_library_is_damaged_is_refused_and_leaves_nothing(isolate: bool, tmp_path: Path):
    """The description can be read; what follows fails its checksum."""
    content = bytearray(compiled("lag2").read_bytes())
    with zipfile.ZipFile(compiled("lag2")) as file:
        library = next(info for info in file.infolist() if info.filename.endswith(".so"))
    content[library.header_offset + 2000] ^= 255
    (tmp_path / "odd.fmu").write_bytes(content)
    with pytest.raises(ValueError, match="cannot be loaded: its archive is damaged"):
        Fmu(tmp_path / "odd.fmu", isolate=isolate)


def test_an_archive_that_is_encrypted_is_refused(tmp_path: Path):
    path = made(tmp_path / "odd.fmu", "resources/a", size=10)
    content = bytearray(path.read_bytes())
    entry = content.rindex(b"PK\1\2")
    content[entry + 8] |= 1
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match="is encrypted"):
        unpack(path, tmp_path / "new")


# -- descriptions -----------------------------------------------------------------------------------------------


def holding(path: Path, text: str) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", text)
    return path


def variable(more: str, kind: str = "Real", attributes: str = "") -> Callable[[str], str]:
    """Return what adds a variable to a description of FMI 2.0."""
    text = f'<ScalarVariable name="odd" valueReference="99" {attributes}><{kind} {more}/></ScalarVariable></ModelVariables>'
    return lambda description: description.replace("</ModelVariables>", text)


PARAMETER = 'causality="parameter" variability="fixed"'
UNUSABLE = {
    "a reference too large": (lambda t: t.replace('valueReference="1"', 'valueReference="4294967296"'), "below 2^32"),
    "a negative reference": (lambda t: t.replace('valueReference="1"', 'valueReference="-1"'), "below 2^32"),
    "a reference of 5000 digits": (lambda t: t.replace('valueReference="1"', f'valueReference="{"9" * 5000}"'), "below 2^32"),
    "no reference": (lambda t: t.replace('valueReference="1"', ""), "below 2^32"),
    "an unknown type": (variable("", "Complex"), "of a type that FMI 2.0 does not have"),
    "a start that is no number": (variable('start="fast"'), "start = 'fast', which is no Real"),
    "a start that is no whole number": (variable('start="1.5"', "Integer"), "start = '1.5', which is no Integer"),
    "a start beyond 32 bits": (variable('start="2147483648"', "Integer"), "which is no Integer"),
    "a start that is no Boolean": (variable('start="yes"', "Boolean"), "start = 'yes', which is no Boolean"),
    "a bound that is no number": (variable('min="low"'), "min = 'low'"),
    "min above max": (variable('min="2" max="1"'), "min = 2 above its max = 1"),
    "a start beyond its bounds": (variable('min="2" start="1"', attributes=PARAMETER), "start = 1 beyond"),
    "a name that stands twice": (variable("").__call__, "x"),
    "no identifier": (lambda t: t.replace('modelIdentifier="lag2"', ""), "no modelIdentifier"),
    "an identifier that leads elsewhere": (lambda t: t.replace('"lag2"', '"../../lag2"'), "names a binary"),
    "no guid": (lambda t: t.replace('guid="{lag2}"', ""), "no guid"),
    "no version": (lambda t: t.replace('fmiVersion="2.0"', ""), "fmiVersion"),
    "a version of the future": (lambda t: t.replace('fmiVersion="2.0"', 'fmiVersion="4.0"'), "FMI 4.0 is not known"),
    "no variables": (lambda t: t.replace("ModelVariables", "Variables"), "no element ModelVariables"),
    "no XML": (lambda t: t[: len(t) // 2], "modelDescription.xml is not one"),
    "entities": (
        lambda t: t.replace("<fmiModel", '<!DOCTYPE a [<!ENTITY a "b">]><fmiModel', 1), "has a document type"
    ),
}  # fmt: skip
UNUSABLE["a name that stands twice"] = (lambda t: variable("")(variable("")(t)), "two variables are called 'odd'")


@pytest.mark.parametrize("kind", UNUSABLE)
def test_a_description_that_cannot_be_taken_in_one_sense_is_refused(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    change, message = UNUSABLE[kind]
    path = holding(tmp_path / "odd.fmu", change(TEXT))
    with pytest.raises((ArchiveError, DescriptionError), match=r"modelDescription\.xml") as found:
        parsed(path)
    assert message in str(found.value) and len(str(found.value)) < 1000
    with pytest.raises(ValueError, match="not an FMU"):
        read_description(path)
    with pytest.raises(SystemExit) as ended:
        commands.main(["check", str(path)])
    assert ended.value.code == 2 and message in capsys.readouterr().err


NEW = {
    "an unknown type": (lambda t: t.replace("Int32", "Int128"), "does not have"),
    "arrays beyond all memory": (lambda t: t.replace('start="2"', 'start="999999999"'), "elements, more than"),
    "a dimension of nothing": (
        lambda t: t.replace('Dimension start="2"', 'Dimension start="0"', 1),
        "each is 1 at least",
    ),
    "an array with a word": (lambda t: t.replace('start="0 0"', 'start="0 x"'), "start = 'x'"),
    "no token": (lambda t: t.replace("instantiationToken", "token"), "no instantiationToken"),
}


@pytest.mark.parametrize("kind", NEW)
def test_fmi_3_is_held_to_its_own(kind: str, tmp_path: Path):
    change, message = NEW[kind]
    with pytest.raises(DescriptionError, match=message):
        parsed(holding(tmp_path / "odd.fmu", change(THREE)))


def test_a_description_larger_than_any_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("orchestrator.coupling.fmu.description.MOST_BYTES", 1000)
    with pytest.raises(DescriptionError, match="MB, more than"):
        parsed(holding(tmp_path / "odd.fmu", TEXT))


DEPARTING = {
    "no independent variable": (lambda t: t.replace("independent", "local"), THREE, "independent variable"),
    "a unit that is not defined": (variable('unit="furlong"'), TEXT, "furlong"),
    "an input without a start": (variable("", attributes='causality="input"'), TEXT, "no start value"),
    "what the schema does not know": (lambda t: t.replace("<CoSim", '<Vendor/><CoSim', 1), TEXT, "Vendor"),
}  # fmt: skip


@pytest.mark.parametrize("kind", DEPARTING)
def test_where_an_fmu_departs_from_the_standard_it_runs_and_is_said_to(kind: str, tmp_path: Path):
    change, text, message = DEPARTING[kind]
    path = holding(tmp_path / "odd.fmu", change(text))
    assert parsed(path).modelVariables and any(message in problem for problem in departures(path))
    assert not departures(holding(tmp_path / "even.fmu", text))


SCENARIO = """
title = "one"
[simulation]
stop_time = 0.1
macro_step = 0.01
master = "jacobi"
[components.p]
fmu = "{}"
"""


@needs_compiler
def test_validate_says_what_it_executes_and_where_an_fmu_departs(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    odd = described(compiled("lag2"), tmp_path, ("<CoSimulation", "<Vendor/><CoSimulation"))
    (tmp_path / "one.toml").write_text(SCENARIO.format(odd), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        commands.main(["validate", str(tmp_path / "one.toml")])
    said = capsys.readouterr().out
    assert not ended.value.code and f"executed of the FMUs: loaded, instantiated, no step: {odd.name}\n" in said
    assert "p: its description departs from FMI 2.0: " in said and "Vendor" in said
