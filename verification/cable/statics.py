"""Sag, support force and slope of the cable at rest, beside an independent boundary-value solution.

The reference (`verification/cable/beam.py`) is the extensible beam-cable as a boundary-value problem, solved by
`scipy.integrate.solve_bvp` to a relative residual of 1e-9; it shares no code with the element. Dead loads of 38 kg
stand at midspan or at a tenth of the span. Where the mesh is converged (120 elements graded 1:100) everything must
agree within 1e-5; the recommended mesh (30 elements graded 1:30, refined where the load stands) must within 1e-3
under a point load and within 1e-4 without one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from orchestrator.report.style import COLOURS, MARKERS, STYLE
from verification.cable import beam as reference
from verification.cable.setups import (
    PHYSICAL,
    RIG,
    ROBOT_WEIGHT,
    TABLE1,
    Settings,
    beam,
    loaded_equilibrium,
    point,
    support_forces,
)
from verification.study import Result, Row, observed_order

TITLE = "Static equilibrium"
CABLES = {"table1": TABLE1, "physical": PHYSICAL, "rig": RIG}
CONVERGED = {"n_elements": 120, "grading": 100.0}
RECOMMENDED = {"n_elements": 30, "grading": 30.0}


@dataclass(frozen=True)
class Case:
    """A cable, how it is held, and where a load stands (share of the length; 0: none)."""

    name: str
    clamped: bool = False
    inclined: bool = False
    load_at: float = 0.0

    @property
    def settings(self) -> Settings:
        plain = CABLES[self.name]
        return plain | {"unstretched_length": float(np.hypot(float(plain["span"]), self.level))}

    @property
    def level(self) -> float:
        return 0.1 * float(CABLES[self.name]["span"]) if self.inclined else 0.0

    @property
    def loads(self) -> tuple[tuple[float, float], ...]:
        return ((self.load_at * float(self.settings["unstretched_length"]), ROBOT_WEIGHT),) if self.load_at else ()

    @property
    def words(self) -> str:
        held = "clamped" if self.clamped else "pinned"
        where = {0.0: "", 0.5: ", 38 kg at midspan", 0.1: ", 38 kg at 1/10 span"}[self.load_at]
        return f"{self.name}, {held}, {'inclined 1:10' if self.inclined else 'level'}{where}"


CASES = [
    Case(name, clamped, inclined, load)
    for name in CABLES
    for clamped in (False, True)
    for inclined in (False, True)
    for load in (0.0, 0.5, 0.1)
]


def computed(case: Case, n_elements: int, grading: float) -> tuple[float, float, float]:
    """Return sag (m) under the load or at midspan, left support's force (N), slope (rad) there; in clamps, at 1/4."""
    settings, s = case.settings, _sag_at(case)
    model, q = loaded_equilibrium(
        settings,
        case.loads,
        n_elements=n_elements,
        grading=grading,
        grading_position=s if case.loads else -1.0,
        clamped=case.clamped,
        level_difference=case.level,
    )
    slope = point(model, q, _slope_at(case))
    sag = s / model.s[-1] * case.level - point(model, q, s)[2]
    return sag, float(np.linalg.norm(support_forces(model, q)[0])), float(np.arctan2(slope[5], slope[4]))


def expected(case: Case, green_lagrange: bool = True) -> tuple[float, float, float]:
    """Return the same by the boundary-value problem."""
    settings, s = case.settings, _sag_at(case)
    shape = reference.equilibrium(
        beam(settings, green_lagrange), float(settings["span"]), case.level, case.clamped, case.loads
    )
    sag = s / shape.beam.length * case.level - shape.at(np.array([s]))[1, 0]
    return sag, float(np.hypot(shape.h, shape.v)), float(shape.at(np.array([_slope_at(case)]))[2, 0])


def _sag_at(case: Case) -> float:
    return (case.load_at or 0.5) * float(case.settings["unstretched_length"])


def _slope_at(case: Case) -> float:
    return 0.25 * float(case.settings["unstretched_length"]) if case.clamped else 0.0


def rows(case: Case, mesh: dict[str, float], tolerance: float) -> list[Row]:
    """Return the three quantities of a case on a mesh."""
    found, wanted = computed(case, int(mesh["n_elements"]), mesh["grading"]), expected(case)
    names = ("sag, m", "support force, N", "slope, rad")
    words = f"{case.words}; {mesh['n_elements']:.0f} elements 1:{mesh['grading']:.0f}"
    return [
        Row(f"{words}: {name}", a, b, "beam boundary-value problem", tolerance, relative=name != "slope, rad")
        for name, a, b in zip(names, found, wanted, strict=True)
    ]


