"""Work done through the interfaces, booked from what is exchanged.

Where a component has an input ``X.force`` and an output ``X.position``, the force that acts in a step is
F + Ḟ (tau - t - H/2), so that its work is F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄), with x̄ the time mean
``X.position_mean``; without it the second term is left out. The same with ``X.moment``, ``X.rotation``
(integral of the angular velocity over the step, hence x0 = 0) and ``X.rotation_mean``.

The component that gives the load books the same work with what it knows: the load it has computed in the step and the
motion it was told. The difference is the energy that the coupling makes; divided by the step it is the power residual
of Sadjina et al., Engineering with Computers 33 (2017) 607-620 (ECCO).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.coupling.exchange import suffixed
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.graph.graph import Graph, Node

PAIRS = {
    "force": ("position", True),
    "moment": ("rotation", False),
}  # motion, and whether it is counted from the step's start


@dataclass
class _Giver:
    """The other side of an interface: the component that gives the load and is told the motion.

    Attributes
    ----------
    motion, mean : (m,) places in Graph.u where it is told motion and mean; `mean` may be empty
    rates : (m,) places in Graph.u of the slopes that it gives; empty: its load is that of an instant, linear between
    """

    motion: np.ndarray
    mean: np.ndarray
    rates: np.ndarray
    relative: bool
    load: np.ndarray
    before: np.ndarray

    def start(self, graph: Graph, loads: np.ndarray) -> None:
        """Begin at the present values."""
        self.load = graph.gathered(loads)
        self.before = graph.u[self.motion] if self.relative else np.zeros(loads.size)

    def work(self, graph: Graph, loads: np.ndarray, H: float) -> float:
        """Return the work that it says it has done on the receiver in this step, J."""
        given, x0, x1 = graph.gathered(loads), self.before, graph.acted[self.motion]
        if not self.rates.size:
            total = 0.5 * (given + self.load).dot(x1 - x0)
        else:
            total = given.dot(x1 - x0)
            if self.mean.size:
                slope, mean = graph.gathered(self.rates), graph.acted[self.mean]
                total += slope.dot(H / 2 * (x0 + x1) - H * mean)
        self.load = given
        if self.relative:
            self.before = x1
        return float(total)


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
    giver: _Giver | None  # None where the source of the load is not told the motion

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

    def remembered(self) -> tuple[np.ndarray, ...]:
        """Return what the next step starts from."""
        giver = self.giver
        return (self.before,) if giver is None else (self.before, giver.before, giver.load)

    def remember(self, values: tuple[np.ndarray, ...]) -> None:
        """Go back to what was `remembered`."""
        self.before = values[0]
        if self.giver is not None:
            self.giver.before, self.giver.load = values[1:]


class Work:
    """Observer of a graph: books the work done on each component through each of its loads.

    Attributes
    ----------
    names : the loads, ``cable.port[1].force``
    total : (len(names),) J, since `start`
    residual : (len(names),) J, since `start`: `total` less what the giver of the load has booked; nan where that one is
        not told the motion
    """

    def __init__(self, graph: Graph):
        self.graph = graph
        self.interfaces = [i for node in graph.nodes for i in _interfaces(graph, node)]
        self.names = [interface.name for interface in self.interfaces]
        self.total = np.zeros(len(self.names))
        self.residual = np.zeros(len(self.names))

    def start(self) -> None:
        """Begin at the present positions."""
        self.total[:] = 0.0
        for i, interface in enumerate(self.interfaces):
            interface.motion.get()
            interface.before = interface.motion.values.copy() if interface.relative else np.zeros(interface.loads.size)
            self.residual[i] = np.nan if interface.giver is None else 0.0
            if interface.giver is not None:
                interface.giver.start(self.graph, interface.loads)

    def save(self) -> tuple[np.ndarray, np.ndarray, list[Any]]:
        """Return what `restore` needs."""
        return self.total.copy(), self.residual.copy(), [interface.remembered() for interface in self.interfaces]

    def restore(self, saved: tuple[np.ndarray, np.ndarray, list[Any]]) -> None:
        """Go back: the steps booked since are not made."""
        self.total[:], self.residual[:], remembered = saved
        for interface, values in zip(self.interfaces, remembered, strict=True):
            interface.remember(values)

    def __call__(self, t: float, h: float) -> None:
        """Book the step from `t` to `t + h`."""
        for i, interface in enumerate(self.interfaces):
            work = interface.work(self.graph, h)
            self.total[i] += work
            if interface.giver is not None:
                self.residual[i] += work - interface.giver.work(self.graph, interface.loads, h)


def _interfaces(graph: Graph, node: Node) -> list[_Interface]:
    place = {name: node.first + i for i, name in enumerate(node.inputs.names)}
    found: dict[str, list[str]] = {}
    for name in place:
        stem = name[:-2] if name[-2:] in (".x", ".y", ".z") else name
        if stem.rpartition(".")[2] in PAIRS:
            found.setdefault(stem, []).append(name)
    own = {name: i for i, (part, name) in enumerate(graph.free_rates) if part == node.name}
    interfaces = [_interface(graph, node, stem, names, place, own) for stem, names in found.items()]
    return [interface for interface in interfaces if interface is not None]


def _interface(
    graph: Graph, node: Node, stem: str, names: list[str], place: dict[str, int], own: dict[str, int]
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
    loads = [place[name] for name in names]
    return _Interface(
        f"{node.name}.{stem}",
        np.array(loads, dtype=np.intp),
        np.array([where[name] for name in rates if name in where], dtype=np.intp),
        by_master,
        node.fmu.group(motions),
        node.fmu.group(means) if all(name in ports for name in means) else None,
        relative,
        np.zeros(len(names)),
        _giver(graph, node, loads, [place[name] for name in rates if name in place], motions, means, relative),
    )


def _giver(
    graph: Graph, node: Node, loads: list[int], rates: list[int], motions: list[str], means: list[str], relative: bool
) -> _Giver | None:
    """Return the other side: one component that gives all of the load and is told all of the motion, or None."""
    givers = {graph.links[i].source[0] for i in loads}
    if len(givers) != 1:
        return None
    told = {link.source: i for i, link in enumerate(graph.links) if link.target[0] in givers}
    motion, mean = ([told[node.name, x] for x in names if (node.name, x) in told] for names in (motions, means))
    if len(motion) < len(motions):
        return None
    zero = np.zeros(len(loads))
    m = len(loads)
    return _Giver(_whole(motion, m), _whole(mean, m), _whole(rates, m), relative, zero, zero)


def _whole(places: list[int], m: int) -> np.ndarray:
    """Return `places` (m,), or none of them where some are missing."""
    return np.array(places if len(places) == m else [], dtype=np.intp)
