"""Which signals a page holds, and how long runs are thinned to keep it small."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from orchestrator.coupling.run.results import Table
from orchestrator.report.page.blob import Blob, pack
from orchestrator.report.page.line import FRAME, line_of

SEEN = re.compile(
    r"robot\.(body\.position\.[xyz]|body\.angular_velocity\.[xyz]|roll|pitch|yaw|thrust|torque\.[xyz])"
    r"|robot\.wheel\[\d+\]\.(position|axle|angular_velocity)\.[xyz]"
    r"|contact\d+\.(normal_force|normal_force_max|radial_force|friction_force|penetration|slip_velocity|status|cable\.s)"
    r"|contact\d+\.(wheel|cable)\.force\.[xyz]"
    r"|cable\.port\[\d+\]\.(position|tangent)\.[xyz]"
    r"|cable\.tension_(left|mid|right)"
)
"""What is drawn of a landing, or judged."""


TRIED = 400_000
"""Points that are packed at most; what is longer has no place in a page, and took half a gigabyte to find that out."""
NO_ARRAYS: Mapping[str, np.ndarray] = MappingProxyType({})


@dataclass(frozen=True)
class Source:
    """A run whose signals go into a page.

    Attributes
    ----------
    prefix : of its arrays
    names : of the signals that are plotted; with `full` all that is drawn or judged goes with them
    """

    prefix: str
    table: Table
    fields: Mapping[str, np.ndarray]
    names: tuple[str, ...]
    full: bool = True


@dataclass(frozen=True)
class Packed:
    """The arrays of a page: `stride` 1 if all communication points are there, and `points` how many there were."""

    blob: Blob
    stride: int
    points: int

    @property
    def note(self) -> str:
        """Say what was left out; empty if nothing was."""
        if self.stride == 1:
            return ""
        return (
            f"To keep this page small, curves and replay show one in {self.stride} of {self.points} communication points, "
            f"together with all extremes, and a shape of the line every {1e3 * FRAME * self.stride:.0f} ms. "
            "Verdict and tables are of all points; results.csv has them."
        )


def pack_within(sources: Iterable[Source], most: int, others: Mapping[str, np.ndarray] = NO_ARRAYS) -> Packed:
    """Pack the signals of all `sources` into at most `most` characters, with as many of their points as that allows.

    Parameters
    ----------
    others : arrays that are packed as they are
    """
    sources, stride = list(sources), 1
    points = max((len(source.table["time"]) for source in sources), default=0)
    while points / stride > TRIED:
        stride *= 2
    blob = _packed(sources, stride, others)
    while len(blob.text) > most and stride < points:
        stride *= 2 ** max(1, int(np.log2(len(blob.text) / most)))
        blob = _packed(sources, stride, others)
    return Packed(blob, stride, points)


def _packed(sources: Iterable[Source], stride: int, others: Mapping[str, np.ndarray]) -> Blob:
    arrays = dict(others)
    for source in sources:
        arrays.update(_arrays(source, stride))
    return pack(arrays)


def _arrays(source: Source, stride: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of a run; of the thinned, the points at which a plotted signal is largest or smallest stay."""
    rows = _rows(source, stride)
    yield f"{source.prefix}time", np.asarray(source.table["time"], float)[rows]
    for name in _chosen(source):
        yield f"{source.prefix}{name}", np.asarray(source.table[name], np.float32)[rows]
    line = line_of(source.fields, FRAME * stride) if source.full else None
    if line is not None:
        yield from line.arrays(source.prefix).items()


def _chosen(source: Source) -> list[str]:
    plotted = set(source.names)
    return [n for n in source.table if n != "time" and (n in plotted or (source.full and SEEN.fullmatch(n)))]


def _rows(source: Source, stride: int) -> np.ndarray:
    n = len(source.table["time"])
    if stride == 1:
        return np.arange(n)
    values = (source.table[name] for name in source.names if name in source.table)  # one at a time: they may be long
    extremes = [row for one in values for row in (int(np.argmin(one)), int(np.argmax(one)))]
    return np.unique([*range(0, n, stride), n - 1, *extremes])
