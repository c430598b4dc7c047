"""Messages of FMI 2.0 with their arguments: the logger of the standard is variadic, as C's ``printf`` is.

ctypes knows no variadic callbacks. So the logger is declared with as many arguments as a message may have, and what a
format asks for is taken from where the platform's calling convention puts it; what is behind those given is never read,
or read and dropped. Strings are read through the system, which answers where there is no memory: a stray ``%s`` of a
message that was no format costs nothing.
"""

from __future__ import annotations

import ctypes
import os
import platform
import re
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from ctypes import c_char_p, c_double, c_int, c_int64, c_void_p
from typing import Any

DIRECTIVE = re.compile(
    r"%(?P<flags>[-+#0]*)(?P<width>\d*)(?P<point>\.\d+)?(?P<length>hh|h|ll|l|L|z|j|t)?(?P<kind>[diouxXeEfFgGaAcsp%])"
)
WORDS, NUMBERS = 16, 8
"""Arguments that are taken at most: whole numbers and pointers; floating-point numbers."""
LONGEST = 4096
"""Bytes of a string that are read at most."""
Sink = Callable[[int, str], None]
_MACHINE = platform.machine().lower()
APART = sys.platform != "win32" and _MACHINE in ("x86_64", "amd64", "aarch64", "arm64") and sys.platform != "darwin"
"""Whether floating-point arguments come in registers of their own: System V for x86-64, and AAPCS64 but for Apple's."""
IN_ROW = sys.platform == "win32" and _MACHINE in ("amd64", "x86_64")
"""Whether all come one after another, eight bytes each: Windows."""


def logger_type() -> Any:
    """Return the type of the callback: instance environment, instance name, status, category, message, arguments."""
    fixed = (c_void_p, c_char_p, c_int, c_char_p, c_char_p)
    if APART:
        return ctypes.CFUNCTYPE(None, *fixed, *[c_double] * NUMBERS, *[c_int64] * WORDS)
    return ctypes.CFUNCTYPE(None, *fixed, *[c_int64] * (WORDS if IN_ROW else 0))


def logger(sink: Sink, final: bool) -> Any:
    """Return the callback that gives status and text of each message to `sink`.

    Parameters
    ----------
    final : messages are no formats: those of pythonfmu come as they are, ``100 %`` and all
    """

    def log(_environment: int, _name: bytes, status: int, _category: bytes, message: bytes, *arguments: Any) -> None:
        text = (message or b"").decode("utf-8", "replace")
        sink(status, (text if final or not arguments else formatted(text, arguments)).strip())

    return logger_type()(log)


def formatted(text: str, arguments: Sequence[float]) -> str:
    """Return a format with its arguments put in; a directive that there is no sound argument for stays as it is."""
    numbers = iter(arguments[:NUMBERS] if APART else ())
    words = iter(arguments[NUMBERS:] if APART else arguments)

    def filled(found: re.Match[str]) -> str:
        kind = found["kind"]
        if kind == "%":
            return "%"
        value = _float(numbers, words) if kind in "eEfFgGaA" else next(words, None)
        shown = None if value is None else _shown(found, value)
        return found[0] if shown is None else shown

    return DIRECTIVE.sub(filled, text)


def _float(numbers: Iterator[float], words: Iterator[float]) -> float | None:
    """Return the next floating-point argument."""
    if APART:
        return next(numbers, None)
    word = next(words, None)
    return None if word is None else struct.unpack("d", struct.pack("q", int(word)))[0]


def _shown(found: re.Match[str], value: float) -> str | None:
    """Return one argument as its directive says; None where there is no text at its address."""
    kind, form = found["kind"], f"%{found['flags']}{found['width']}{found['point'] or ''}"
    if kind == "s":
        text = _text_at(int(value))
        return None if text is None else (form + "s") % text
    if kind == "c":
        return (f"%{found['flags']}{found['width']}c") % chr(int(value) & 0xFF)
    if kind == "p":
        return hex(int(value) & 0xFFFFFFFFFFFFFFFF)
    if kind in "aA":
        return float(value).hex()
    if kind in "eEfFgG":
        return (form + kind) % value
    return (form + kind) % _whole(int(value), found["length"], kind in "di")


def _whole(word: int, length: str | None, signed: bool) -> int:
    """Return the argument of a length modifier: the upper half of a register means nothing to an ``int``."""
    bits = 64 if length in ("l", "ll", "z", "j", "t") and not (length == "l" and sys.platform == "win32") else 32
    word &= (1 << bits) - 1
    return word - (1 << bits) if signed and word >> (bits - 1) else word


def _text_at(address: int) -> str | None:
    """Return the text at an address; None where it cannot be read, or is no text."""
    if address == 0:
        return "(null)"
    data = _bytes_at(address & 0xFFFFFFFFFFFFFFFF)
    if data is None or b"\0" not in data:
        return None
    try:
        return data[: data.index(b"\0")].decode("utf-8")
    except UnicodeDecodeError:
        return None


def _bytes_at(address: int) -> bytes | None:
    """Return what stands in memory at an address, up to the end of what can be read; None where nothing can."""
    if os.name != "posix":
        return None  # no way to ask: better no text than a crash
    out, into = os.pipe()
    found = b""
    try:
        while len(found) < LONGEST and b"\0" not in found:
            here = address + len(found)
            # the system reads for us: where there is no memory it says so instead of ending the process
            written = _LIBC.write(into, c_void_p(here), ctypes.c_size_t(PAGE - here % PAGE))
            if written <= 0:
                return found or None
            found += os.read(out, written)
        return found
    finally:
        os.close(out)
        os.close(into)


PAGE = 4096
"""Bytes that are read at once, within one page of memory; a pipe holds as much."""
_LIBC: Any = ctypes.CDLL(None) if os.name == "posix" else None
