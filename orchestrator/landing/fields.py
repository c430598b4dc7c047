"""What is made of the signals of a landing: shape and tension of the cable, balance of the interfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np

from fmus.cable.mesh import spread
from fmus.cable.module import N_NODES, N_SHAPE
from orchestrator.coupling.run.columns import Columns

IN_MEMORY = 2**24
"""Bytes of fields that are made of a table that is on disk."""
SHAPES = ("cable.shape[", "cable.node[")
"""Begin the names of signals that are fields, and no columns of a table."""


def cable_fields(
    table: Mapping[str, np.ndarray], length: float, nodes: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Return shape and tension of the cable over time from its signals; empty if it does not show them.

    Parameters
    ----------
    table : signals over time
    length : unstretched length of the cable, m
    nodes : (k,) arc lengths of its mesh's nodes, m; None of a foreign cable

    Returns
    -------
    time (n,) s, arc_length (m,) m, position (n, m, 3) m, tension (n, m) N; of our own cable also node_arc_length (j,) m,
    node_position (n, j, 3) m and node_slope (n, j, 3), dr/ds: the line is cubic between the nodes (Hermite).

    Of a long run, whose table is on disk, these are at every k-th of its N times, and tension_max (N,) N is the largest
    tension along the line at all of them.
    """
    if "cable.shape[1].position.x" not in table:
        return {}
    if isinstance(table, Columns):
        few = _thinned(table)
        fields = cable_fields(few, length, nodes)
        if len(few["time"]) < len(table.rows):
            tensions = (table[f"cable.shape[{i}].tension"] for i in range(1, N_SHAPE + 1))
            fields["tension_max"] = reduce(np.maximum, tensions)
        return fields
    shape = [f"cable.shape[{i}]" for i in range(1, N_SHAPE + 1)]
    return {
        "time": np.asarray(table["time"]),
        "arc_length": np.linspace(0.0, length, N_SHAPE),
        "position": _vectors(table, [f"{point}.position" for point in shape]),
        "tension": np.stack([table[f"{point}.tension"] for point in shape], axis=1),
        **(_nodes(table, nodes) if nodes is not None and "cable.node[1].slope.x" in table else {}),
    }


def tension_of(fields: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the tension along the line at all times (n, m) N, of a long run the largest (n,); None where it is not known."""
    return fields.get("tension_max", fields.get("tension"))


def _thinned(table: Columns) -> dict[str, np.ndarray]:
    """Return what fields are made of at so few times that they have a place in memory."""
    names = ["time", *(name for name in table if name.startswith(SHAPES))]
    step = -(-len(table.rows) * len(names) * 8 // IN_MEMORY)
    return {name: table[name][::step].copy() for name in names}


def _nodes(table: Mapping[str, np.ndarray], nodes: np.ndarray) -> dict[str, np.ndarray]:
    shown = nodes[spread(nodes.size, N_NODES)]
    names = [f"cable.node[{i}]" for i in range(1, shown.size + 1)]
    return {
        "node_arc_length": shown,
        "node_position": _vectors(table, [f"{name}.position" for name in names]),
        "node_slope": _vectors(table, [f"{name}.slope" for name in names]),
    }


def _vectors(table: Mapping[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    """Return vectors over time (n, len(names), 3)."""
    return np.stack([np.stack([table[f"{name}.{axis}"] for axis in "xyz"], axis=-1) for name in names], axis=1)


def interface_balance(table: Mapping[str, np.ndarray], booked: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Return for every contact how well the energies on both sides of its two interfaces agree.

    Parameters
    ----------
    table : signals over time
    booked : load (``robot.wheel[1].force``) → work done through it over time, J; serves where an FMU books none itself

    Returns
    -------
    contact → `exchanged_J`, the energy that went to and fro on cable and wheel; `cable_residual_J`,
    `wheel_residual_J`, the largest difference between the work that component and contact have booked;
    `law_residual_J`, the largest difference between the contact's work and what it stores and dissipates;
    `relative`, the largest of the three by the energy exchanged
    """
    contacts = sorted(name.removesuffix(".work_cable") for name in table if name.endswith(".work_cable"))
    return {contact: _balance(table, booked, contact) for contact in contacts}


def _balance(table: Mapping[str, np.ndarray], booked: Mapping[str, np.ndarray], contact: str) -> dict[str, float]:
    k = contact.removeprefix("contact")
    work = {side: table[f"{contact}.work_{side}"] for side in ("cable", "wheel")}
    residuals = {}
    for side, port in (("cable", f"cable.port[{k}]"), ("wheel", f"robot.wheel[{k}]")):
        theirs = table.get(f"{port}.work")
        if theirs is None:
            theirs = sum((values for name, values in booked.items() if name.startswith(f"{port}.")), np.zeros(1))
        residuals[f"{side}_residual_J"] = float(np.max(np.abs(theirs - work[side])))
    kept = table[f"{contact}.strain_energy"] + table[f"{contact}.dissipated_energy"]
    law = work["cable"] + work["wheel"] + kept
    residuals["law_residual_J"] = float(np.max(np.abs(law - law[0])))
    exchanged = float(sum(np.sum(np.abs(np.diff(values))) for values in work.values()))
    largest = max(residuals.values())
    return {"exchanged_J": exchanged, **residuals, "relative": largest / exchanged if exchanged else largest}
