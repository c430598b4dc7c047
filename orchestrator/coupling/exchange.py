"""What crosses an interface within a macro step."""

from __future__ import annotations

import re

import numpy as np


def suffixed(name: str, suffix: str) -> str:
    """Return ``force_rate.x`` for ``force.x`` and ``_rate``: the suffix goes before the axis."""
    stem, axis = re.fullmatch(r"(.*?)(\.[xyz])?", name).groups()  # type: ignore[union-attr]
    return f"{stem}{suffix}{axis or ''}"


def vectors(names: list[str]) -> np.ndarray:
    """Return for each name the number of the vector it is a component of, (len(names),) int: x, y, z have one."""
    number = {stem: i for i, stem in enumerate(stems(names))}
    return np.array([number[_stem(name)] for name in names], dtype=np.intp)


def stems(names: list[str]) -> list[str]:
    """Return the names of those vectors, in the order of their numbers: without the axis."""
    return list(dict.fromkeys(map(_stem, names)))


def _stem(name: str) -> str:
    return re.sub(r"\.[xyz]$", "", name)
