"""A picture that fails costs nothing but itself: what was calculated is worth more."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path


def drawn(draw: Callable[[], Iterable[Path]]) -> list[Path]:
    """Return the pictures that `draw` makes, as far as it comes; a warning says what has kept it from the others."""
    found: list[Path] = []
    try:
        found.extend(draw())
    except Exception as error:  # whatever it is, a library that cannot be loaded too
        warnings.warn(f"a picture is missing: {type(error).__name__}: {error}", stacklevel=2)
    return found
