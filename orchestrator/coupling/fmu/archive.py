"""The archive of an FMU, looked at before anything of it is unpacked, and unpacked with a hash of each file.

An archive can be made to fill a disk from a few bytes, to write beside the folder that it is unpacked to, or to hold two
files under one name. What its directory says is enough to tell.
"""

from __future__ import annotations

import hashlib
import os
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from stat import S_IFMT, S_ISDIR, S_ISREG

MEGABYTES, FILES = "LINE_LANDING_UNZIPPED_MB", "LINE_LANDING_UNZIPPED_FILES"
"""Environment variables that allow more."""
MOST_MEGABYTES, MOST_FILES = 2048.0, 20_000
DENSE, DENSE_MEGABYTES = 200.0, 256.0
"""Bytes unpacked for each in the archive, beyond which so many megabytes are the most: nothing worth it packs that well."""
LONGEST = 255
"""Bytes of a name that a folder may hold."""
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
HEADER, ENCRYPTED, PIECE = 30, 1, 1 << 20
"""Least bytes of the header before a file in the archive; flag of a file that is encrypted; bytes unpacked at a time."""
MEGABYTE = 1e6
Hashes = dict[str, str]
"""File within an FMU → its SHA-256."""


class ArchiveError(ValueError):
    """What is wrong with an archive."""


def files_of(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the files of an archive by their paths; `ArchiveError` where one must not be unpacked."""
    infos = archive.infolist()
    problem = next(_problems(infos, os.fstat(archive.fp.fileno()).st_size if archive.fp else 0), None)
    if problem is not None:
        raise ArchiveError(f"its archive {problem}")
    return {_path(info): info for info in infos if not info.is_dir()}


def _problems(infos: list[zipfile.ZipInfo], size: int) -> Iterator[str]:
    yield from _too_much(infos, size)
    for info in infos:
        yield from (f"has a file {info.orig_filename[:200]!r} {problem}" for problem in _wrong(info))
    yield from _meeting(infos)
    yield from _overlapping(infos)


def _too_much(infos: list[zipfile.ZipInfo], size: int) -> Iterator[str]:
    """Yield whether it has too many files, or would take too much room."""
    allowed, files = _allowed(MEGABYTES), _allowed(FILES)
    total = sum(info.file_size for info in infos) / MEGABYTE
    if len(infos) > (files or MOST_FILES):
        yield f"has {len(infos)} files, more than {files or MOST_FILES:.0f}; if you trust it set {FILES}={len(infos)}"
    if total > (allowed or MOST_MEGABYTES):
        yield f"unpacks to {total:.0f} MB, more than {allowed or MOST_MEGABYTES:.0f}; {_trust(total)}"
    elif allowed is None and total > DENSE_MEGABYTES and total * MEGABYTE > DENSE * size:
        yield f"unpacks {size / MEGABYTE:.3g} MB to {total:.0f} MB, as no model does; {_trust(total)}"


def _trust(total: float) -> str:
    return f"if you trust it set {MEGABYTES}={total + 1:.0f}"


def _allowed(variable: str) -> float | None:
    """Return what an environment variable allows; `ArchiveError` where it is no number."""
    text = os.environ.get(variable)
    try:
        return None if not text else float(text)
    except ValueError:
        raise ArchiveError(f"cannot be measured: {variable}={text} is no number; correct it") from None


def _wrong(info: zipfile.ZipInfo) -> Iterator[str]:
    """Yield what keeps one file from being unpacked."""
    name, kind = info.orig_filename, S_IFMT(info.external_attr >> 16)
    if not name.strip("/") or name.startswith("/") or "\\" in name or ":" in name or ".." in name.split("/"):
        yield "that does not lie within it (absolute, a drive, a backslash or ..); export it anew"
    if "\0" in name or any(len(part.encode("utf-8", "replace")) > LONGEST for part in name.split("/")):
        yield "whose name no file can have; export it anew"
    if kind and not (S_ISREG(kind) or S_ISDIR(kind)):
        yield "that is a link or a device; export it anew with the file itself"
    if info.flag_bits & ENCRYPTED or info.compress_type not in METHODS:
        yield f"that is encrypted, or packed by a method ({info.compress_type}) that such files do not use; pack it anew"


def _path(info: zipfile.ZipInfo) -> str:
    return "/".join(part for part in info.orig_filename.split("/") if part not in ("", "."))


def _meeting(infos: list[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield names that are one on some system, and files in the place of folders."""
    paths = [_path(info) for info in infos if not info.is_dir()]
    known: dict[str, str] = {}
    for path in paths:
        other = known.setdefault(_folded(path), path)
        if other is not path:
            what = "twice" if other == path else f"and {other[:200]!r}, which are one where case does not count"
            yield f"has {path[:200]!r} {what}; export it anew"
    above = {_folded(parent) for info in infos for parent in _parents(_path(info), info.is_dir())}
    both = next((path for path in paths if _folded(path) in above), None)
    if both is not None:
        yield f"has {both[:200]!r} both as a file and as a folder; export it anew"


def _folded(path: str) -> str:
    return unicodedata.normalize("NFC", path).casefold()


def _parents(path: str, itself: bool) -> Iterator[str]:
    parts = path.split("/")
    yield from ("/".join(parts[:i]) for i in range(1, len(parts) + itself))


def _overlapping(infos: list[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield whether files share bytes of the archive, by which a small one unpacks to any size."""
    end, last = 0, ""
    for info in sorted(infos, key=lambda info: info.header_offset):
        if info.header_offset < end:
            yield f"has files that overlap ({last[:200]!r} and {info.filename[:200]!r}); export it anew"
            return
        end, last = info.header_offset + HEADER + info.compress_size, info.filename


def unpack(path: Path, folder: Path) -> Hashes:
    """Unpack the FMU at `path` into the new `folder`, and return the hash of each file; `ArchiveError` if it is damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            found = files_of(archive)
            folder.mkdir()
            return {name: _unpacked(archive, info, folder / name) for name, info in found.items()}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise ArchiveError(f"its archive is damaged: {error}; export it anew") from None


def _unpacked(archive: zipfile.ZipFile, info: zipfile.ZipInfo, target: Path) -> str:
    """Unpack one file; return its hash."""
    target.parent.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    with archive.open(info) as source, target.open("xb") as file:
        while piece := source.read(PIECE):
            digest.update(piece)
            file.write(piece)
    return digest.hexdigest()


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
