"""The arrays of a page: one binary block, compressed and in base64, and where each array lies in it."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

Type = Literal["f4", "f8"]
LEVEL = 6
"""Of gzip: 9 takes three times as long and saves one per cent."""


@dataclass(frozen=True)
class Place:
    """Where an array lies: `offset` in bytes, `shape`, and `type`, little-endian."""

    offset: int
    shape: list[int]
    type: Type


@dataclass(frozen=True)
class Blob:
    """Arrays packed: `places` by name, and the `text` to embed."""

    places: dict[str, Place]
    text: str


def pack(arrays: Mapping[str, np.ndarray]) -> Blob:
    """Pack arrays: as float64 those that are float64 already, else as float32; each at a multiple of 8 bytes."""
    places, parts, offset = dict[str, Place](), list[bytes](), 0
    for name, values in arrays.items():
        kind: Type = "f8" if values.dtype == np.float64 else "f4"
        raw = np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()
        places[name] = Place(offset, list(values.shape), kind)
        parts += [raw, bytes(-len(raw) % 8)]
        offset += len(raw) + len(parts[-1])
    return Blob(places, packed(b"".join(parts)))


def packed(content: bytes) -> str:
    """Return `content` compressed, in base64; the same bytes always give the same text."""
    return base64.b64encode(gzip.compress(content, LEVEL, mtime=0)).decode("ascii")


def unpack(places: Mapping[str, Place], text: str) -> dict[str, np.ndarray]:
    """Return the arrays that `pack` has packed."""
    raw = gzip.decompress(base64.b64decode(text))
    return {
        name: np.frombuffer(raw, f"<{p.type}", int(np.prod(p.shape)), p.offset).reshape(p.shape)
        for name, p in places.items()
    }
