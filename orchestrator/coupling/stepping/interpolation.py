"""Inputs within a macro step: their history, its extrapolation, means and slopes."""

from __future__ import annotations

from collections import deque

import numpy as np

from orchestrator.coupling.exchange import MEAN, RATE, exchange_named, is_motion
from orchestrator.coupling.graph.graph import Graph, Node


class History:
    """The last values of a vector and the polynomial through them.

    Parameters
    ----------
    order : degree of the polynomial, 0, 1 or 2; lower as long as there are fewer values
    """

    def __init__(self, order: int):
        if order not in (0, 1, 2):
            raise ValueError(f"extrapolation order {order}: choose 0, 1 or 2")
        self.order = order
        self.points: deque[tuple[float, np.ndarray]] = deque(maxlen=order + 1)

    def append(self, t: float, values: np.ndarray) -> None:
        """Remember `values` (n,) at time `t`; an earlier entry of the same time is replaced."""
        if self.points and self.points[0][0] == t:
            self.points.popleft()
        self.points.appendleft((t, values.copy()))

    def clear(self) -> None:
        """Forget everything."""
        self.points.clear()

    def coefficients(self, t: float, H: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return c, a, b of c + a s + b s² with s = (time - t)/H: Newton's divided differences, each (n,)."""
        nodes = [((time - t) / H, values) for time, values in self.points]
        (s0, x0), zero = nodes[0], np.zeros_like(nodes[0][1])
        if len(nodes) == 1:
            return x0, zero, zero
        s1, x1 = nodes[1]
        d01 = (x0 - x1) / (s0 - s1)
        if len(nodes) == 2:
            return x0 - d01 * s0, d01, zero
        s2, x2 = nodes[2]
        d012 = (d01 - (x1 - x2) / (s1 - s2)) / (s0 - s2)
        return x0 - d01 * s0 + d012 * s0 * s1, d01 - d012 * (s0 + s1), d012


class Loads:
    """Which inputs are held as mean and slope over a step, and which a master may interpolate itself.

    Names and units say it (`orchestrator.coupling.exchange`). A load is held as `value` + `rate` (tau - t - H/2), a motion
    is given at the end of the step. Where a source feeds value *and* rate (or mean), it knows the course inside the step better
    than a master does: those inputs are passed on as they come. All others are values at an instant.

    Attributes
    ----------
    fed : (m, 2) int, places in `Graph.u` of a load and of its rate, where something feeds the rate
    instant : (n,) int, places in `Graph.u` of values at an instant
    """

    def __init__(self, graph: Graph):
        rate, mean = graph.companion(RATE), graph.companion(MEAN)
        loads = np.flatnonzero((rate >= 0) & (mean < 0))
        self.fed = np.stack([loads, rate[loads]], axis=1)
        passed = np.zeros(graph.u.size, dtype=bool)
        for companion in (rate, mean):
            passed[companion >= 0] = True
            passed[companion[companion >= 0]] = True
        for node in graph.nodes:  # who takes means rebuilds the course of its inputs from their ends, but for loads
            if _takes_means(node):
                own = np.arange(node.first, node.first + len(node.inputs.names))
                passed[np.setdiff1d(own, graph.rate_of)] = True
        self.instant = np.flatnonzero(~passed)


def _takes_means(node: Node) -> bool:
    """Return whether a component has inputs for the time means of others, and does not hold its inputs all the same."""
    ports, names = node.fmu.ports, node.fmu.vocabulary
    told = any(port.causality == "input" and is_motion(name, names) for name, port in ports.items())
    return told and not exchange_named(node.fmu.exchange).holds


class Between:
    """Linear interpolation, between the ends of a macro step, of the inputs that are values at an instant.

    A component receives the mean of the two ends, and their slope where it has an input for it.

    Parameters
    ----------
    torn : whether inputs from later components are interpolated too
    """

    def __init__(self, graph: Graph, loads: Loads, *, torn: bool):
        self.graph = graph
        self.start_values = graph.u.copy()
        self.places = {node.name: self._places(node, loads, torn) for node in graph.nodes}
        self.rates = {name: np.flatnonzero(np.isin(graph.rate_of, places)) for name, places in self.places.items()}

    @staticmethod
    def _places(node: Node, loads: Loads, torn: bool) -> np.ndarray:
        first = node.first + (0 if torn else node.torn)
        last = node.first + len(node.inputs.names)
        return loads.instant[(loads.instant >= first) & (loads.instant < last)]

    def begin(self) -> None:
        """Remember the inputs at the start of the step."""
        self.start_values[:] = self.graph.u

    def interpolate(self, name: str, H: float) -> None:
        """Turn the end values of a component's inputs, in `Graph.u`, into mean and slope over the step."""
        places, rates = self.places[name], self.rates[name]
        if not places.size:
            return
        u, start = self.graph.u, self.start_values
        if rates.size:
            loads = self.graph.rate_of[rates]
            self.graph.r[rates] = (u[loads] - start[loads]) / H
        u[places] = 0.5 * (u[places] + start[places])


def step_node(between: Between | None, node: Node, t: float, H: float) -> None:
    """Step one component with the inputs in the graph, interpolated by `between` if given; read its
    outputs."""
    begin_node(between, node, t, H)
    finish_node(node, t, H)


def begin_node(between: Between | None, node: Node, t: float, H: float) -> None:
    """Give a component its inputs, interpolated by `between` if given, and start its step."""
    node.ends = None
    if between is not None and between.places[node.name].size:
        node.ends = node.inputs.values.copy()
        between.interpolate(node.name, H)
    if node.inputs.names:
        node.inputs.set()
    if node.rates.names:
        node.rates.set()
    node.fmu.begin(t, H)


def finish_node(node: Node, t: float, H: float) -> None:
    """Make the step that was begun; read the outputs."""
    node.fmu.step(t, H)
    node.acted[:] = node.inputs.values
    if node.ends is not None:
        node.inputs.values[:] = node.ends
        if node.feedthrough:
            node.inputs.set()
    node.outputs.get_finite()
