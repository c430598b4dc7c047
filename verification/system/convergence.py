"""What of the flagship is converged to how many digits: mesh, tolerance of the solver, macro step, contact.

The landing at 20 m over 5 s; each row changes one thing and gives the largest difference in Z and in roll over their
peak to peak. The discretisation (mesh, tolerance, macro step) has an exact answer, from which the differences are
taken: 240 elements as the mesh found by itself places them, a hundredth of the tolerance, the monolithic solution.
The contact's stiffness and its reference length are assumed: their rows show what the assumption is worth, as a
difference from the default.
"""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.coupled import run_coupled
from verification.study import Result, Row
from verification.system.setups import monolithic, relative_error, scenario

TITLE = "Convergence of the flagship"
STOP = 5.0
Z, ROLL = "robot.body.position.z", "robot.roll"
MESHES = ((20, 1.0), (30, 30.0), (60, 60.0), (120, 120.0))
"""Elements and grading, with a fine point where the wheel lands; the paper has 20 equal ones."""
MESH_ERROR = 5e-4
"""Wanted of the default mesh, relative: its `mesh_tolerance`."""
FINE = MESH_ERROR / 1200.0
"""Mesh tolerance of the solution that meshes are held against: 1200^(1/4) = 5.9 times the elements."""


def _mesh(n: int, grading: float) -> dict[str, object]:
    fine = {"cable.parameters.grading_position": 20.0} if grading > 1.0 else {}
    return {"cable.parameters.n_elements": n, "cable.parameters.grading": grading, **fine}


def run(figures: Path) -> Result:
    default, fine = (
        monolithic(scenario(stop=STOP)),
        monolithic(scenario(stop=STOP, **{"cable.parameters.mesh_tolerance": FINE})),
    )
    table = ["| what is changed | Z [-] | roll [-] | held against |", "|---|---|---|---|"]

    def line(label: str, found, truth, against: str) -> tuple[float, float]:
        errors = relative_error(found, truth, Z), relative_error(found, truth, ROLL)
        table.append(f"| {label} | {errors[0]:.1e} | {errors[1]:.1e} | {against} |")
        return errors

    against = "240 elements, found by itself"
    meshes = {0: line("mesh found by itself (42 elements)", default, fine, against)}
    for n, grading in MESHES:
        found = monolithic(scenario(stop=STOP, **_mesh(n, grading)))
        words = f"graded 1:{grading:g}" if grading > 1.0 else "equal"
        meshes[n] = line(f"{n} elements, {words}", found, fine, against)
    exact = monolithic(scenario(stop=STOP), 1e-11)
    solver = {t: line(f"tolerance {t:g} m", monolithic(scenario(stop=STOP), t), exact, "1e-11 m") for t in (1e-8, 1e-9)}
    coupled = {}
    for step in (0.01, 0.005, 0.0025):
        found = run_coupled(scenario(stop=STOP, **{"simulation.macro_step": step}))
        rows = {name: values[:: round(0.01 / step)] for name, values in found.table.items()}
        truth = {name: values[::2] for name, values in exact.items()}
        coupled[step] = line(f"macro step {1e3 * step:g} ms, coupled", rows, truth, "monolithic, 1e-11 m")
    for stiffness in (1e7, 1e9, 1e10):
        found = monolithic(scenario(stop=STOP, **{"contact.parameters.stiffness": stiffness}))
        line(f"contact stiffness {stiffness:g} N/m^2.5", found, default, "1e8 N/m^2.5")
    found = monolithic(scenario(stop=STOP, **{"contact.parameters.reference_length": 0.12}))
    line("reference length of the stiffness 120 mm", found, default, "60 mm")
    checks = [
        Row("mesh found by itself: Z [-]", meshes[0][0], 0.0, "240 elements", MESH_ERROR, False),
        Row("mesh found by itself: roll [-]", meshes[0][1], 0.0, "240 elements", MESH_ERROR, False),
        Row("tolerance 1e-9 m: Z [-]", solver[1e-9][0], 0.0, "1e-11 m", 1e-6, False),
        Row("tolerance 1e-9 m: roll [-]", solver[1e-9][1], 0.0, "1e-11 m", 1e-5, False),
        Row("macro step 5 ms: Z [-]", coupled[0.005][0], 0.0, "monolithic", 5e-6, False),
        Row("macro step 5 ms: roll [-]", coupled[0.005][1], 0.0, "monolithic", 2e-5, False),
        Row("macro step 10 ms: Z [-]", coupled[0.01][0], 0.0, "monolithic", 3e-5, False),
        Row("macro step 10 ms: roll [-]", coupled[0.01][1], 0.0, "monolithic", 5e-4, False),
    ]
    return Result(checks, remark="\n".join(table))
