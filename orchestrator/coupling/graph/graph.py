"""Components and connections: checked once, then moved by a few array operations a macro step.

Two kinds of connection: *continuous* ones take part in every exchange; *discrete* ones (either end has FMI
variability ``discrete``, or is no real number) are moved at communication points alone, never inside the
iteration of a macro step.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from orchestrator.coupling.exchange import suffixed
from orchestrator.coupling.fmu.derivatives import Partials
from orchestrator.coupling.fmu.instance import Fmu, FmuError, Group, State
from orchestrator.coupling.graph.links import Connection, GraphError, Link, checked_links
from orchestrator.coupling.graph.order import Dependencies, dependencies_of, derived_order, levels

LOOP_ITERATIONS, LOOP_TOLERANCE, DIFFERENCE = 20, 1e-11, 1e-6


class Observer(Protocol):
    """Is told of every accepted step, and can go back when the step is rolled back after all."""

    def __call__(self, t: float, h: float) -> None:
        """All components went from `t` to `t + h`; the inputs of that step are still in `Graph.u`."""

    def save(self) -> Any:
        """Return what `restore` needs."""

    def restore(self, saved: Any) -> None:
        """Go back to what was saved."""


@dataclass
class Node:
    """One component and its place in the arrays of the graph.

    Attributes
    ----------
    inputs : continuous inputs, torn ones first; their values are a slice of `Graph.u`
    outputs : outputs that feed continuous connections; a slice of `Graph.y`
    discrete_inputs, discrete_outputs : the same for discrete connections; slices of `Graph.d`, `Graph.e`
    rates : inputs ``_rate`` of its loads that nothing feeds; a slice of `Graph.r`
    acted : its slice of `Graph.acted`
    forward : (m,) int, where in `Graph.y` the inputs after the torn ones come from
    forward_values : (m,) view of `Graph.u`
    feedthrough : whether one of the outputs depends on one of the inputs without a step
    """

    name: str
    fmu: Fmu
    inputs: Group
    outputs: Group
    discrete_inputs: Group
    discrete_outputs: Group
    rates: Group
    acted: np.ndarray
    first: int
    torn: int
    forward: np.ndarray
    forward_values: np.ndarray
    gain: np.ndarray | None
    offset: np.ndarray | None
    feedthrough: bool = False

    def receive(self, y: np.ndarray) -> None:
        """Take the inputs that are not torn from the outputs `y`."""
        y.take(self.forward, out=self.forward_values, mode="clip")
        if self.gain is not None and self.offset is not None:
            np.multiply(self.forward_values, self.gain, out=self.forward_values)
            np.add(self.forward_values, self.offset, out=self.forward_values)


@dataclass
class Graph:
    """Components, connections, and what follows from them.

    Parameters
    ----------
    components : name → loaded FMU
    connections : from outputs to inputs
    order : Gauss–Seidel order; None derives it: along the connections, inside a loop components with
        feedthrough after those that feed them

    Attributes
    ----------
    u : (n_u,) continuous inputs of all components, in their units
    acted : (n_u,) what acted in the last step: a master that interpolates takes `u` to the end of the step afterwards
    y : (n_y,) continuous outputs
    r : (n_r,) rates of loads that no connection feeds (`free_rates`), for the master to set; `rate_of` (n_r,) are
        the loads' places in u
    source, gain, offset : (n_u,) u = gain * y[source] + offset; `gain` is None when all are 1 and 0
    torn : (n_t,) places in `u` that are fed by a component later in the order (or itself): the unknowns of
        implicit masters
    nodes : the components in Gauss–Seidel order
    feedthrough : component → output → the inputs it depends on without a step, None where the FMU does not say
    observers : are told of every accepted step
    """

    components: Mapping[str, Fmu]
    connections: Iterable[Connection]
    order: Sequence[str] | None = None
    observers: list[Observer] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.components = dict(self.components)
        self.connections = tuple(self.connections)
        for name, fmu in self.components.items():
            if "." in name or not name:
                raise GraphError(f"component {name!r}: names are not empty and have no dot; rename it")
            fmu.name = name
        self._links = checked_links(self.components, self.connections)
        self.feedthrough = feedthrough = dependencies_of(self.components, initial=False)
        derived = self.order is None
        self.order = derived_order(self.components, self._links, feedthrough) if derived else self._given_order()
        self._allocate()
        self.nodes = [self._node(name) for name in self.order]
        self.discrete = [n for n in self.nodes if n.discrete_inputs.names or n.discrete_outputs.names]
        self.stages, _ = self._stages(feedthrough)
        read_late = {node.name for stage in self.stages[1:] for node in stage}
        for node in self.nodes:
            node.feedthrough = any(
                deps is None or deps & {node.fmu.ports[name].variable for name in node.inputs.names}
                for deps in feedthrough[node.name].values()
            )
        # outputs that feed nothing may depend on inputs too, and are recorded
        self.leaves = [node for node in self.nodes if node.feedthrough and node.name not in read_late]
        self.initial_stages, self._loop = self._stages(dependencies_of(self.components, initial=True))

    def _given_order(self) -> tuple[str, ...]:
        order = tuple(self.order or ())
        if sorted(order) != sorted(self.components):
            raise GraphError(f"order {', '.join(order)}: must name each of {', '.join(self.components)} once")
        return order

    # -- arrays ---------------------------------------------------------------------------------------------

    def _allocate(self) -> None:
        rank = {name: i for i, name in enumerate(self.order or ())}
        self.texts = [k for k in self._links if self._kind(k) == "string"]
        links = [k for k in self._links if k not in self.texts]
        continuous = [k for k in links if not k.discrete]
        # torn inputs first within each component, so that both kinds are one slice
        continuous.sort(key=lambda k: (rank[k.target[0]], rank[k.source[0]] < rank[k.target[0]]))
        discrete = sorted((k for k in links if k.discrete), key=lambda k: rank[k.target[0]])
        self.links = continuous
        self._inputs, self._discrete_inputs = [k.target for k in continuous], [k.target for k in discrete]
        self._outputs = sorted(dict.fromkeys(k.source for k in continuous), key=lambda s: rank[s[0]])
        self._discrete_outputs = sorted(dict.fromkeys(k.source for k in discrete), key=lambda s: rank[s[0]])
        self.u, self.y = np.zeros(len(continuous)), np.zeros(len(self._outputs))
        self.acted = self.u.copy()
        self.d, self.e = np.zeros(len(discrete)), np.zeros(len(self._discrete_outputs))
        self.source, self.gain, self.offset = _gather(continuous, self._outputs)
        self.discrete_source, self.discrete_gain, self.discrete_offset = _gather(discrete, self._discrete_outputs)
        torn = [i for i, k in enumerate(continuous) if rank[k.source[0]] >= rank[k.target[0]]]
        self.torn = np.array(torn, dtype=np.intp)
        self.input_names = [".".join(target) for target in self._inputs]
        self.free_rates, self.rate_of = self._free_rates()
        self.r = np.zeros(len(self.free_rates))

    def _kind(self, link: Link) -> str:
        return self.components[link.source[0]].ports[link.source[1]].kind

    def _free_rates(self) -> tuple[list[tuple[str, str]], np.ndarray]:
        """Return the inputs ``_rate`` of connected loads that nothing feeds, and the places of those loads
        in u."""
        fed = set(self._inputs)
        rates, places = [], []
        for i, (component, name) in enumerate(self._inputs):
            ports, rate = self.components[component].ports, (component, suffixed(name, "_rate"))
            known = rate[1] in ports and ports[rate[1]].causality == "input" and suffixed(name, "_mean") not in ports
            if known and rate not in fed:
                rates.append(rate)
                places.append(i)
        return rates, np.array(places, dtype=np.intp)

    def _node(self, name: str) -> Node:
        fmu = self.components[name]

        def group(signals: list[tuple[str, str]], values: np.ndarray) -> Group:
            mine = [i for i, (component, _) in enumerate(signals) if component == name]
            places = slice(mine[0], mine[-1] + 1) if mine else slice(0, 0)
            return fmu.group([signals[i][1] for i in mine], values[places])

        inputs = group(self._inputs, self.u)
        first = next((i for i, (component, _) in enumerate(self._inputs) if component == name), 0)
        torn = int(np.sum((self.torn >= first) & (self.torn < first + len(inputs.names))))
        forward = slice(first + torn, first + len(inputs.names))
        return Node(
            name,
            fmu,
            inputs,
            group(self._outputs, self.y),
            group(self._discrete_inputs, self.d),
            group(self._discrete_outputs, self.e),
            group(self.free_rates, self.r),
            self.acted[first : first + len(inputs.names)],
            first,
            torn,
            self.source[forward],
            self.u[forward],
            None if self.gain is None else self.gain[forward],
            None if self.offset is None else self.offset[forward],
        )

    def gather(self) -> None:
        """Move all continuous outputs to the inputs: u from y."""
        self.y.take(self.source, out=self.u, mode="clip")
        if self.gain is not None and self.offset is not None:
            np.multiply(self.u, self.gain, out=self.u)
            np.add(self.u, self.offset, out=self.u)

    def gathered(self, places: np.ndarray) -> np.ndarray:
        """Return what the outputs say about the inputs at `places` of u: (len(places),)."""
        values = self.y[self.source[places]]
        return values if self.gain is None or self.offset is None else values * self.gain[places] + self.offset[places]

    def exchange_discrete(self) -> None:
        """Move the discrete connections (at a communication point)."""
        for link in self.texts:
            self.components[link.target[0]].write(link.target[1], self.components[link.source[0]].read(link.source[1]))
        if not self.d.size:
            return
        for node in self.discrete:
            node.discrete_outputs.get_finite()
        self.e.take(self.discrete_source, out=self.d, mode="clip")
        if self.discrete_gain is not None and self.discrete_offset is not None:
            self.d[:] = self.d * self.discrete_gain + self.discrete_offset
        for node in self.discrete:
            node.discrete_inputs.set()

    # -- outputs at a fixed time ----------------------------------------------------------------------------

    def _stages(self, dependencies: Dependencies) -> tuple[list[list[Node]], np.ndarray]:
        """Return the nodes to read, stage after stage (an output is read after the inputs it depends on are
        set), and the places in u of the inputs in algebraic loops."""
        level, loop = levels(self.links, self._outputs, self.components, dependencies)
        depth = max(level.values(), default=0) + 1
        members = [{s[0] for s, value in level.items() if value == i} for i in range(depth)]
        return [[n for n in self.nodes if n.name in names] for names in members], loop

    def refresh(self, stages: list[list[Node]] | None = None) -> None:
        """Read all outputs at the present time, feedthrough in the order of dependence, and gather the
        inputs."""
        for i, stage in enumerate(self.stages if stages is None else stages):
            for node in stage:
                if i:
                    node_inputs(self, node)
                    node.inputs.set()
                node.outputs.get_finite()
        self.gather()
        for node in self.leaves:
            node.inputs.set()

    def initialize(self, start: float, stop: float | None = None) -> None:
        """Initialise all FMUs consistently: values go along the connections, algebraic loops are solved.

        Many FMUs know their outputs only after their initialisation. So each leaves it in turn, in the order of
        execution, with what the ones before it show by then.
        """
        for node in self.nodes:
            node.fmu.enter_initialization(start, stop)
        if self._settled(self.initial_stages) and self._loop.size:
            self._solve_loops(start)
        for node in self.nodes:
            node_inputs(self, node)
            node.inputs.set()
            node.fmu.exit_initialization()
            node.outputs.get()
        self._settle(self.stages)

    def _settled(self, stages: list[list[Node]]) -> bool:
        """Settle as far as the FMUs know their outputs; return whether all do, else the rest is zero for now."""
        try:
            self._settle(stages)
        except FmuError as error:
            if not error.recoverable:
                raise
            for values in (self.y, self.e, self.d):
                values[~np.isfinite(values)] = 0.0
            return False
        return True

    def _settle(self, stages: list[list[Node]]) -> None:
        """Move all values, discrete ones too, until they stay: they go at most through all components."""
        self.refresh(stages)
        for _ in self.nodes:
            before = self.d.copy()
            self.exchange_discrete()
            self.refresh(stages)
            if np.array_equal(before, self.d):
                break

    def _loop_residual(self, z: np.ndarray) -> np.ndarray:
        """Set the inputs in algebraic loops to `z`; return how far the outputs contradict them."""
        self.gather()
        self.u[self._loop] = z
        for node in self.nodes:
            node.inputs.set()
        for node in self.nodes:
            node.outputs.get_finite()
        return self.gathered(self._loop) - z

    def _solve_loops(self, start: float) -> None:
        """Solve for the inputs that are part of an algebraic loop, with derivatives where FMUs give them."""
        z, y = self.gathered(self._loop), self.y.copy()
        own = [node for node in self.nodes if node.fmu.capabilities.directional_derivatives]
        # derivatives that are wrong only cost iterations; if too many, differences have the last word
        with contextlib.suppress(FmuError, np.linalg.LinAlgError):
            if own and self._newton(z, own):
                return
        self.y[:] = y
        if self._newton(z, []):
            return
        names = ", ".join(self.input_names[i] for i in self._loop[:3])
        message = f"the algebraic loop through {names} … has no solution near the start values; change them"
        raise FmuError(self.nodes[0].name, start, 2, message)

    def _newton(self, z: np.ndarray, own: list[Node]) -> bool:
        """Newton's method from `z` with the derivatives of `own`, else differences; return whether it converged."""
        for _ in range(LOOP_ITERATIONS):
            r = self._loop_residual(z)
            if np.max(np.abs(r) / (np.abs(z) + 1.0)) <= LOOP_TOLERANCE:
                self.gather()
                return True
            jacobian = np.full((z.size, z.size), np.nan)
            for node in own:
                self._own_derivatives(node, jacobian)
            for j in np.flatnonzero(np.isnan(jacobian[0])):
                shifted = z.copy()
                shifted[j] += DIFFERENCE * (1.0 + abs(z[j]))
                jacobian[:, j] = (self._loop_residual(shifted) - r) / (shifted[j] - z[j])
            z = z - np.linalg.lstsq(jacobian, r, rcond=None)[0]
        return False

    def _own_derivatives(self, node: Node, jacobian: np.ndarray) -> None:
        """Write the columns of the loop's Jacobian that belong to inputs of `node`, if its FMU knows them."""
        mine = [j for j, place in enumerate(self._loop) if self._inputs[place][0] == node.name]
        rows = [i for i, place in enumerate(self._loop) if self.links[place].source[0] == node.name]
        links = [self.links[self._loop[i]] for i in rows]
        partials = Partials(node.fmu, [k.source[1] for k in links], [self._inputs[self._loop[j]][1] for j in mine])
        matrix = partials() if mine else None
        if matrix is None:
            return
        jacobian[:, mine] = -np.eye(len(self._loop))[:, mine]
        jacobian[np.ix_(rows, mine)] += np.array([[k.gain] for k in links]) * matrix

    # -- states ---------------------------------------------------------------------------------------------

    def save(self) -> list[State]:
        """Save the states of all components."""
        return [node.fmu.save() for node in self.nodes]

    def restore(self, states: list[State]) -> None:
        """Take all components back to the states saved."""
        for node, state in zip(self.nodes, states, strict=True):
            node.fmu.restore(state)

    def release(self, states: list[State]) -> None:
        """Free saved states."""
        for node, state in zip(self.nodes, states, strict=True):
            node.fmu.release(state)

    def accepted(self, t: float, h: float) -> None:
        """Tell the observers that all components went from `t` to `t + h`."""
        for observer in self.observers:
            observer(t, h)

    def companion(self, suffix: str) -> np.ndarray:
        """Return for each place in u the place of its ``_rate`` or ``_mean`` companion of the same
        component, or -1."""
        place = {name: i for i, name in enumerate(self.input_names)}
        return np.array([place.get(suffixed(name, suffix), -1) for name in self.input_names], dtype=np.intp)

    def close(self) -> None:
        """Free all instances; none if a call was given up, for it may return and go on with the others."""
        if any(fmu.abandoned for fmu in self.components.values()):  # type: ignore[union-attr]
            return
        for fmu in self.components.values():  # type: ignore[union-attr]
            fmu.close()


def node_inputs(graph: Graph, node: Node) -> None:
    """Gather all continuous inputs of one node, torn ones too."""
    places = slice(node.first, node.first + len(node.inputs.names))
    values = graph.y[graph.source[places]]
    if graph.gain is not None and graph.offset is not None:
        values = values * graph.gain[places] + graph.offset[places]
    node.inputs.values[:] = values


def _gather(
    links: list[Link], outputs: list[tuple[str, str]]
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return index, gain and offset that make inputs out of outputs; gain and offset None where nothing is
    converted."""
    place = {signal: i for i, signal in enumerate(outputs)}
    source = np.array([place[k.source] for k in links], dtype=np.intp)
    if all(k.gain == 1.0 and k.offset == 0.0 for k in links):
        return source, None, None
    return source, np.array([k.gain for k in links]), np.array([k.offset for k in links])
