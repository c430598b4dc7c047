"""Derivatives that FMUs give themselves: of an algebraic loop at the start, of a step, and when they are of no use.

The FMU is a field of three states in C (`tests/fmus/field.h`), x' = A x - cubic x³ + u, y = x + feed u.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.fmu.derivatives import Partials, states
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from orchestrator.coupling.stepping.interpolation import Between, Loads
from orchestrator.coupling.stepping.jacobian import OwnDerivatives
from tests.fmus import MILD, compiled, described, needs_compiler, oscillator, started

pytestmark = [needs_compiler, pytest.mark.portable]

NONE, OVER_STEP, AT_INSTANT, WRONG, NOT_A_NUMBER, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4, 12, 13, 14
A = np.array([[-3.0, 1.0, 0.5], [1.0, -4.0, 1.0], [0.2, 1.0, -2.0]])
FIELDS = ["field2", "field3"]
M = 3


def coupled(path: Path, **parameters: float) -> Graph:
    """The field in a loop with three integrators, p_i' = -y_i, u_i = p_i; the field comes first, its inputs are torn."""
    parts = {"field": Fmu(path, "field"), **{f"p{i}": Fmu(compiled("lag2"), f"p{i}") for i in range(1, M + 1)}}
    parts["field"].set_parameters({"start": 1.0, **parameters})
    pairs = []
    for i in range(1, M + 1):
        parts[f"p{i}"].set_parameters({"gain": -1.0})
        pairs += [(f"field.y[{i}]", f"p{i}.u"), (f"p{i}.y", f"field.u[{i}]")]
    return Graph(parts, [Connection(*pair) for pair in pairs], order=tuple(parts))


def run(graph: Graph, H: float = 0.05) -> tuple[Log, int]:
    """Return the log, and the number of steps the field has made in all."""
    master = MASTERS["interface_jacobian"](graph, tolerance=1e-6)
    log = simulate(graph, master, 0.0, 10 * H, H, [f"field.y[{i}]" for i in range(1, M + 1)])
    graph.close()
    assert log.error is None and log.unconverged == 0
    return log, graph.components["field"].solves


def by_differences(path: Path, folder: Path, **parameters: float) -> tuple[Log, int]:
    """The same run by an FMU that does not offer its derivatives."""
    offer = 'providesDirectionalDerivatives="true"' if path.stem == "field3" else 'providesDirectionalDerivative="true"'
    return run(coupled(described(path, folder, (offer, "")), **parameters))


@pytest.mark.parametrize("field", FIELDS)
def test_partials_of_outputs_and_state_derivatives(field: str):
    """By hand: dy/du = feed I, dy/dx = I, dx'/du = I, dx'/dx = A - 3 cubic x² at x = (2, 0, 0)."""
    fmu = Fmu(compiled(field), "field")
    fmu.set_parameters({"feed": 0.5, "cubic": 0.25, "mode": AT_INSTANT, "start": 2.0})
    started(fmu)
    x, rates = states(fmu)
    elements = [f"[{i}]" for i in range(1, M + 1)]
    partials = Partials(fmu, [f"y{e}" for e in elements] + rates, [f"u{e}" for e in elements] + x)
    eye = np.eye(M)
    expected = np.block([[0.5 * eye, eye], [eye, A - np.diag([3.0, 0.0, 0.0])]])
    assert partials() == pytest.approx(expected, abs=1e-15)
    one = Partials(fmu, [rates[1]], [x[2], x[0]])
    assert one() == pytest.approx(np.array([[1.0, 1.0]]), abs=1e-15)
    fmu.close()


@pytest.mark.parametrize(("mode", "feed"), [(OVER_STEP, 0.0), (AT_INSTANT, 0.0), (AT_INSTANT, 0.5)])
@pytest.mark.parametrize("field", FIELDS)
def test_derivatives_that_foretell_the_step_save_all_differences_but_one(
    field: str, mode: int, feed: float, tmp_path: Path
):
    """Differences take 1 + m steps, derivatives 2: m - 1 saved, once; the results agree to the tolerance."""
    log, solves = run(coupled(compiled(field), mode=mode, feed=feed))
    other, more = by_differences(compiled(field), tmp_path, feed=feed)
    assert more - solves == M - 1
    assert log.values == pytest.approx(other.values, abs=1e-6)


def test_how_inputs_follow_the_unknowns():
    """A load between both ends with a slope of its own: mean (x0 + x1)/2, slope (x1 - x0)/H; by hand."""
    graph = oscillator(**MILD)
    node = graph.nodes[0]
    node.fmu.capabilities = replace(node.fmu.capabilities, directional_derivatives=True)
    between = Between(graph, Loads(graph), torn=True)
    held, ends = OwnDerivatives(graph, between, node)._inputs_of(0.1)
    graph.close()
    assert (node.inputs.names, node.rates.names) == (("force",), ("force_rate",))
    assert held.tolist() == ends.tolist() == [[0.5], [10.0]]


