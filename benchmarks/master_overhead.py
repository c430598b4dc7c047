"""What a master costs beside the FMUs: two trivial FMUs, Jacobi, against a bare loop over FMPy's own calls.

    python -m benchmarks.master_overhead [STEPS]

Printed, in µs a macro step: the whole loop, the time inside doStep, the calls that set and get (made alone, in the same
number), and what is left, which is the master's own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from time import perf_counter

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from orchestrator.fmu import Fmu
from orchestrator.graph import Connection, Graph
from orchestrator.masters import MASTERS
from orchestrator.simulation import simulate
from tests.fmus import build, fmu

H = 1e-3
PAIRS = [("a.position", "b.left.position"), ("a.velocity", "b.left.velocity"), ("b.left.force", "a.force")]


def graph() -> Graph:
    """Return two test FMUs (NumPy inside, 5 µs a step) in a force-displacement loop."""
    a, b = fmu("link", "a", initial_position=0.1), fmu("link", "b", stiffness=10.0)
    return Graph({"a": a, "b": b}, [Connection(*pair) for pair in PAIRS])


def ours(master: str, steps: int) -> tuple[float, float]:
    """Return wall time and time inside doStep, µs a macro step."""
    system = graph()
    record = ["a.position", "b.position"]
    log = simulate(system, MASTERS[master](system), 0.0, (steps + 1) * H, H, record)
    system.close()
    return log.wall / steps * 1e6, sum(log.wall_components.values()) / steps * 1e6


def calls(steps: int) -> float:
    """Return the time that one step's set and get calls take by themselves, µs (4 set, 5 get as in `ours`)."""
    system = graph()
    system.initialize(0.0)
    a, b = system.nodes
    recorded = [Fmu.group(node.fmu, ["position"]) for node in system.nodes]
    sets = [a.inputs.runs[0].set_call, b.inputs.runs[0].set_call, b.inputs.runs[0].set_call]
    gets = [n.outputs.runs[0].get_call for n in (a, b)] + [group.runs[0].get_call for group in recorded]
    wall = timed(lambda: [call() for call in (*sets, *gets)], steps)
    system.close()
    return wall


def timed(function: Callable[[], object], steps: int) -> float:
    """Return the time of one call, µs."""
    clock = perf_counter()
    for _ in range(steps):
        function()
    return (perf_counter() - clock) / steps * 1e6


def bare_fmpy(steps: int) -> float:
    """Return the wall time of the same exchange written with FMPy's lists, µs a macro step."""
    path = str(build("link"))
    description, folder = read_model_description(path), extract(path)
    vr = {v.name: v.valueReference for v in description.modelVariables}
    slaves = []
    for name, start in (("a", {"initial_position": 0.1}), ("b", {"stiffness": 10.0})):
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,  # type: ignore[union-attr]
            instanceName=name,
        )
        slave.instantiate()
        slave.setReal([vr[n] for n in start], list(start.values()))
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slaves.append(slave)
    a, b = slaves
    motion, left = [vr["position"], vr["velocity"]], [vr["left.position"], vr["left.velocity"]]
    t, rows = 0.0, []
    clock = perf_counter()
    for _ in range(steps):
        a.doStep(t, H)
        b.doStep(t, H)
        t += H
        b.setReal(left, a.getReal(motion))
        a.setReal([vr["force"]], b.getReal([vr["left.force"]]))
        rows.append((a.getReal([vr["position"]])[0], b.getReal([vr["position"]])[0]))
    wall = (perf_counter() - clock) / steps * 1e6
    for slave in slaves:
        slave.fmi2FreeInstance(slave.component)
    return wall


def main() -> None:
    """Print the table."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 20000
    inside = calls(steps)
    print(f"{'':22}{'whole':>8}{'doStep':>8}{'set, get':>10}{'master':>8}   µs a macro step")
    for master in ("jacobi", "gauss_seidel", "iqn_ils", "interface_jacobian"):
        wall, steps_alone = ours(master, steps)
        share = f"{inside:10.1f}{wall - steps_alone - inside:8.1f}" if master == "jacobi" else ""
        print(f"{master:22}{wall:8.1f}{steps_alone:8.1f}{share}")
    print(f"{'bare loop, FMPy lists':22}{bare_fmpy(steps):8.1f}")


if __name__ == "__main__":
    main()
