"""The coupling engine alone: two FMUs, three connections, a master, arrays; no scenario, no landing."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from fmus.face.build import ensure_fmu
from fmus.module.registry import find
from orchestrator.coupling import Fmu, Graph, simulate

file = ensure_fmu(find("oscillator").recipe(), Path(tempfile.mkdtemp()))  # any FMU for co-simulation would do
left, right = Fmu(file), Fmu(file)
left.set_parameters({"mass": 1.0, "stiffness": 10.0, "initial_position": 1.0})
right.set_parameters({"mass": 1.0, "stiffness": 10.0, "coupling_stiffness": 100.0})
connections = [
    "left.position -> right.neighbour.position",
    "left.velocity -> right.neighbour.velocity",
    "right.neighbour.force -> left.force",
]
with Graph({"left": left, "right": right}, connections) as graph:
    log = simulate(graph, "iqn_ils", start=0.0, stop=1.0, macro_step=0.001)
log.raise_error()  # a failed FMU ends the run, and the log says so

# the whole is linear: x'' = -K x, and known exactly
K = np.array([[110.0, -100.0], [-100.0, 110.0]])
system = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, np.zeros((2, 2))]])
exact = np.array([(expm(system * t) @ [1.0, 0.0, 0.0, 0.0])[:2] for t in log.time])
x = np.stack([log.signal("left.position"), log.signal("right.position")], axis=1)
error = np.max(np.abs(x - exact))
print(f"largest error {error:.1e} {log.units['left.position']}, {log.iterations_per_step:.1f} iterations a step")