@pytest.mark.parametrize("mode", [NONE, WRONG, NOT_A_NUMBER, DISCARD, ERROR])
@pytest.mark.parametrize("field", FIELDS)
def test_derivatives_of_no_use_leave_the_differences(field: str, mode: int, tmp_path: Path):
    """All zero, twice the negative: one probe too many. No numbers, discard, error: none. The results are the same ones."""
    path = compiled(field)
    if mode == NONE:  # FMUs without feedthrough that do not show their states
        der = '<ContinuousStateDerivative valueReference="4"/>'
        if field == "field2":
            der = '<Derivatives><Unknown index="10"/><Unknown index="11"/><Unknown index="12"/></Derivatives>'
        path = described(path, tmp_path, (der, ""))
    log, solves = run(coupled(path, mode=mode))
    folder = tmp_path / "plain"
    folder.mkdir()
    other, expected = by_differences(compiled(field), folder)
    assert solves - expected == (1 if mode in (NONE, WRONG) else 0)
    assert np.array_equal(log.values, other.values)


def test_fatal_ends_the_run():
    graph = coupled(compiled("field2"), mode=FATAL)
    log = simulate(graph, MASTERS["interface_jacobian"](graph), 0.0, 0.1, 0.05)
    graph.close()
    assert isinstance(log.error, FmuError) and log.error.status == 4
    assert "the directional derivative came back with fatal" in log.error.message


@pytest.mark.parametrize(("mode", "cubic"), [(OVER_STEP, 2.0), (AT_INSTANT, 0.5)])
def test_a_nonlinear_component_is_linearised_where_it_is(mode: int, cubic: float, tmp_path: Path):
    """The slope 3 cubic x² is that of the whole step, or of its end, where x has fallen by a sixth: exact, or to 1 %."""
    log, solves = run(coupled(compiled("field2"), mode=mode, cubic=cubic))
    other, more = by_differences(compiled("field2"), tmp_path, cubic=cubic)
    assert solves < more
    assert log.values == pytest.approx(other.values, abs=1e-6)


def loop(path: Path, **parameters: float) -> tuple[Graph, list[np.ndarray]]:
    """Two fields fed by one another without a delay; the list grows by each evaluation of the loop."""
    parts = {name: Fmu(path, name) for name in "ab"}
    for name, start in (("a", 1.0), ("b", 3.0)):
        parts[name].set_parameters({"feed": 0.5, "start": start, **parameters})
    names = [f"[{i}]" for i in range(1, M + 1)]
    pairs = [(f"{x}.y{e}", f"{y}.u{e}") for x, y in ("ab", "ba") for e in names]
    graph = Graph(parts, [Connection(*pair) for pair in pairs])
    evaluations, residual = [], graph.loop.residual

    def counted(z: np.ndarray) -> np.ndarray:
        evaluations.append(z)
        return residual(z)

    graph.loop.residual = counted  # type: ignore[method-assign]
    return graph, evaluations


@pytest.mark.parametrize(
    ("mode", "count"), [(AT_INSTANT, 2), (OVER_STEP, 2), (DISCARD, 8), (ERROR, 8), (NOT_A_NUMBER, 8)]
)
@pytest.mark.parametrize("field", FIELDS)
def test_algebraic_loop_at_the_start(field: str, mode: int, count: int):
    """y_a = 1 + y_b/2, y_b = 3 + y_a/2, by hand 10/3 and 14/3; linear: two evaluations, 6 more by differences."""
    graph, evaluations = loop(compiled(field), mode=mode)
    graph.initialize(0.0)
    assert graph.components["a"].read("y[1]") == pytest.approx(10.0 / 3.0, rel=1e-11)
    assert graph.components["b"].read("y[1]") == pytest.approx(14.0 / 3.0, rel=1e-11)
    assert len(evaluations) == count
    graph.close()


def test_wrong_derivatives_do_not_spoil_the_start():
    """dy/du = -1 in place of 1/2: the iteration grows by 3/4 or more, and differences have the last word."""
    graph, evaluations = loop(compiled("field2"), mode=WRONG)
    graph.initialize(0.0)
    assert graph.components["a"].read("y[1]") == pytest.approx(10.0 / 3.0, rel=1e-11)
    assert len(evaluations) > 8
    graph.close()


def test_loop_of_an_fmu_with_derivatives_and_one_without(tmp_path: Path):
    graph, evaluations = loop(compiled("field2"), mode=AT_INSTANT)
    without = replace(graph.components["b"].capabilities, directional_derivatives=False)
    graph.components["b"].capabilities = without
    graph.initialize(0.0)
    assert graph.components["b"].read("y[1]") == pytest.approx(14.0 / 3.0, rel=1e-11)
    assert len(evaluations) == 2 + M
    graph.close()
