"""Signals of a study that no module shows: made from those that are kept, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from orchestrator.coupling.errors import InputError, nearest

Table = Mapping[str, np.ndarray]
TO_UNIT = {"deg": np.degrees(1.0), "kN": 1e-3, "mm": 1e3, "%": 100.0}
"""What SI values are multiplied by for the units that a claim may be printed in."""


def end_slope(table: Table) -> np.ndarray:
    """Return the slope (rad) of the line at its left support: that of the force there, as a line that hangs from a pin
    bears no moment."""
    return np.arctan2(np.abs(table["cable.reaction_left.z"]), np.abs(table["cable.reaction_left.y"]))


def tension_order(table: Table) -> np.ndarray:
    """Return 1 where the tension rises from each point kept to the next, from midspan to the tower; else 0."""
    points = np.stack([table[name] for name in tensions(table)])
    return np.all(np.diff(points, axis=0) > 0.0, axis=0).astype(float)


def tensions(table: Table) -> list[str]:
    """Return the names of the tensions along the line that are kept, in the order of the points."""
    names = [name for name in table if name.startswith("cable.shape[") and name.endswith("].tension")]
    return sorted(names, key=lambda name: int(name[len("cable.shape[") : name.index("]")]))


DERIVED: dict[str, Callable[[Table], np.ndarray]] = {"cable.end_slope": end_slope, "cable.tension_order": tension_order}
"""Signals made from others, by name."""


def signal(table: Table, name: str) -> np.ndarray:
    """Return a signal that is kept or derived; `InputError` if there is none of that name."""
    if name in DERIVED:
        return DERIVED[name](table)
    if name not in table:
        known = [*table, *DERIVED]
        raise InputError(f"no signal {name!r} is kept{nearest(name, known)}; add it to `signals` in landings.toml")
    return table[name]
