"""What of the flagship is converged to how many digits: mesh, tolerance of the solver, macro step, contact.

The landing at 20 m over 5 s; each row changes one thing and gives the largest difference in Z and in roll over their
peak to peak. The discretisation (mesh, tolerance, macro step) has an exact answer, from which the differences are
taken: 240 elements graded 1:240, a hundredth of the tolerance, the monolithic solution. The contact's stiffness and
its reference length are assumed: their rows show what the assumption is worth, as a difference from the default.
"""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.coupled import run_coupled
from verification.study import Result, Row
from verification.system.setups import monolithic, relative_error, scenario

TITLE = "Convergence of the flagship"
STOP = 5.0
Z, ROLL = "robot.body.position.z", "robot.roll"
MESHES = ((15, 15.0), (30, 30.0), (60, 60.0), (120, 120.0))
MESH_ERROR = 1e-3
"""Wanted of the default mesh, relative; ten times the tightest tolerance of the scenarios."""


def _mesh(n: int, grading: float) -> dict[str, object]:
    return {"cable.parameters.n_elements": n, "cable.parameters.grading": grading}


def run(figures: Path) -> Result:
    default, fine = monolithic(scenario(stop=STOP)), monolithic(scenario(stop=STOP, **_mesh(240, 240.0)))
    table = ["| what is changed | Z [-] | roll [-] | held against |", "|---|---|---|---|"]

    def line(label: str, found, truth, against: str) -> tuple[float, float]:
        errors = relative_error(found, truth, Z), relative_error(found, truth, ROLL)
        table.append(f"| {label} | {errors[0]:.1e} | {errors[1]:.1e} | {against} |")
        return errors

    meshes = {}
    for n, grading in MESHES:
        found = monolithic(scenario(stop=STOP, **_mesh(n, grading)))
        meshes[n] = line(f"{n} elements, graded 1:{grading:g}", found, fine, "240 elements, graded 1:240")
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
        Row("30 elements, graded 1:30: Z [-]", meshes[30][0], 0.0, "240 elements", MESH_ERROR, False),
        Row("60 elements, graded 1:60: Z [-]", meshes[60][0], 0.0, "240 elements", MESH_ERROR / 4, False),
        Row("tolerance 1e-9 m: Z [-]", solver[1e-9][0], 0.0, "1e-11 m", 1e-6, False),
        Row("tolerance 1e-9 m: roll [-]", solver[1e-9][1], 0.0, "1e-11 m", 1e-5, False),
        Row("macro step 5 ms: Z [-]", coupled[0.005][0], 0.0, "monolithic", 5e-6, False),
        Row("macro step 5 ms: roll [-]", coupled[0.005][1], 0.0, "monolithic", 2e-5, False),
        Row("macro step 10 ms: Z [-]", coupled[0.01][0], 0.0, "monolithic", 3e-5, False),
        Row("macro step 10 ms: roll [-]", coupled[0.01][1], 0.0, "monolithic", 5e-4, False),
    ]
    return Result(checks, remark="\n".join(table))
