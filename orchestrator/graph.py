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
from fmpy.model_description import Unit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from orchestrator.derivatives import Partials
from orchestrator.errors import nearest
from orchestrator.fmu import Fmu, FmuError, Group, Port, State, suffixed

LOOP_ITERATIONS, LOOP_TOLERANCE, DIFFERENCE = 20, 1e-11, 1e-6
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
CASTS = {("real", "real"), ("integer", "real"), ("integer", "integer"), ("boolean", "boolean"), ("string", "string")}


class GraphError(ValueError):
    """The graph cannot be built: the message names connection, cause and cure."""


@dataclass(frozen=True)
class Connection:
    """From an output to an input, both as ``component.variable``."""

    source: str
    target: str


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
class _Link:
    """A checked connection."""

    source: tuple[str, str]
    target: tuple[str, str]
    gain: float
    offset: float
    discrete: bool


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
        self._links = _checked_links(self.components, self.connections)
        self.feedthrough = feedthrough = _dependencies(self.components, initial=False)
        derived = self.order is None
        self.order = _derived_order(self.components, self._links, feedthrough) if derived else self._given_order()
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
        self.initial_stages, self._loop = self._stages(_dependencies(self.components, initial=True))

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

    def _kind(self, link: _Link) -> str:
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
        level, loop = _levels(self.links, self._outputs, self.components, dependencies)
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


# -- checks -------------------------------------------------------------------------------------------------


def _checked_links(components: Mapping[str, Fmu], connections: Iterable[Connection]) -> list[_Link]:
    links, fed = [], {}
    for connection in connections:
        link = _checked(components, connection)
        if link.target in fed:
            raise GraphError(
                f"{connection.target} is fed twice, by {fed[link.target]} and by {connection.source}; "
                "drop one of the two"
            )
        fed[link.target] = connection.source
        links.append(link)
    return links


def _checked(components: Mapping[str, Fmu], connection: Connection) -> _Link:
    where = f"connection {connection.source} → {connection.target}"
    source, target = (
        _split(components, connection.source, where),
        _split(components, connection.target, where),
    )
    a, b = components[source[0]].ports[source[1]], components[target[0]].ports[target[1]]
    if a.causality != "output":
        raise GraphError(f"{where}: {connection.source} is no output but {a.causality}; connect from an output")
    if b.causality != "input":
        raise GraphError(f"{where}: {connection.target} is no input but {b.causality}; connect to an input")
    if (a.kind, b.kind) not in CASTS or not _holds(components[target[0]], b, components[source[0]], a):
        raise GraphError(f"{where}: {a.fmi_type} cannot feed {b.fmi_type}; connect variables of one type")
    gain, offset = _conversion(components[source[0]], a, components[target[0]], b, where)
    discrete = "discrete" in (a.variability, b.variability) or b.kind != "real" or a.kind != "real"
    return _Link(source, target, gain, offset, discrete)


def _holds(fmu_b: Fmu, b: Port, fmu_a: Fmu, a: Port) -> bool:
    """Return whether every whole number of the type of `a` has a place in that of `b`."""
    if a.kind != "integer" or "Enumeration" in (a.fmi_type, b.fmi_type):
        return True
    return np.can_cast(fmu_a.fmi.TYPES[a.fmi_type][1], fmu_b.fmi.TYPES[b.fmi_type][1])


def _split(components: Mapping[str, Fmu], signal: str, where: str) -> tuple[str, str]:
    component, _, variable = signal.partition(".")
    if component not in components:
        raise GraphError(f"{where}: no component {component!r}{nearest(component, components)}")
    if variable not in components[component].ports:
        known = components[component].ports
        raise GraphError(f"{where}: {component} has no variable {variable!r}{nearest(variable, known)}")
    return component, variable


def _conversion(fmu_a: Fmu, a: Port, fmu_b: Fmu, b: Port, where: str) -> tuple[float, float]:
    """Return gain and offset from a's unit to b's."""
    if not a.unit or not b.unit or a.unit == b.unit:
        return 1.0, 0.0
    unit_a, unit_b = _unit(fmu_a, a.unit), _unit(fmu_b, b.unit)
    base_a, base_b = unit_a and unit_a.baseUnit, unit_b and unit_b.baseUnit
    if not base_a or not base_b:
        raise GraphError(
            f"{where}: units {a.unit} and {b.unit} differ and are not defined by base units; make them one"
        )
    if any(int(getattr(base_a, e) or 0) != int(getattr(base_b, e) or 0) for e in EXPONENTS):
        raise GraphError(f"{where}: unit {a.unit} is no measure of {b.unit}; connect like with like")
    factor = float(base_b.factor)
    return float(base_a.factor) / factor, (float(base_a.offset) - float(base_b.offset)) / factor


def _unit(fmu: Fmu, name: str) -> Unit | None:
    return next((unit for unit in fmu.description.unitDefinitions if unit.name == name), None)


