"""Natural frequencies and damping ratios about the equilibrium, out of the vertical plane and in it.

Three references. (1) Rayleigh–Ritz with polynomials on the second variation of the energy about the boundary-value
solution (`verification/cable/beam.py`): the same mechanics, another method. (2) Irvine & Caughey 1974: a parabolic
cable of small sag without bending stiffness; in plane, symmetric, tan(Ω/2) = Ω/2 - 4/λ² (Ω/2)³, λ² = (wL/H)² EA
L/(H L_e), L_e = L (1 + (wL/H)²/8). It neglects terms of the square of the sag ratio: λ² = 24 is kept while the sag
falls, and the difference must vanish with that square. (3) The tensioned beam, f_n = n/(2L) √(T/ρA) √(1 + n²π²
EI/(T L²)), with Kelvin–Voigt damping ratio c EI β⁴/(2 ρA ω), β = nπ/L, as the tension is not damped; out of plane,
where sag acts by its square only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import root_scalar

from orchestrator.landing.modes import CableModes, modes
from orchestrator.report.modes import picture
from orchestrator.runs.modes import shapes
from verification.cable import beam as reference
from verification.cable.setups import PHYSICAL, RIG, TABLE1, Settings, beam, cable
from verification.study import Result, Row, observed_order

TITLE = "Natural frequencies and damping"
COUNT = 6


def ritz_rows(name: str, settings: Settings, n_elements: int, tolerance: float) -> list[Row]:
    """Return the first frequencies out of plane and in plane beside those of the polynomials."""
    found = modes(cable(settings, n_elements=n_elements), COUNT)
    shape = reference.equilibrium(beam(settings), float(settings["span"]), 0.0, False)
    result = []
    groups = (("out of plane", found.out_of_plane), ("in plane", found.in_plane))
    for (words, group), wanted in zip(groups, reference.frequencies(shape, COUNT), strict=True):
        for k, (f, expected) in enumerate(zip(group.frequency, wanted, strict=True)):
            label = f"{name}, {n_elements} elements: {words}, mode {k + 1}, Hz"
            result.append(Row(label, float(f), float(expected), "Rayleigh–Ritz, polynomials", tolerance))
    return result


def irvine(settings: Settings, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) by Irvine & Caughey: out of plane, in plane (symmetric and antisymmetric, sorted)."""
    length, density = float(settings["span"]), float(settings["linear_density"])
    ea, weight = float(settings["axial_stiffness"]), density * 9.8 * length
    h = reference.catenary(beam(settings, green_lagrange=False), length, 0.0, np.array([]))[0]
    parameter = (weight / h) ** 2 * ea / (h * (1.0 + (weight / h) ** 2 / 8.0))
    unit = np.sqrt(h / density) / length

    def symmetric(k: int) -> float:
        low, high = (2 * k + 1e-9) * np.pi / 2.0, (2 * k + 1.0 - 1e-9) * np.pi / 2.0
        bracket = (low + np.pi / 2, high + np.pi / 2)
        x = root_scalar(lambda x: np.sin(x) - np.cos(x) * (x - 4.0 / parameter * x**3), bracket=bracket).root
        return float(x * unit / np.pi)

    string = np.arange(1, count + 1) * unit / 2.0
    return string, np.sort(np.concatenate([[symmetric(k) for k in range(count)], string[1::2]]))[:count]


def flatter(factor: float) -> Settings:
    """Return `table1` without bending stiffness, its sag divided by `factor` at the same λ² = 24."""
    # H³ = EA W²/24 for an unstretched length equal to the span: H grows by the factor when EA grows by its cube
    return TABLE1 | {"bending_stiffness": 1e-3, "axial_stiffness": 8.12e7 * factor**3}


