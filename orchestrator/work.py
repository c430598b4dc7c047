"""Work done through the interfaces, booked from what is exchanged.

Where a component has an input ``X.force`` and an output ``X.position``, the force that acts in a step is
F + Ḟ (tau - t - H/2), so that its work is F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄), with x̄ the time mean
``X.position_mean``; without it the second term is left out. The same with ``X.moment``, ``X.rotation``
(integral of the angular velocity over the step, hence x0 = 0) and ``X.rotation_mean``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.fmu import Group, suffixed
from orchestrator.graph import Graph, Node

PAIRS = {
    "force": ("position", True),
    "moment": ("rotation", False),
}  # motion, and whether it is counted from the step's start


@dataclass
class _Interface:
    """One load and its motion; places are columns of the arrays of `Work`."""

    name: str
    loads: np.ndarray  # (m,) places in Graph.u
    rates: np.ndarray  # (m,) places in Graph.u, in Graph.r where the master sets them, or empty
    own: bool  # whether the master sets the rates
    motion: Group
    mean: Group | None
    relative: bool
    before: np.ndarray  # (m,)

    def work(self, graph: Graph, H: float) -> float:
        """Return the work of the step that has just been made, J."""
        self.motion.get()
        u, slopes = graph.acted, graph.r if self.own else graph.acted
        x1, x0 = self.motion.values, self.before
        total = u.take(self.loads).dot(x1 - x0)
        if self.mean is not None and self.rates.size:
            self.mean.get()
            total += slopes.take(self.rates).dot(H / 2 * (x0 + x1) - H * self.mean.values)
        if self.relative:
            self.before = x1.copy()
        return total


class Work:
    """Observer of a graph: books the work done on each component through each of its loads.

    Attributes
    ----------
    names : the loads, ``cable.port[1].force``
    total : (len(names),) J, since `start`
    """

    def __init__(self, graph: Graph):
        self.graph = graph
        self.interfaces = [i for node in graph.nodes for i in _interfaces(graph, node)]
        self.names = [interface.name for interface in self.interfaces]
        self.total = np.zeros(len(self.names))

    def start(self) -> None:
        """Begin at the present positions."""
        self.total[:] = 0.0
        for interface in self.interfaces:
            interface.motion.get()
            interface.before = interface.motion.values.copy() if interface.relative else np.zeros(interface.loads.size)

    def save(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return what `restore` needs."""
        return self.total.copy(), [interface.before for interface in self.interfaces]

    def restore(self, saved: tuple[np.ndarray, list[np.ndarray]]) -> None:
        """Go back: the steps booked since are not made."""
        self.total[:] = saved[0]
        for interface, before in zip(self.interfaces, saved[1], strict=True):
            interface.before = before

    def __call__(self, t: float, h: float) -> None:
        """Book the step from `t` to `t + h`."""
        for i, interface in enumerate(self.interfaces):
            self.total[i] += interface.work(self.graph, h)


def _interfaces(graph: Graph, node: Node) -> list[_Interface]:
    place = {name: node.first + i for i, name in enumerate(node.inputs.names)}
    found: dict[str, list[str]] = {}
    for name in place:
        stem = name[:-2] if name[-2:] in (".x", ".y", ".z") else name
        if stem.rpartition(".")[2] in PAIRS:
            found.setdefault(stem, []).append(name)
    own = {name: i for i, (part, name) in enumerate(graph.free_rates) if part == node.name}
    interfaces = [_interface(node, stem, names, place, own) for stem, names in found.items()]
    return [interface for interface in interfaces if interface is not None]


def _interface(
    node: Node, stem: str, names: list[str], place: dict[str, int], own: dict[str, int]
) -> _Interface | None:
    load = stem.rpartition(".")[2]
    motion, relative = PAIRS[load]
    motions = [stem[: -len(load)] + motion + name[len(stem) :] for name in names]
    means = [suffixed(name, "_mean") for name in motions]
    rates = [suffixed(name, "_rate") for name in names]
    by_master = all(name in own for name in rates)
    where = own if by_master else place
    ports = node.fmu.ports
    if not all(name in ports and ports[name].causality == "output" for name in motions):
        return None
    return _Interface(
        f"{node.name}.{stem}",
        np.array([place[name] for name in names], dtype=np.intp),
        np.array([where[name] for name in rates if name in where], dtype=np.intp),
        by_master,
        node.fmu.group(motions),
        node.fmu.group(means) if all(name in ports for name in means) else None,
        relative,
        np.zeros(len(names)),
    )
