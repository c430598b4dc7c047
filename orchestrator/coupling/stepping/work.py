"""Work done through the interfaces, booked from what is exchanged.

Where a component has a load as input, ``X.force``, and its motion as output, ``X.position`` (`LOADS`), the force that acts in
a step is F + Ḟ (tau - t - H/2), so that its work is F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄), with x̄ the time mean
``X.position_mean``; without it the second term is left out. A rotation is counted from the start of the step: x0 = 0. Where a
component with a moment shows a tangent in the place of a rotation, as a cable does, it is the rotation of that tangent.

The component that gives the load books the same work with what it knows: the load it has computed in the step and the
motion it was told. The difference is the energy that the coupling makes; divided by the step it is the power residual
of Sadjina et al., Engineering with Computers 33 (2017) 607-620 (ECCO).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.coupling.exchange import LOADS, MEAN, RATE, motion_of, split, suffixed, tangent_of
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.graph.graph import Graph, Node

TINY = np.finfo(float).tiny
_Books = tuple[np.ndarray, np.ndarray, list[Any]]
"""Totals, residuals, and what each interface starts its next step from."""


@dataclass
class _Giver:
    """The other side of an interface: the component that gives the load and is told the motion.

    Attributes
    ----------
    name : of the component
    motion, mean : (m,) places in Graph.u where it is told motion and mean; `mean` may be empty
    rates : (m,) places in Graph.u of the slopes that it gives; empty: its load is that of an instant, linear between
    from_start, turned : whether the motion is counted from the start of the step; whether it is a tangent that turns
    load, before : (m,) at the start of the step
    """

    name: str
    motion: np.ndarray
    mean: np.ndarray
    rates: np.ndarray
    from_start: bool
    turned: bool
    load: np.ndarray
    before: np.ndarray

    def start(self, graph: Graph, loads: np.ndarray) -> None:
        """Begin at the present values."""
        self.load = graph.gathered(loads)
        self.before = np.zeros(loads.size) if self.from_start else graph.u[self.motion]

    def work(self, graph: Graph, loads: np.ndarray, H: float) -> float:
        """Return the work that it says it has done on the receiver in this step, J."""
        given, shown = graph.gathered(loads), graph.acted[self.motion]
        x0, x1 = _moved(self.before, shown, self.turned)
        if not self.rates.size:
            total = 0.5 * (given + self.load).dot(x1 - x0)
        else:
            total = given.dot(x1 - x0)
            if self.mean.size:
                slope, mean = graph.gathered(self.rates), _moved(self.before, graph.acted[self.mean], self.turned)[1]
                total += slope.dot(H / 2 * (x0 + x1) - H * mean)
        self.load = given
        if not self.from_start:
            self.before = shown
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
    from_start: bool  # whether the motion is counted from the start of the step
    turned: bool  # whether it is a tangent that turns
    before: np.ndarray  # (m,) the motion at the start of the step
    giver: _Giver | None  # None where the source of the load is not told the motion

    def work(self, graph: Graph, H: float) -> float:
        """Return the work of the step that has just been made, J."""
        self.motion.get()
        u, slopes = graph.acted, graph.r if self.own else graph.acted
        x0, x1 = _moved(self.before, self.motion.values, self.turned)
        total = u.take(self.loads).dot(x1 - x0)
        if self.mean is not None and self.rates.size:
            self.mean.get()
            mean = _moved(self.before, self.mean.values, self.turned)[1]
            total += slopes.take(self.rates).dot(H / 2 * (x0 + x1) - H * mean)
        if not self.from_start:
            self.before = self.motion.values.copy()
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
        self.interfaces = [interface for node in graph.nodes for interface in _interfaces(graph, node)]
        self.names = [interface.name for interface in self.interfaces]
        self.total = np.zeros(len(self.names))
        self.residual = np.zeros(len(self.names))
        self._tried: _Books | None = None

    def start(self) -> None:
        """Begin at the present positions."""
        self.total[:] = 0.0
        for i, interface in enumerate(self.interfaces):
            interface.motion.get()
            interface.before = (
                np.zeros(interface.loads.size) if interface.from_start else interface.motion.values.copy()
            )
            self.residual[i] = np.nan if interface.giver is None else 0.0
            if interface.giver is not None:
                interface.giver.start(self.graph, interface.loads)

    def save(self) -> _Books:
        """Return what `restore` needs."""
        return self.total.copy(), self.residual.copy(), [interface.remembered() for interface in self.interfaces]

    def restore(self, saved: _Books) -> None:
        """Go back: the steps booked since are not made."""
        self._tried = None
        self.total[:], self.residual[:], remembered = saved
        for interface, values in zip(self.interfaces, remembered, strict=True):
            interface.remember(values)

    @property
    def made(self) -> float:
        """Energy that all booked interfaces have made since `start`, J."""
        return float(np.nansum(self.residual))

    @property
    def givers(self) -> list[str]:
        """The components that give loads and are told the motion, so that what is made can be told."""
        return list(dict.fromkeys(i.giver.name for i in self.interfaces if i.giver is not None))

    def tried(self, H: float) -> float:
        """Return the energy that all booked interfaces will have made if the step just made is accepted, J.

        What would be booked is kept: the next call takes it, unless `forget` says that it was not accepted.
        """
        saved = self.save()
        self._book(H)
        tried, made = self.save(), self.made
        self.restore(saved)
        self._tried = tried
        return made

    def forget(self) -> None:
        """The step that was `tried` is not accepted as it is."""
        self._tried = None

    def __call__(self, t: float, h: float) -> None:
        """Book the step from `t` to `t + h`."""
        if self._tried is not None:
            self.restore(self._tried)
        else:
            self._book(h)

    def _book(self, h: float) -> None:
        for i, interface in enumerate(self.interfaces):
            work = interface.work(self.graph, h)
            self.total[i] += work
            if interface.giver is not None:
                self.residual[i] += work - interface.giver.work(self.graph, interface.loads, h)


def _interfaces(graph: Graph, node: Node) -> Iterator[_Interface]:
    """Yield the loads of a component whose motion it shows, vector by vector."""
    found: dict[str, list[str]] = {}
    for name in node.inputs.names:
        where, last, _ = split(name)
        if last in LOADS:
            found.setdefault(where + last, []).append(name)
    for stem, names in found.items():
        pairs = [motion_of(name) for name in names]
        motions, from_start = [motion for motion, _ in pairs], pairs[0][1]
        tangents = [tangent_of(name) for name in names]
        if _all_shown(node, motions):
            yield _interface(graph, node, stem, _Names(names, motions), from_start, turned=False)
        elif len(names) == 3 and all(tangents) and _all_shown(node, tangents):
            yield _interface(graph, node, stem, _Names(names, tangents), from_start=False, turned=True)


def _all_shown(node: Node, names: list[str]) -> bool:
    ports = node.fmu.ports
    return all(name in ports and ports[name].causality == "output" for name in names)


def _moved(before: np.ndarray, shown: np.ndarray, turned: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return what a load does work on, at the start and as it is `shown`; of a tangent that has `turned`: its rotation.

    The rotation vector from g to h is the angle between them about g × h.
    """
    if not turned:
        return before, shown
    sizes = float(np.sqrt(before.dot(before) * shown.dot(shown)))
    (a, b, c), (d, e, f) = before.tolist(), shown.tolist()  # a tenth of the time of np.cross
    axis = np.array([b * f - c * e, c * d - a * f, a * e - b * d]) / max(sizes, TINY)
    sine = float(np.sqrt(axis.dot(axis)))
    angle = float(np.arctan2(sine, before.dot(shown) / max(sizes, TINY)))
    return np.zeros(3), axis * (angle / sine if sine > 0.0 else 1.0)