def irvine_rows(n_elements: int = 120) -> list[Row]:
    """Return how far we are from Irvine's frequencies at a sag of 1/1600 of the span, and the rate of that."""
    factors, result = (4.0, 8.0, 16.0), []
    series = [_beside_irvine(factor, n_elements) for factor in factors]
    for label, f, expected in series[-1]:
        name = f"λ² = 24, sag 1/{99 * factors[-1]:.0f}: {label}, Hz"
        result.append(Row(name, f, expected, "Irvine & Caughey 1974", 1e-4))
    differences = [max(abs(f / expected - 1.0) for _, f, expected in group) for group in series]
    order = -observed_order(factors, differences)
    name = "order in the sag of the difference from Irvine"
    return [*result, Row(name, order, 2.0, "neglected terms", 0.2, relative=False)]


def _beside_irvine(factor: float, n_elements: int, count: int = 4) -> list[tuple[str, float, float]]:
    """Return name, computed and expected frequency of the modes of a cable whose sag is smaller by `factor`."""
    settings = flatter(factor)
    found = modes(cable(settings, n_elements=n_elements), count)
    groups = zip(
        ("out of plane", "in plane"), (found.out_of_plane, found.in_plane), irvine(settings, count), strict=True
    )
    return [
        (f"{words}, mode {k + 1}", float(group.frequency[k]), float(wanted[k]))
        for words, group, wanted in groups
        for k in range(count)
    ]


def direct_irvine_rows() -> list[Row]:
    """Return `table1` itself beside Irvine's frequencies; the tolerance is the neglected (wL/H)²/8."""
    found, (out, plane) = modes(cable(TABLE1, n_elements=40), COUNT), irvine(TABLE1, COUNT)
    neglected = (0.91 * 9.8 * 200.0 / 22075.0) ** 2 / 8.0
    groups = (("out of plane", found.out_of_plane.frequency, out), ("in plane", found.in_plane.frequency, plane))
    return [
        Row(f"table1: {words}, mode {k + 1}, Hz", float(group[k]), float(wanted[k]), "Irvine & Caughey 1974", neglected)
        for words, group, wanted in groups
        for k in range(2)
    ]


def tensioned_beam(settings: Settings, tension: float, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) and damping ratios (damping time 1 s) of the tensioned beam of length `span`."""
    ei, density = float(settings["bending_stiffness"]), float(settings["linear_density"])
    beta = n * np.pi / float(settings["span"])
    omega = np.sqrt((tension * beta**2 + ei * beta**4) / density)
    return omega / (2.0 * np.pi), ei * beta**4 / (2.0 * density * omega)


def beam_rows(n_elements: int = 80) -> list[Row]:
    """Return frequencies and damping ratios of the rig, out of plane."""
    settings = RIG | {"damping_time": 0.005}
    made = cable(settings, n_elements=n_elements)
    found = modes(made, COUNT).out_of_plane
    frequency, ratio = tensioned_beam(settings, abs(made["reaction_left.y"]), np.arange(1, COUNT + 1))
    result = []
    for k in range(COUNT):
        source = "tensioned beam"
        result.append(Row(f"rig, out of plane, mode {k + 1}, Hz", found.frequency[k], frequency[k], source, 1e-4))
        wanted = 0.005 * ratio[k]
        result.append(
            Row(f"rig, out of plane, mode {k + 1}: damping ratio", found.damping_ratio[k], wanted, source, 1e-3)
        )
    return result


def run(figures: Path) -> Result:
    """Compare all, draw the modes of `table1`."""
    found = ritz_rows("table1", TABLE1, 120, 1e-6) + ritz_rows("table1", TABLE1, 20, 1e-4)
    found += ritz_rows("physical", PHYSICAL, 120, 1e-6) + ritz_rows("rig", RIG, 120, 1e-6)
    found += direct_irvine_rows() + irvine_rows() + beam_rows()
    shown: CableModes = modes(cable(TABLE1, n_elements=40), COUNT)
    picture(figures / "cable_modes.png", shapes(shown))
    return Result(found, [("cable_modes.png", "Modes of table1 about its equilibrium")])