def _gather(
    links: list[_Link], outputs: list[tuple[str, str]]
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return index, gain and offset that make inputs out of outputs; gain and offset None where nothing is
    converted."""
    place = {signal: i for i, signal in enumerate(outputs)}
    source = np.array([place[k.source] for k in links], dtype=np.intp)
    if all(k.gain == 1.0 and k.offset == 0.0 for k in links):
        return source, None, None
    return source, np.array([k.gain for k in links]), np.array([k.offset for k in links])


# -- order and dependence -----------------------------------------------------------------------------------


Dependencies = dict[str, dict[str, frozenset[str] | None]]


def _dependencies(components: Mapping[str, Fmu], *, initial: bool) -> Dependencies:
    """Return for each component and output variable the inputs it depends on without a step; None: the FMU
    does not say.

    With `initial` what the FMU says about its initialisation goes before what it says about the rest of the
    time.
    """
    table: Dependencies = {}
    for name, fmu in components.items():
        unknowns = [*fmu.description.outputs, *(fmu.description.initialUnknowns if initial else [])]
        table[name] = {
            u.variable.name: None if u.dependencies is None else frozenset(v.name for v in u.dependencies)
            for u in unknowns
            if u.variable is not None
        }
    return table


def _components_of(edges: Iterable[tuple[int, int]], n: int) -> np.ndarray:
    """Return the number of the strongly connected component of each of `n` vertices, sources before what
    they feed."""
    pairs = np.array(sorted(set(edges)), dtype=np.intp).reshape(-1, 2)
    matrix = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, labels = connected_components(matrix, directed=True, connection="strong")
    ranks = _longest_paths([(labels[a], labels[b]) for a, b in pairs if labels[a] != labels[b]], int(labels.max()) + 1)
    return np.array([ranks[label] * (n + 1) + label for label in labels])


def _longest_paths(edges: Sequence[tuple[int, int]], n: int) -> list[int]:
    """Return for each vertex of a graph without cycles the length of the longest path that ends there."""
    rank = [0] * n
    for _ in range(n):
        changed = [(b, rank[a] + 1) for a, b in edges if rank[b] < rank[a] + 1]
        if not changed:
            break
        for b, value in changed:
            rank[b] = max(rank[b], value)
    return rank


def _derived_order(components: Mapping[str, Fmu], links: list[_Link], feedthrough: Dependencies) -> tuple[str, ...]:
    """Return an order along the connections; inside a loop along the feedthrough, else as the components
    were named."""
    names = list(components)
    index = {name: i for i, name in enumerate(names)}
    through = {name: frozenset().union(*(deps or () for deps in table.values())) for name, table in feedthrough.items()}
    continuous = [k for k in links if not k.discrete and k.source[0] != k.target[0]]
    edges = [(index[k.source[0]], index[k.target[0]]) for k in continuous]
    variables = [components[k.target[0]].ports[k.target[1]].variable for k in continuous]
    algebraic = [e for e, k, v in zip(edges, continuous, variables, strict=True) if v in through[k.target[0]]]
    loops, inner = _components_of(edges, len(names)), _components_of(algebraic, len(names))
    depth = _ranks_within(algebraic, inner, len(names))
    return tuple(sorted(names, key=lambda n: (loops[index[n]], depth[index[n]], index[n])))


def _ranks_within(edges: list[tuple[int, int]], label: np.ndarray, n: int) -> list[int]:
    numbers = {int(value): i for i, value in enumerate(sorted(set(label.tolist())))}
    short = [(numbers[int(label[a])], numbers[int(label[b])]) for a, b in edges if label[a] != label[b]]
    ranks = _longest_paths(short, len(numbers))
    return [ranks[numbers[int(label[i])]] for i in range(n)]


def _levels(
    links: list[_Link],
    outputs: list[tuple[str, str]],
    components: Mapping[str, Fmu],
    dependencies: Dependencies,
) -> tuple[dict[tuple[str, str], int], np.ndarray]:
    """Return the stage of every output (0: needs no input) and the places in u of the inputs that are in a
    loop."""
    place = {signal: i for i, signal in enumerate(outputs)}
    edges, inputs = [], []
    for signal in outputs:
        ports = components[signal[0]].ports
        deps = dependencies[signal[0]].get(ports[signal[1]].variable)
        for i, link in enumerate(links):
            if link.target[0] == signal[0] and (deps is None or ports[link.target[1]].variable in deps):
                edges.append((place[link.source], place[signal]))
                inputs.append(i)
    if not edges:
        return dict.fromkeys(outputs, 0), np.array([], dtype=np.intp)
    label = _components_of(edges, len(outputs))
    rank = _ranks_within(edges, label, len(outputs))
    # an output in a loop depends on inputs even if nothing outside feeds the loop
    looped = [label[a] == label[b] for a, b in edges]
    offset = 1 if any(flag and rank[a] == 0 for (a, _), flag in zip(edges, looped, strict=True)) else 0
    fed = {b for _, b in edges}
    level = {s: rank[i] + (offset if i in fed else 0) for s, i in place.items()}
    loop = sorted({i for i, flag in zip(inputs, looped, strict=True) if flag})
    return level, np.array(loop, dtype=np.intp)
