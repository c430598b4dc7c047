"""The coupling engine alone: two FMUs, three connections, a master, arrays; no scenario, no landing."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from fmus.face.build import ensure_fmu
from fmus.oscillator.oscillator_fmu import RECIPE
from orchestrator.coupling import MASTERS, Connection, Fmu, Graph, simulate

fmu = ensure_fmu(RECIPE, Path(tempfile.mkdtemp()))  # any FMU for co-simulation would do
left, right = Fmu(fmu), Fmu(fmu)
left.set_parameters({"mass": 1.0, "stiffness": 10.0, "initial_position": 1.0})
right.set_parameters({"mass": 1.0, "stiffness": 10.0, "coupling_stiffness": 100.0})
graph = Graph(
    {"left": left, "right": right},
    [
        Connection("left.position", "right.neighbour.position"),
        Connection("left.velocity", "right.neighbour.velocity"),
        Connection("right.neighbour.force", "left.force"),
    ],
)
log = simulate(graph, MASTERS["iqn_ils"](graph), 0.0, 1.0, 0.001)

# the whole is linear: x'' = -K x, and known exactly
K = np.array([[110.0, -100.0], [-100.0, 110.0]])
system = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, np.zeros((2, 2))]])
exact = (expm(system * log.time[-1]) @ [1.0, 0.0, 0.0, 0.0])[0]
error = abs(log.signal("left.position")[-1] - exact)
print(
    f"x(1 s) = {log.signal('left.position')[-1]:.6f}, exact {exact:.6f}, {log.iterations_per_step:.1f} iterations a step"
)
