"""Other values for a scenario given in Python, written as ``--set`` takes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Set = Mapping[str, Any] | Sequence[str]
"""Other values by their keys; or ``key=value`` in TOML, as on the command line."""


def texts(settings: Set) -> list[str]:
    """Return `settings` as ``key=value`` in TOML."""
    if not isinstance(settings, Mapping):
        return list(settings)
    return [f"{key}={toml(value)}" for key, value in settings.items()]


def toml(value: Any) -> str:
    """Return a value as TOML writes it; NumPy's numbers and arrays too."""
    if isinstance(value, np.ndarray | np.generic):
        return toml(value.tolist())
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return repr(value) if isinstance(value, int | float) else json.dumps(str(value), ensure_ascii=False)
