"""Work done through the interfaces, booked from what is exchanged.

Where a component has a load as input, ``X.force``, and its motion as output, ``X.position`` (`LOADS`), the force that acts in
a step is F + Ḟ (tau - t - H/2), so that its work is F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄), with x̄ the time mean
``X.position_mean``; without it the second term is left out. A rotation is counted from the start of the step: x0 = 0. Where a
component with a moment shows a tangent in the place of a rotation, as a cable does, it is the rotation of that tangent.
Where the place of a load moves along a line within the step (``X.s_rate``), what the motion changes by for that reason is no
motion of the material, and no work is done on it.

The component that gives the load books the same work with what it knows: the load it has computed in the step and the
motion it was told. The difference is the energy that the coupling makes; divided by the step it is the power residual
of Sadjina et al., Engineering with Computers 33 (2017) 607-620 (ECCO).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.coupling.exchange import LOADS, MEAN, RATE, along, motion_of, split, suffixed, tangent_of
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.kernel import kernel

TINY = np.finfo(float).tiny
AXES = 3  # components of a load; one with fewer has places -1 for the rest
BEFORE, TOLD, GIVEN, LAY = slice(2, 5), slice(5, 8), slice(8, 11), slice(11, 14)
"""Rows of the books after totals and residuals, what a step starts from: the motion, as the giver was told it, its load, and
how the line lies at its place."""
ROWS = 14
ALL = slice(None)


@dataclass(frozen=True)
class _Interface:
    """One load and its motion: where their components (three, or fewer) are found.

    Attributes
    ----------
    name : of the load, ``cable.port[1].force``
    loads, rates : places in Graph.u; of the rates in Graph.r where the master sets them (`own`); none where there are none
    motion, mean : variables of the component; no means where it has none
    giver : the component that gives all of the load and is told all of the motion; empty where there is none
    told, told_mean : places in Graph.u where that one is told motion and mean
    given_rates : places in Graph.u of the slopes that it gives; none: its load is that of an instant, linear between
    from_start, turned : whether the motion is counted from the start of the step; whether it is a tangent that turns
    lay, lay_mean : variables that say by what the motion changes along a line, and their means; none where it has none
    speed : input at which rate the place moves along the line; empty where it has none
    placed : whether the place is told anew at communication points
    """

    name: str
    loads: list[int]
    rates: list[int]
    own: bool
    motion: list[str]
    mean: list[str]
    giver: str
    told: list[int]
    told_mean: list[int]
    given_rates: list[int]
    from_start: bool
    turned: bool
    lay: list[str]
    lay_mean: list[str]
    speed: str
    placed: bool


class Work:
    """Observer of a graph: books the work done on each component through each of its loads.

    Attributes
    ----------
    names : the loads, ``cable.port[1].force``
    total : (len(names),) J, since `start`
    residual : (len(names),) J, since `start`: `total` less what the giver of the load has booked; nan where that one is
        not told the motion
    booked : (len(names),) whether both sides are
    givers : the components that give such loads
    """

    def __init__(self, graph: Graph):
        self.graph = graph
        found = [(node, interface) for node in graph.nodes for interface in _interfaces(graph, node)]
        self.interfaces = [interface for _, interface in found]
        self.names = [interface.name for interface in self.interfaces]
        self.givers = list(dict.fromkeys(i.giver for i in self.interfaces if i.giver))
        self._place(found)
        self._books, self._x = np.zeros((ROWS, len(self.names))), np.zeros((4, AXES))
        self.total, self.residual = self._books[0], self._books[1]
        self._tried: np.ndarray | None = None

    def _place(self, found: list[tuple[Node, _Interface]]) -> None:
        """Find the places of all that is read: of loads and slopes among the links, of motions among what is shown."""
        shown: dict[str, dict[str, None]] = {}
        for node, one in found:
            wanted = [*one.motion, *one.mean, *one.lay, *one.lay_mean, *([one.speed] if one.speed else [])]
            shown.setdefault(node.name, {}).update(dict.fromkeys(wanted))
        place = {signal: i for i, signal in enumerate((c, name) for c, names in shown.items() for name in names)}
        self._shown, first = np.zeros(len(place)), 0
        self._groups: dict[str, Group] = {}
        for component, names in shown.items():
            buffer = self._shown[first : first + len(names)]
            self._groups[component] = self.graph.components[component].group(list(names), buffer)
            first += len(names)

        def motions(names: list[str], node: Node) -> list[int]:
            return [place[node.name, name] for name in names]

        interfaces = [one for _, one in found]
        self._loads = _rows([one.loads for one in interfaces])
        self._rates = _rows([one.rates for one in interfaces])
        self._given_rates = _rows([one.given_rates for one in interfaces])
        self._told = _rows([one.told for one in interfaces])
        self._told_mean = _rows([one.told_mean for one in interfaces])
        self._motion = _rows([motions(one.motion, node) for node, one in found])
        self._mean = _rows([motions(one.mean, node) for node, one in found])
        self._lay = _rows([motions(one.lay, node) for node, one in found])
        self._lay_mean = _rows([motions(one.lay_mean, node) for node, one in found])
        self._speed = _rows([motions([one.speed] if one.speed else [], node) for node, one in found])[:, 0]
        self._placed = np.flatnonzero([one.placed for one in interfaces])
        self._movers = [self._groups[name] for name in dict.fromkeys(node.name for node, one in found if one.placed)]
        self._starts = [
            (rows, at[self._placed]) for rows, at in ((BEFORE, self._motion), (TOLD, self._motion), (LAY, self._lay))
        ]
        kinds = [(one.own, one.from_start, one.turned, bool(one.giver)) for one in interfaces]
        self._kinds = np.array(kinds, dtype=np.bool_).reshape(-1, 4)
        self._from_start, self.booked = self._kinds[:, 1], self._kinds[:, 3]

    def start(self) -> None:
        """Begin at the present positions."""
        self._tried = None
        self._read()
        books = self._books
        books[:] = 0.0
        self.residual[~self.booked] = np.nan
        still = ~self._from_start
        books[BEFORE] = still * _taken(self._shown, self._motion)
        books[TOLD] = still * _taken(self.graph.u, self._told)
        books[GIVEN] = self.booked * _taken(self.graph.gathered(ALL), self._loads)
        books[LAY] = _taken(self._shown, self._lay)

    def departs(self) -> None:
        """Take the motions of places that have been told anew: a step begins from there."""
        for group in self._movers:
            group.get()
        for rows, places in self._starts if self._movers else ():
            self._books[rows, self._placed] = _taken(self._shown, places)

    def _read(self) -> None:
        for group in self._groups.values():
            group.get()

    def save(self) -> np.ndarray:
        """Return what `restore` needs."""
        return self._books.copy()

    def restore(self, saved: np.ndarray) -> None:
        """Go back: the steps booked since are not made."""
        self._tried = None
        self._books[:] = saved

    def tried(self, H: float) -> float:
        """Return the energy that all booked interfaces will have made if the step just made is accepted, J.

        What would be booked is kept: the next call takes it, unless `forget` says that it was not accepted.
        """
        tried = self.save()
        self._book(H, tried)
        self._tried = tried
        return float(np.sum(tried[1], where=self.booked))

    def forget(self) -> None:
        """The step that was `tried` is not accepted as it is."""
        self._tried = None

    def __call__(self, t: float, h: float) -> None:
        """Book the step from `t` to `t + h`."""
        if self._tried is not None:
            self.restore(self._tried)
        else:
            self._book(h, self._books)

    def _book(self, h: float, books: np.ndarray) -> None:
        graph = self.graph
        self._read()
        book(
            h, graph.acted, graph.r, graph.gathered(ALL), self._shown, self._loads, self._rates, self._motion,
            self._mean, self._told, self._told_mean, self._given_rates, self._lay, self._lay_mean, self._speed, self._kinds,
            self._x, books,
        )  # fmt: skip


@kernel
def book(
    h, acted, slopes, given, shown, loads, rates, motion, mean, told, told_mean, given_rates, lay, lay_mean, speed, kinds, x,
    books,
):  # fmt: skip
    """Add the work of a step of length `h` to the `books`: of each interface as its receiver and as its giver have it.

    Parameters
    ----------
    acted, given : (n_u,) inputs that acted in the step, and what their givers say
    slopes, shown : (n_r,), (n_shown,) slopes set by the master, and motions and means that components show
    loads, rates, motion, mean, told, told_mean, given_rates : (n, 3) places of what `_Interface` names, -1: there is none
    lay, lay_mean, speed : (n, 3), (n, 3), (n,) such places, too
    kinds : (n, 4) own, from_start, turned, whether there is a giver
    x : (4, 3) workspace: the motion at the start, at the end, its mean; the mean lay of the line
    books : (14, n) changed
    """
    for i in range(loads.shape[0]):
        from_start, turned, known = kinds[i, 1], kinds[i, 2], kinds[i, 3]
        done = 0.0
        for side in range(2 if known else 1):
            receives = side == 0
            slopes_known = rates[i, 0] >= 0 if receives else given_rates[i, 0] >= 0
            moments = slopes_known and (mean[i, 0] >= 0 if receives else told_mean[i, 0] >= 0)
            first = 2 + 3 * side
            for k in range(3):
                x[0, k], x[1, k], x[2, k] = books[first + k, i], 0.0, 0.0
                if loads[i, k] >= 0:
                    x[1, k] = shown[motion[i, k]] if receives else acted[told[i, k]]
                    if moments:
                        x[2, k] = shown[mean[i, k]] if receives else acted[told_mean[i, k]]
                if not from_start:
                    books[first + k, i] = x[1, k]
            if turned:  # the rotation vector from g to h is the angle between them about g x h
                for j in range(1, 3):
                    g0, g1, g2, h0, h1, h2 = x[0, 0], x[0, 1], x[0, 2], x[j, 0], x[j, 1], x[j, 2]
                    sizes = max(np.sqrt((g0 * g0 + g1 * g1 + g2 * g2) * (h0 * h0 + h1 * h1 + h2 * h2)), TINY)
                    a0, a1, a2 = (g1 * h2 - g2 * h1) / sizes, (g2 * h0 - g0 * h2) / sizes, (g0 * h1 - g1 * h0) / sizes
                    sine = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
                    angle = np.arctan2(sine, (g0 * h0 + g1 * h1 + g2 * h2) / sizes)
                    factor = angle / sine if sine > 0.0 else 1.0
                    x[j, 0], x[j, 1], x[j, 2] = a0 * factor, a1 * factor, a2 * factor
                x[0, 0], x[0, 1], x[0, 2] = 0.0, 0.0, 0.0
            way = h * shown[speed[i]] if speed[i] >= 0 else 0.0
            if (
                way != 0.0
            ):  # off with what the place's own way is: that times lay, the lay linear about its mean in the step
                for k in range(3):
                    average = 0.5 * (books[11 + k, i] + shown[lay[i, k]])
                    x[3, k] = shown[lay_mean[i, k]] if lay_mean[i, k] >= 0 else average
                if turned:  # a tangent t turns by t x lay / |t|²
                    t0, t1, t2 = shown[motion[i, 0]], shown[motion[i, 1]], shown[motion[i, 2]]
                    square = t0 * t0 + t1 * t1 + t2 * t2
                    c0, c1, c2 = x[3, 0] / square, x[3, 1] / square, x[3, 2] / square
                    x[3, 0], x[3, 1], x[3, 2] = t1 * c2 - t2 * c1, t2 * c0 - t0 * c2, t0 * c1 - t1 * c0
                for k in range(3):
                    bent = 0.0 if turned else (shown[lay[i, k]] - books[11 + k, i]) / 12.0
                    x[1, k] -= way * x[3, k]
                    x[2, k] -= way * (0.5 * x[3, k] - bent)
            work = 0.0
            for k in range(3):
                if loads[i, k] < 0:
                    continue
                load = acted[loads[i, k]] if receives else given[loads[i, k]]
                if not receives:
                    before = books[8 + k, i]
                    books[8 + k, i] = load
                    if not slopes_known:
                        load = 0.5 * (load + before)
                work += load * (x[1, k] - x[0, k])
                if moments:
                    if not receives:
                        slope = given[given_rates[i, k]]
                    elif kinds[i, 0]:
                        slope = slopes[rates[i, k]]
                    else:
                        slope = acted[rates[i, k]]
                    work += slope * (0.5 * h * (x[0, k] + x[1, k]) - h * x[2, k])
            if receives:
                done = work
                books[0, i] += work
            else:
                books[1, i] += done - work
        for k in range(3):
            books[11 + k, i] = shown[lay[i, k]] if lay[i, k] >= 0 else 0.0


def _rows(places: list[list[int]]) -> np.ndarray:
    """Return the places of all interfaces, (n, AXES), -1 where there is none."""
    found = np.full((len(places), AXES), -1, dtype=np.intp)
    for row, some in zip(found, places, strict=True):
        row[: len(some)] = some
    return found


def _taken(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the `values` at `places` (n, AXES) as rows of the books, (AXES, n); zero where there is no place."""
    return np.where(places >= 0, values[places], 0.0).T if values.size else np.zeros(places.T.shape)


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
    own = all(name in free for name in names.rates)
    loads, giver = [fed[name] for name in names.loads], _giver_of(graph, node, names)
    told, ports = _told(graph, node, names.motions, giver), node.fmu.ports
    lay, speed = [along(name)[0] for name in names.motions], along(names.motions[0])[1]
    moves = all(name in ports for name in [*lay, speed])
    lay_mean = [suffixed(name, MEAN) for name in lay]
    return _Interface(
        name=f"{node.name}.{stem}",
        loads=loads,
        rates=_places(names.rates, free if own else fed),
        own=own,
        motion=names.motions,
        mean=names.means if all(name in ports for name in names.means) else [],
        giver=giver if told else "",
        told=told,
        told_mean=_told(graph, node, names.means, giver),
        given_rates=_places(names.rates, fed),
        from_start=from_start,
        turned=turned,
        lay=lay if moves else [],
        lay_mean=lay_mean if moves and all(name in ports for name in lay_mean) else [],
        speed=speed if moves else "",
        placed=not from_start and bool(node.discrete_inputs.names),
    )


def _giver_of(graph: Graph, node: Node, names: _Names) -> str:
    """Return the one component that gives all of the load; empty where there are several."""
    fed = {name: node.first + i for i, name in enumerate(node.inputs.names)}
    givers = {graph.links[fed[name]].source[0] for name in names.loads}
    return givers.pop() if len(givers) == 1 else ""


def _told(graph: Graph, node: Node, names: list[str], giver: str) -> list[int]:
    """Return the places in Graph.u where the giver is told the outputs `names` of a component; none if some are missing."""
    told = {link.source: i for i, link in enumerate(graph.links) if link.target[0] == giver}
    return _places([(node.name, name) for name in names], told)


def _places(names: Sequence[Any], place: Mapping[Any, int]) -> list[int]:
    """Return the places of all `names`, or of none of them where some are missing."""
    return [place[name] for name in names] if all(name in place for name in names) else []
