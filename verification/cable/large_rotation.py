"""Large rotations: a cantilever under a tip force, and one rolled up by a tip moment.

L = 2 m, E = 2.07e11 Pa, 0.1 m × 0.1 m. Under the dead tip force 3 EI/L² the engineering-strain model gives the tip
displacement (-0.508537304326, -1.207239854550) m; the value for this project's measures, Green–Lagrange strain and
|r_x × r_xx|, follows from the same boundary-value problem by shooting (`verification/cable/beam.py`), which is
checked against the former first.

Under a tip moment M the stretch λ and θ' are constant: ∂W/∂λ = 0 gives λ² (1 + 4 (EI/EA) θ'²) = 1, and M = EI λ⁴
θ'. With M = 2π EI/L a beam that cannot stretch rolls up into a circle; ours turns by θ' L, a little more, by a term
that vanishes with the square of the depth over the radius.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import root_scalar

from orchestrator.report.style import COLOURS, STYLE
from verification.cable.beam import Beam, cantilever
from verification.cable.free_beam import FreeBeam
from verification.study import Result, Row, observed_order

TITLE = "Large rotations"
LENGTH, EA, EI = 2.0, 2.07e11 * 0.1**2, 2.07e11 * 0.1**4 / 12.0
FORCE, MOMENT = 3.0 * EI / LENGTH**2, 2.0 * np.pi * EI / LENGTH
ENGINEERING = (-0.508537304326, -1.207239854550)


def tip(n_elements: int) -> np.ndarray:
    """Return the tip displacement (y, z) under the tip force."""
    q = FreeBeam(LENGTH, EA, EI, n_elements).bend(np.array([0.0, 0.0, -FORCE]), 0.0)
    return q[-5:-3] - [LENGTH, 0.0]


def rolled(n_elements: int, ea: float = EA) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates under the tip moment, and the exact (y, z, turn in rad) of the tip."""
    q = FreeBeam(LENGTH, ea, EI, n_elements).bend(np.zeros(3), MOMENT, steps=40)
    ratio = EI / ea
    bracket = (0.0, 1.5 * MOMENT / EI)
    turn = root_scalar(lambda k: k - MOMENT / EI * (1.0 + 4.0 * ratio * k * k) ** 2, bracket=bracket).root
    stretch = 1.0 / np.sqrt(1.0 + 4.0 * ratio * turn**2)
    angle, radius = turn * LENGTH, stretch / turn
    return q, np.array([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle])


def rows(n_elements: int, tolerance: float) -> list[Row]:
    """Return tip displacements on a mesh."""
    engineering = cantilever(Beam(EA, EI, 1.0, LENGTH, green_lagrange=False), (0.0, -FORCE)) - [LENGTH, 0.0, 0.0]
    wanted = cantilever(Beam(EA, EI, 1.0, LENGTH), (0.0, -FORCE)) - [LENGTH, 0.0, 0.0]
    found, words = tip(n_elements), f"{n_elements} elements"
    result = []
    for k, axis in enumerate("yz"):
        source = "published value of the engineering-strain model"
        result.append(
            Row(f"shooting, engineering strain: tip {axis}, m", engineering[k], ENGINEERING[k], source, 1e-10)
        )
    for k, axis in enumerate("yz"):
        source = "shooting, Green–Lagrange strain"
        result.append(Row(f"cantilever, {words}: tip {axis}, m", found[k], wanted[k], source, tolerance))
    return result


def rolled_rows(n_elements: int, tolerance: float) -> list[Row]:
    """Return where the tip of the rolled beam is, for the thick beam and for one 1e4 times stiffer in tension."""
    result = []
    for words, ea in (("0.1 m deep", EA), ("1 mm deep", 1e4 * EA)):
        q, wanted = rolled(n_elements, ea)
        found = np.array([q[-5], q[-4], np.arctan2(q[-1], q[-2])])
        wanted[2] = np.arctan2(np.sin(wanted[2]), np.cos(wanted[2]))
        for name, a, b in zip(("y, m", "z, m", "turn modulo 2π, rad"), found, wanted, strict=True):
            label = f"rolled up, {words}, {n_elements} elements: {name}"
            result.append(Row(label, a, b, "closed form above", tolerance * LENGTH, relative=False))
    return result


def order_row() -> Row:
    """Return the observed order, in the element length, of where the tip of the rolled beam is."""
    counts, errors = (16, 32, 64), []
    for n in counts:
        q, wanted = rolled(n)
        errors.append(float(np.hypot(q[-5] - wanted[0], q[-4] - wanted[1])))
    order = observed_order([1.0 / n for n in counts], errors)
    return Row("rolled up: order in the element length", order, 4.0, "2 (p + 1 - m), p = 3, m = 2", 0.2, relative=False)


def run(figures: Path) -> Result:
    """Refine both, draw the roll-up."""
    q, _ = rolled(64)
    with plt.rc_context(STYLE):
        figure, ax = plt.subplots(figsize=(5.2, 3.0))
        for share, colour in zip((0.25, 0.5, 0.75), COLOURS, strict=False):
            p = FreeBeam(LENGTH, EA, EI, 32).bend(np.zeros(3), share * MOMENT, steps=20)
            ax.plot(p[1::6], p[2::6], color=colour, label=f"{share:g} · 2πEI/L")
        ax.plot(q[1::6], q[2::6], color="black", label="2πEI/L")
        ax.set_aspect("equal")
        ax.set_xlabel("y, m")
        ax.set_ylabel("z, m")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        figure.savefig(figures / "cable_rollup.png")
        plt.close(figure)
    found = [*rows(64, 1e-8), *rolled_rows(64, 1e-5), order_row()]
    return Result(found, [("cable_rollup.png", "A beam 0.1 m deep rolled up by a tip moment")])