@dataclass(frozen=True)
class _Names:
    """The variables of an interface, the components of a vector each."""

    loads: list[str]
    motions: list[str]

    @property
    def rates(self) -> list[str]:
        return [suffixed(name, RATE) for name in self.loads]

    @property
    def means(self) -> list[str]:
        return [suffixed(name, MEAN) for name in self.motions]


def _interface(graph: Graph, node: Node, stem: str, names: _Names, from_start: bool, *, turned: bool) -> _Interface:
    fed = {name: node.first + i for i, name in enumerate(node.inputs.names)}
    free = {name: i for i, (part, name) in enumerate(graph.free_rates) if part == node.name}
    by_master = all(name in free for name in names.rates)
    place = free if by_master else fed
    loads, rates = (np.array([fed[n] for n in some if n in fed], dtype=np.intp) for some in (names.loads, names.rates))
    return _Interface(
        f"{node.name}.{stem}",
        loads,
        np.array([place[name] for name in names.rates if name in place], dtype=np.intp),
        by_master,
        node.fmu.group(names.motions),
        node.fmu.group(names.means) if all(name in node.fmu.ports for name in names.means) else None,
        from_start,
        turned,
        np.zeros(loads.size),
        _giver(graph, node, names, loads, rates, from_start, turned),
    )


def _giver(
    graph: Graph, node: Node, names: _Names, loads: np.ndarray, rates: np.ndarray, from_start: bool, turned: bool
) -> _Giver | None:
    """Return the other side: one component that gives all of the load and is told all of the motion, or None."""
    givers = {graph.links[i].source[0] for i in loads}
    if len(givers) != 1:
        return None
    told = {link.source: i for i, link in enumerate(graph.links) if link.target[0] in givers}
    motion, mean = (
        np.array([told[node.name, name] for name in some if (node.name, name) in told], dtype=np.intp)
        for some in (names.motions, names.means)
    )
    if motion.size < loads.size:
        return None
    zero = np.zeros(loads.size)
    return _Giver(
        next(iter(givers)), motion, _whole(mean, loads.size), _whole(rates, loads.size), from_start, turned, zero, zero
    )


def _whole(places: np.ndarray, m: int) -> np.ndarray:
    """Return `places` (m,), or none of them where some are missing."""
    return places if places.size == m else places[:0]
