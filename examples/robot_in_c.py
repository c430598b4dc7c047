"""A robot in C, FMI 2.0 and 3.0: what `orchestrator new robot --c` writes, compiled, put on trial, and pushed."""

import subprocess
from pathlib import Path

from orchestrator.catalogue.project import write_project
from orchestrator.coupling import Fmu
from orchestrator.landing.trial.dynamic import put_on_trial

fmus = {}
for kind in ("c", "fmi3"):
    project = write_project(Path(f"robot_{kind}"), kind)
    subprocess.run(["make", "--silent"], cwd=project, check=True)
    fmus[kind] = project / f"{project.name}.fmu"

trials = {kind: put_on_trial(path, "robot") for kind, path in fmus.items()}
for kind, trial in trials.items():
    print(f"{kind}: {len(trial.rows)} findings, {'all pass' if trial.passed else 'some fail'}")

ends = {}  # after a push of 38 N at the wheel for a tenth of a second, in 20 macro steps
for kind, path in fmus.items():
    with Fmu(path) as robot:
        robot.set_parameters({"gravity": 0.0})
        robot.enter_initialization(0.0)
        robot.exit_initialization()
        robot.write("wheel[1].force.y", 38.0)
        for i in range(20):
            robot.step(0.005 * i, 0.005)
        ends[kind] = {name: robot.read(name) for name in ("body.position.y", "body.velocity.y", "roll")}
print(ends)
