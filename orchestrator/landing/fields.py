"""What is made of the signals of a landing: shape and tension of the cable, balance of the interfaces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fmus.cable.module import N_SHAPE


def cable_fields(table: Mapping[str, np.ndarray], length: float) -> dict[str, np.ndarray]:
    """Return shape and tension of the cable over time from its signals; empty if it does not show them.

    Parameters
    ----------
    table : signals over time
    length : unstretched length of the cable, m

    Returns
    -------
    time (n,) s, arc_length (m,) m, position (n, m, 3) m, tension (n, m) N
    """
    if "cable.shape[1].position.x" not in table:
        return {}
    points = range(1, N_SHAPE + 1)
    position = np.stack(
        [np.stack([table[f"cable.shape[{i}].position.{axis}"] for axis in "xyz"], axis=-1) for i in points], axis=1
    )
    tension = np.stack([table[f"cable.shape[{i}].tension"] for i in points], axis=1)
    return {
        "time": np.asarray(table["time"]),
        "arc_length": np.linspace(0.0, length, N_SHAPE),
        "position": position,
        "tension": tension,
    }


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
