"""The files of a system structure: an archive unpacked once, within bounds, or a folder as it is."""

from __future__ import annotations

import os
import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from orchestrator.coupling.cache import prune, used, user_folder
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.fmu.archive import ArchiveError, files_of, sha256_of
from orchestrator.coupling.scratch import scratch
from orchestrator.scenario.ssp.names import DEFAULT_SSD, OSP_FILE
from orchestrator.scenario.ssp.xml import is_inside

MOST_FILES, MOST_BYTES = 10_000, 4 * 2**30
"""What an archive may unpack to."""
CHUNK = 2**20


def is_structure(path: Path) -> bool:
    """Return whether `path`, with a variant behind ``#``, is that of a system structure."""
    file = Path(str(path).partition("#")[0])
    return file.suffix.lower() in (".ssp", ".ssd") or file.name == OSP_FILE


@dataclass(frozen=True)
class Files:
    """The folder of a system structure, and which description in it is meant.

    Attributes
    ----------
    place : what the user knows it by
    variants : the other descriptions in the folder
    """

    place: Path
    folder: Path
    main: str
    variants: tuple[str, ...] = ()

    def file(self, uri: str, what: str) -> Path:
        """Return the file at a relative URI; `InputError` where there is none, or it leads outside."""
        name = unquote(uri)
        if not is_inside(name):
            raise InputError(f"{self.place}: {what}: {uri!r} is no path within the package, and no other is followed")
        path = self.folder / name
        if not path.is_file():
            there = [str(file.relative_to(self.folder)) for file in self.folder.rglob("*") if file.is_file()]
            raise InputError(f"{self.place}: {what}: no file {name!r} in the package{nearest(name, there)}")
        return path


def opened(path: Path) -> Files:
    """Return the files of a system structure: ``FILE.ssp``, ``FILE.ssp#VARIANT.ssd``, ``FILE.ssd`` or an OSP file."""
    text, _, variant = str(path).partition("#")
    file = Path(text)
    if file.suffix.lower() != ".ssp":
        return Files(path, file.absolute().parent, file.name)
    folder = _unpacked(file)
    there = sorted(one.name for one in folder.glob("*.ssd"))
    main = variant or (DEFAULT_SSD if DEFAULT_SSD in there or len(there) != 1 else there[0])
    if main not in there:
        has = f"it has {', '.join(there)}" if there else "it has none"
        raise InputError(f"{path}: no {main} in the archive ({has}); write {file.name}#NAME.ssd for another one")
    return Files(path, folder, main, tuple(name for name in there if name != main))


def _unpacked(path: Path) -> Path:
    """Return the folder in the user's cache where an archive is unpacked, whole."""
    try:
        folder = user_folder("structures", plain=True) / sha256_of(path)[:16]
        if not folder.is_dir():
            prune(folder.parent)
            _unpack(path, folder)
        return used(folder)
    except zipfile.BadZipFile as error:
        raise InputError(f"{path}: no SSP: {error}; export it anew") from None
    except ArchiveError as error:
        raise InputError(f"{path}: {error}") from None
    except (OSError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{path}: cannot be unpacked: {error}") from None


def _unpack(path: Path, folder: Path) -> None:
    with zipfile.ZipFile(path) as archive, scratch(folder.parent) as place:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        _require_bounded(path, entries)
        files_of(archive)
        left = MOST_BYTES
        for entry in entries:
            left = _write(archive, entry, Path(place, "all", entry.filename), left, path)
        if not entries:
            raise InputError(f"{path}: no SSP: the archive is empty; export it anew")
        _move(Path(place, "all"), folder)


def _move(made: Path, folder: Path) -> None:
    """Put what was made into place; where another process was quicker, its files stay."""
    try:
        os.rename(made, folder)
    except OSError:
        if not folder.is_dir():
            raise


def _require_bounded(path: Path, entries: list[zipfile.ZipInfo]) -> None:
    if len(entries) > MOST_FILES or sum(entry.file_size for entry in entries) > MOST_BYTES:
        raise InputError(
            f"{path}: unpacks to more than {MOST_FILES} files or {MOST_BYTES >> 30} GiB, and is not unpacked"
        )
    outside = [entry.filename for entry in entries if not is_inside(entry.filename)]
    if outside:
        raise InputError(f"{path}: holds {outside[0]!r}, which leads outside the archive; export it anew")


def _write(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path, left: int, path: Path) -> int:
    """Unpack one file, whatever the archive says of its size; return how many bytes may still come."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(entry) as source, target.open("wb") as file:
        while block := source.read(CHUNK):
            left -= len(block)
            if left < 0:
                shutil.rmtree(target.parent, ignore_errors=True)
                raise InputError(f"{path}: unpacks to more than {MOST_BYTES >> 30} GiB, and is not unpacked")
            file.write(block)
    return left
