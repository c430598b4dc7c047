"""The nodes that the cable shows: the line between them is theirs, cubic by Hermite."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from fmus.cable.assembly import interpolate
from fmus.cable.mesh import spread
from fmus.cable.module import N_NODES, Cable
from orchestrator.landing.fields import cable_fields


def moved(n_elements: int) -> Cable:
    """Return a cable after a push from the side, 20 m from its left support."""
    cable = Cable()
    cable.table.assign(cable.values, {"n_elements": n_elements, "grading": 10.0, "grading_position": 20.0})
    cable.initialize(0.0)
    cable.values[cable.table.indices(["port[1].s", "port[1].force.x", "port[1].force.z"])] = 20.0, 300.0, -400.0
    for k in range(10):
        cable.step(0.01 * k, 0.01)
    return cable


def table_of(cable: Cable) -> dict[str, np.ndarray]:
    """Return the cable's present outputs as a table of one row."""
    names = cable.table.names("output")
    return {"time": np.zeros(1)} | {f"cable.{name}": np.array([cable[name]]) for name in names}


def fields_of(cable: Cable) -> dict[str, np.ndarray]:
    return cable_fields(table_of(cable), float(cable.model.s[-1]), cable.model.s)


def line(fields: dict[str, np.ndarray]) -> CubicHermiteSpline:
    return CubicHermiteSpline(fields["node_arc_length"], fields["node_position"][0], fields["node_slope"][0])


def places(cable: Cable) -> np.ndarray:
    return np.linspace(0.0, cable.model.s[-1], 1001)


def elements(cable: Cable) -> np.ndarray:
    """Return the centreline (1001, 3) by the elements' own shape functions."""
    q, shape, point = cable.state[: cable.model.weight.size], np.zeros(8), np.zeros(6)
    found = []
    for s in places(cable):
        interpolate(cable.model, q, s, shape, point)
        found.append(point[:3].copy())
    return np.array(found)


@pytest.mark.parametrize("n_elements", [7, N_NODES - 1])
def test_between_the_nodes_the_line_is_that_of_the_elements(n_elements):
    """Both are the same cubics: they differ by the rounding of 200 m alone."""
    cable = moved(n_elements)
    assert np.abs(line(fields_of(cable))(places(cable)) - elements(cable)).max() < 1e-12 * 200.0


def test_of_a_finer_mesh_as_many_as_there_is_room_for_are_shown():
    """Each third of 190 nodes, both ends included, with the values of the state."""
    cable = moved(3 * (N_NODES - 1))
    fields = fields_of(cable)
    shown = spread(cable.model.s.size, N_NODES)
    assert np.array_equal(np.diff(shown), np.full(N_NODES - 1, 3))
    assert np.array_equal(fields["node_arc_length"], cable.model.s[shown])
    q = cable.state[: cable.model.weight.size].reshape(-1, 6)[shown]
    assert np.array_equal(np.concatenate([fields["node_position"][0], fields["node_slope"][0]], axis=1), q)


@pytest.mark.parametrize(("count", "most"), [(2, 64), (64, 64), (65, 64), (5001, 64)])
def test_both_ends_are_always_shown(count, most):
    shown = spread(count, most)
    assert shown[0] == 0 and shown[-1] == count - 1 and shown.size == min(count, most)


def test_a_foreign_cable_has_none():
    cable = moved(7)
    assert "node_slope" not in cable_fields(table_of(cable), 200.0)
    table = {name: values for name, values in table_of(cable).items() if ".node[" not in name}
    assert "node_slope" not in cable_fields(table, 200.0, cable.model.s)
