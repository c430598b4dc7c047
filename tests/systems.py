"""Runs of the small systems of `tests/fmus`, and what the masters have in common in them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import MILD, fmu, oscillator

POSITIONS = ["a.position", "b.position"]
IMPLICIT = [name for name, master in MASTERS.items() if master.IMPLICIT]
ITERATED = [name for name in IMPLICIT if name != "semi_implicit"]

# the inputs of these FMUs are held (no slope for left.position), which limits every point exchange to order 2
POINT = [
    ("jacobi", {}, 1),
    ("jacobi", {"extrapolation": 1}, 2),
    ("gauss_seidel", {}, 1),
    ("gauss_seidel", {"extrapolation": 1}, 2),
    ("nepce", {}, 2),
    ("reduced_interface", {}, 2),
    *((name, {"tolerance": 1e-10}, 2) for name in ITERATED),
    ("semi_implicit", {}, 2),
]
"""Master, its options, the order of its point exchange."""


@contextmanager
def closing(graph: Graph) -> Iterator[Graph]:
    """Close the graph's FMUs in the end, whatever happens."""
    try:
        yield graph
    finally:
        graph.close()


def run(graph: Graph, master: str, H: float, stop: float, record=None, timeout=None, **options) -> Log:
    """Run a graph with the master of that name and close it."""
    with closing(graph):
        return simulate(graph, MASTERS[master](graph, **options), 0.0, stop, H, record, timeout=timeout)


def faulty_oscillator(**fault) -> Graph:
    """The mild oscillator, and an odd FMU that follows mass a."""
    graph = oscillator(**MILD)
    parts = {**graph.components, "c": fmu("odd", "c", **fault)}
    watcher = [Connection("a.position", "c.u")]
    feedback = [Connection("c.held_out", "c.held_in")]
    return Graph(parts, [*graph.connections, *watcher, *feedback])
