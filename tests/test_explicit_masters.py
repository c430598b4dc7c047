"""The explicit masters, and what is advised where a state cannot be saved.

Held against other engines, a loop over FMPy alone, closed forms, and the landing's reference.
"""

from __future__ import annotations

import fmpy
import numpy as np
import pytest

import orchestrator
from orchestrator.catalogue.library import robot_fmu
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.coupling.errors import FORWARD, InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.landing import monolithic
from orchestrator.runs.components import opened
from orchestrator.runs.result import CHATTER, HELD, SLOW, Run
from orchestrator.runs.systems import resolve
from tests.engines import ENGINES, by_engine
from tests.fmi import Instance
from tests.fmus import build, compiled, described, fmu, needs_compiler
from tests.scenarios import LANDING, scenario
from tests.systems import closing

H, N = 0.01, 50
ROUND_OFF = 1e-15 * N
"""Of N sums of numbers near one, whose order of operations is another."""


def turning(master: str) -> np.ndarray:
    """p' = q, q' = -p from (1, 0) by one of our masters, (N, 2)."""
    p, q = Fmu(compiled("lag2"), "p"), Fmu(compiled("lag2"), "q")
    p.set_parameters({"start": 1.0})
    q.set_parameters({"gain": -1.0})
    with closing(Graph({"p": p, "q": q}, ["p.y -> q.u", "q.y -> p.u"], order=("p", "q"))) as graph:
        return simulate(graph, master, 0.0, N * H, H).values[1:]


@needs_compiler
@pytest.mark.parametrize("engine", list(ENGINES))
def test_jacobi_is_that_of_other_engines(engine):
    """All step, then all outputs move: the same where no output depends on an input without a step."""
    theirs = by_engine(engine, compiled("lag2"), H, N)
    np.testing.assert_allclose(turning("jacobi"), theirs, rtol=0.0, atol=ROUND_OFF)


@needs_compiler
@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel"])
def test_explicit_masters_have_their_closed_form(master):
    """z ← (1 + H A) z of the held inputs; one after the other it is the symplectic Euler method."""
    first = np.array([[1.0, H], [-H, 1.0]])
    after = np.array([[1.0, H], [-H, 1.0 - H * H]])
    matrix, z = first if master == "jacobi" else after, np.array([1.0, 0.0])
    for found in turning(master):
        z = matrix @ z
        np.testing.assert_allclose(found, z, rtol=0.0, atol=ROUND_OFF)


# -- a loop with an output that depends on inputs without a step ---------------------------------------------------

MASSES = {
    "a": {"mass": 1.0, "ground_stiffness": 10.0, "initial_position": 0.1},
    "b": {"mass": 2.0, "ground_stiffness": 30.0, "stiffness": 50.0, "damping": 0.5},
}
MOTION = [("a", "position", "b", "left.position"), ("a", "velocity", "b", "left.velocity")]
FORCE = [("b", "left.force", "a", "force")]
"""The force follows from the motion without a step."""


def by_fmpy(folder, master: str) -> np.ndarray:
    """Two masses, the second one on a spring to the first, by a loop over FMPy; as docs/concepts/masters.md has it, (N, 2)."""
    unzipped = fmpy.extract(str(build("link")), str(folder))
    parts = {name: Instance(unzipped, **parameters).initialize() for name, parameters in MASSES.items()}

    def move(connections) -> None:
        for giver, output, taker, variable in connections:
            parts[taker].set(**{variable: parts[giver].get(output)})

    move(MOTION + FORCE)
    rows = []
    for n in range(N):
        parts["a"].fmu.doStep(n * H, H)
        if master == "gauss_seidel":
            move(MOTION)
        parts["b"].fmu.doStep(n * H, H)
        move(MOTION + FORCE)
        rows.append([part.get("position") for part in parts.values()])
    for part in parts.values():
        part.fmu.freeInstance()
    return np.array(rows)