def strain_measure_rows() -> list[Row]:
    """Return what Green–Lagrange strain changes against engineering strain, by both methods."""
    case = Case("table1")
    sag, _, _ = computed(case, 120, 100.0)
    return [
        Row(
            "table1, pinned: sag less the sag for engineering strain, m",
            sag - expected(case, green_lagrange=False)[0],
            expected(case)[0] - expected(case, green_lagrange=False)[0],
            "beam boundary-value problem",
            1e-4,
        )
    ]


def catenary_rows() -> list[Row]:
    """Return the cable of vanishing bending stiffness beside the catenary of the same strain measure."""
    found = []
    for inclined in (False, True):
        case = Case("table1", inclined=inclined)
        settings = case.settings | {"bending_stiffness": 1e-3}
        model, q = loaded_equilibrium(settings, n_elements=40, level_difference=case.level)
        s = 0.5 * model.s[-1]
        h, v, middle = reference.catenary(beam(settings), 200.0, case.level, np.array([s]))
        words = f"EI = 1e-3 N m², {'inclined' if inclined else 'level'}, 40 equal elements"
        source = "elastic catenary (Irvine 1981, with Green–Lagrange strain), quadrature"
        found.append(
            Row(
                f"{words}: sag, m",
                0.5 * case.level - point(model, q, s)[2],
                0.5 * case.level - middle[1, 0],
                source,
                1e-6,
            )
        )
        force = float(np.linalg.norm(support_forces(model, q)[0]))
        found.append(Row(f"{words}: support force, N", force, float(np.hypot(h, v)), source, 1e-6))
    return found


def order_row() -> Row:
    """Return the observed order of the sag in the element length: 4 for cubic elements of a fourth-order problem."""
    case, counts = Case("rig", clamped=True), (20, 40, 80)
    reference_sag = expected(case)[0]
    errors = [abs(computed(case, n, 1.0)[0] - reference_sag) for n in counts]
    order = observed_order([1.0 / n for n in counts], errors)
    source = "2 (p + 1 - m), p = 3, m = 2 (Strang & Fix 1973)"
    return Row("rig, clamped: order of the sag in the element length", order, 4.0, source, 0.2, relative=False)


def run(figures: Path) -> Result:
    """Run all cases on the converged mesh, the recommended mesh where it matters, and draw the convergence."""
    found = [row for case in CASES for row in rows(case, CONVERGED, 1e-5)]
    for case in CASES:
        if case.name == "table1" and not case.inclined:
            found += rows(case, RECOMMENDED, 1e-3 if case.load_at else 1e-4)
    found += [*strain_measure_rows(), *catenary_rows(), order_row()]
    _draw(figures / "cable_statics.png")
    caption = "Error of the sag against the number of elements, table1, 200 m: equal and graded meshes"
    return Result(
        found,
        [("cable_statics.png", caption)],
        """Green–Lagrange strain makes the cable stiffer in tension by 3/2 of the strain: the sag is 0.27 mm smaller
        than for engineering strain. Equal elements of 10 m do not see the bending layer √(EI/H) = 0.55 m: 1 % off in
        clamps, and 0.2–0.6 % under a point load; graded meshes do. Their last 1e-6 goes only with elements of
        √(EI/EA) = 9 mm: until then cubic positions cannot follow the small stretch that bending brings along.""",
    )


def _draw(path: Path) -> None:
    curves = [
        (Case("table1"), 1.0, "pinned, equal"),
        (Case("table1", clamped=True), 1.0, "clamped, equal"),
        (Case("table1", clamped=True), 30.0, "clamped, graded 1:30"),
        (Case("table1", load_at=0.1), 1.0, "pinned, 38 kg at 20 m, equal"),
        (Case("table1", load_at=0.1), 30.0, "pinned, 38 kg at 20 m, graded 1:30"),
    ]
    counts = (20, 30, 40, 60, 80, 120, 160)
    with plt.rc_context(STYLE):
        figure, ax = plt.subplots(figsize=(5.5, 3.4))
        for k, (case, grading, label) in enumerate(curves):
            sag = expected(case)[0]
            errors = [abs(computed(case, n, grading)[0] / sag - 1.0) for n in counts]
            ax.loglog(counts, errors, color=COLOURS[k], marker=MARKERS[k], markersize=4, label=label)
        ax.set_xticks(counts, [str(n) for n in counts])
        ax.minorticks_off()
        ax.set_xlabel("Number of elements")
        ax.set_ylabel("Relative error of the sag")
        ax.legend(fontsize=7)
        figure.savefig(path)
        plt.close(figure)
