"""The graph: what is refused, what is converted, in which order values go."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, GraphError
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import MILD, compiled, fmu, needs_compiler, oscillator

pytestmark = pytest.mark.portable

REFUSED = [
    ("a.y", "c.u", "no component 'c'"),
    ("a.yy", "b.u", "no variable 'yy'; did you mean y"),
    ("a.y", "b.uu", "no variable 'uu'; did you mean u"),
    ("a.u", "b.u", "is no output but input"),
    ("a.y", "b.x", "is no input but output"),
    ("a.gain", "b.u", "is no output but parameter"),
    ("a.x", "b.u", "unit m.s is no measure of m"),
    ("a.angle", "b.u", "unit deg is no measure of m"),
    ("a.y", "b.count_in", "Real cannot feed Integer"),
    ("a.said", "b.u", "String cannot feed Real"),
    ("a.flag", "b.count_in", "Boolean cannot feed Integer"),
]


@pytest.fixture
def pair():
    components = {"a": fmu("odd", "a", gain=0.5, offset=1.0), "b": fmu("odd", "b", gain=-0.5, offset=2.0)}
    yield components
    for component in components.values():
        component.close()


@pytest.mark.parametrize(("source", "target", "message"), REFUSED)
def test_refused(pair, source, target, message):
    with pytest.raises(GraphError, match=r"connection .*→") as caught:
        Graph(pair, [Connection(source, target)])
    assert message in str(caught.value)


def test_input_fed_twice(pair):
    with pytest.raises(GraphError, match=r"b\.u is fed twice, by a\.y and by b\.y"):
        Graph(pair, [Connection("a.y", "b.u"), Connection("b.y", "b.u")])


def test_names_and_order(pair):
    with pytest.raises(GraphError, match="have no dot"):
        Graph({"a.b": pair["a"]}, [])
    with pytest.raises(GraphError, match="must name each of"):
        Graph(pair, [], order=("a",))


def test_algebraic_loop_is_solved_and_units_are_converted(pair):
    """a = b/2 + 1, b = -a/2 + 2, by hand a = 1.6 m, b = 1.2 m; outputs in mm, inputs in m; to the loop's tolerance."""
    graph = Graph(pair, [Connection("a.y", "b.u"), Connection("b.y", "a.u")])
    graph.initialize(0.0)
    assert pair["a"].read("y") == pytest.approx(1600.0, rel=2e-11)
    assert pair["b"].read("y") == pytest.approx(1200.0, rel=2e-11)
    assert pair["a"].read("u") == pytest.approx(1.2, rel=2e-11)


def test_loop_without_solution():
    """a = b + 1, b = a + 1 contradict each other."""
    a, b = fmu("odd", "a", gain=1.0, offset=1.0), fmu("odd", "b", gain=1.0, offset=1.0)
    graph = Graph({"a": a, "b": b}, [Connection("a.y", "b.u"), Connection("b.y", "a.u")])
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 1.0, 0.1)
    graph.close()
    assert log.error is not None
    assert "has no solution" in log.error.message


def test_discrete_and_whole_numbers_move_at_communication_points(pair):
    """x = 0.1 n u with u = 1.2 m for a: what b received before step n + 1 is what a had after n steps."""
    connections = [
        Connection("a.y", "b.u"),
        Connection("b.y", "a.u"),
        Connection("a.count", "b.count_in"),
        Connection("a.flag", "b.flag_in"),
        Connection("a.held_out", "b.held_in"),
    ]
    graph = Graph(pair, connections)
    simulate(graph, MASTERS["jacobi"](graph), 0.0, 1.0, 0.1)
    assert pair["a"].read("count") == 10
    assert pair["b"].read("count_in") == 9
    assert pair["b"].read("flag_in") is True
    assert pair["b"].read("held_in") == pytest.approx(0.9 * 1.2, rel=1e-12)
    assert graph.u.size == 2


@needs_compiler
def test_one_element_of_an_array_leaves_the_others_alone():
    """x' = u[1] + u[2] with u[2] = 3 mm set by hand and u[1] = 2 m connected: 2003 mm/s for 0.1 s."""
    parts = {"source": fmu("odd", "source", offset=2.0), "lag": Fmu(compiled("lag3"), "lag")}
    parts["lag"].set_parameters({"u[2]": 3.0})
    graph = Graph(parts, [Connection("source.y", "lag.u[1]")])
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.1, 0.1, ["lag.y[1]"])
    graph.close()
    assert log.values[-1, 0] == pytest.approx(200.3, rel=1e-12)


def test_text_moves_at_communication_points():
    parts = {"a": fmu("odd", "a", note="100 % true"), "b": fmu("odd", "b")}
    graph = Graph(parts, [Connection("a.said", "b.heard")])
    graph.initialize(0.0)
    assert parts["b"].read("heard") == "100 % true"
    graph.close()


def test_discrete_inputs_stay_put_in_the_iteration():
    graph = oscillator(**MILD)
    c = fmu("odd", "c")
    graph = Graph({**graph.components, "c": c}, [*graph.connections, Connection("c.held_out", "c.held_in")])
    assert not any("held_in" in name for name in graph.input_names)
    graph.close()


def test_order_follows_the_feedthrough():
    """The spring's force depends on the positions without a step, so it comes last, wherever it was named."""
    for names in ("abs", "sab", "asb"):
        parts = {n: fmu("spring" if n == "s" else "link", n) for n in names}
        pairs = [("a.position", "s.a.position"), ("b.position", "s.b.position")]
        pairs += [("s.a.force", "a.force"), ("s.b.force", "b.force")]
        graph = Graph(parts, [Connection(*pair) for pair in pairs])
        assert graph.order[-1] == "s"
        assert sorted(graph.input_names[i] for i in graph.torn) == ["a.force", "b.force"]
        graph.close()


def test_order_follows_the_connections_outside_loops():
    parts = {n: fmu("link", n) for n in "cba"}
    pairs = [("a.position", "b.force_rate"), ("b.position", "c.force_rate")]
    with pytest.raises(GraphError, match="unit"):
        Graph(parts, [Connection(*pair) for pair in pairs])
    pairs = [("a.position", "b.left.position"), ("b.position", "c.left.position")]
    graph = Graph(parts, [Connection(*pair) for pair in pairs])
    assert graph.order == ("a", "b", "c")
    assert graph.torn.size == 0
    graph.close()


def test_given_order():
    graph = oscillator(**MILD)
    reverse = Graph(graph.components, graph.connections, order=("b", "a"))
    assert [reverse.input_names[i] for i in reverse.torn] == ["b.left.position", "b.left.velocity"]
    graph.close()


def test_start_values_go_along_the_connections():
    """Force of the spring at the start: k (x_a - x_b) = 5 * 0.2 N, by hand."""
    parts = {
        "a": fmu("link", "a", initial_position=0.2),
        "b": fmu("link", "b"),
        "s": fmu("spring", "s", stiffness=5.0),
    }
    pairs = [("a.position", "s.a.position"), ("b.position", "s.b.position")]
    pairs += [("s.a.force", "a.force"), ("s.b.force", "b.force")]
    graph = Graph(parts, [Connection(*pair) for pair in pairs])
    graph.initialize(0.0)
    # the spring answers at the end of its initialisation: the next reading is right at the latest
    graph.refresh()
    assert dict(zip(graph.input_names, graph.u, strict=True))["a.force"] == pytest.approx(-1.0)
    assert np.all(np.isfinite(graph.y))
    graph.close()