@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel"])
def test_explicit_masters_are_what_the_documentation_says(tmp_path, master):
    parts = {name: fmu("link", name, **parameters) for name, parameters in MASSES.items()}
    connections = [Connection(f"{a}.{x}", f"{b}.{u}") for a, x, b, u in MOTION + FORCE]
    with closing(Graph(parts, connections, order=("a", "b"))) as graph:
        ours = simulate(graph, master, 0.0, N * H, H, ["a.position", "b.position"]).values[1:]
    np.testing.assert_allclose(ours, by_fmpy(tmp_path, master), rtol=0.0, atol=ROUND_OFF)


# -- the landing --------------------------------------------------------------------------------------------------

SIGNALS = ["robot.body.position.z", "robot.roll"]


@pytest.fixture(scope="module")
def reference():
    """The landing's first 0.3 s by the monolithic solver: its own error is below 1e-7 of the range (docs/verification.md)."""
    system = resolve(scenario(stop=0.3, macro_step=0.0005))
    return monolithic.solve(system.problem(), 0.0005 * np.arange(601)).signals


def errors(master: str, reference, order: tuple[str, ...] = ()) -> np.ndarray:
    """Largest errors of `SIGNALS`, by their range."""
    with opened(resolve(scenario(stop=0.3, macro_step=0.0005, master=master))) as graph:
        again = Graph(graph.components, graph.connections, order=order or graph.order)
        log = simulate(again, MASTERS[master], 0.0, 0.3, 0.0005, SIGNALS)
    log.raise_error()
    exact = np.array([reference[name] for name in SIGNALS]).T
    return np.max(np.abs(log.values - exact), axis=0) / np.ptp(exact, axis=0)


def test_explicit_masters_land_equally_well_in_any_order(reference):
    """Cable and robot get the same held force each time, that of the motion at the communication point; only what the contact
    remembers of its step may be one step older, 1/600 of the run. A contact that is shown the motion of another point than
    it counts from has twice the error in roll by then."""
    jacobi, gauss_seidel = errors("jacobi", reference), errors("gauss_seidel", reference)
    contact_first = errors("gauss_seidel", reference, ("contact1", "cable", "robot"))
    assert np.all(jacobi < 1e-3)
    np.testing.assert_allclose(jacobi, gauss_seidel, rtol=0.1)
    np.testing.assert_allclose(contact_first, gauss_seidel, rtol=0.1)


# -- what is advised ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def forgetful(tmp_path_factory):
    """The catalogue's robot as an FMU that cannot save its state."""
    flag = ('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')
    return described(robot_fmu(load_robot("fptlir")), tmp_path_factory.mktemp("robot"), flag)


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian"])
def test_a_robot_that_cannot_save_its_state_is_told_what_works(forgetful, master):
    with pytest.raises(InputError) as told:
        orchestrator.run(LANDING, robot=str(forgetful), master=master, stop=0.3, macro_step=0.001)
    assert f"robot cannot save its state (canGetAndSetFMUstate is false); {FORWARD}" in str(told.value)


def test_what_is_told_works(forgetful, reference):
    """gauss_seidel at 1 ms: on the line, no drift of energy, z within the scenario's own tolerance."""
    run = orchestrator.run(
        LANDING, robot=str(forgetful), master="gauss_seidel", stop=0.3, macro_step=0.001, estimate="none"
    )
    assert run.verdict == "within" and run.warnings == []
    exact = reference["robot.body.position.z"][::2]
    z = run["robot.body.position.z"].values
    assert np.max(np.abs(z - exact)) / np.ptp(exact) < run.tolerances["robot.body.position.z"]


def test_advice_names_masters_that_there_are():
    """Those that iterate well get none but a smaller step."""
    assert {*SLOW, *HELD, *CHATTER} == set(MASTERS) - {"iqn_ils", "interface_jacobian"}
    for master, said in (
        ("gauss_seidel", ", or iqn_ils if every FMU can save its state"),
        ("nepce", f", or {FORWARD}"),
        ("aitken", ", or iqn_ils"),
        ("iqn_ils", ""),
    ):
        assert Run({}, {}, {}, {"master": master}, {})._other_master() == said
