"""Inputs and outputs of all components as arrays, and the few array operations that move values between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.exchange import RATE, is_companion, is_load, suffixed
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.links import Link, Signal


class Transfer:
    """Values moved from outputs to the inputs that they feed: input = gain * output + offset.

    Parameters
    ----------
    source : (n,) int, for each input the place of its output
    scaling : gain and offset, (n,) each; None where nothing is converted
    """

    def __init__(self, source: np.ndarray, scaling: tuple[np.ndarray, np.ndarray] | None = None):
        self.source, self.scaling = source, scaling

    @classmethod
    def along(cls, links: Sequence[Link], outputs: Sequence[Signal]) -> Transfer:
        """Return what makes the inputs of `links` out of `outputs`."""
        place = {signal: i for i, signal in enumerate(outputs)}
        source = np.array([place[k.source] for k in links], dtype=np.intp)
        if all(k.gain == 1.0 and k.offset == 0.0 for k in links):
            return cls(source)
        return cls(source, (np.array([k.gain for k in links]), np.array([k.offset for k in links])))

    @property
    def size(self) -> int:
        """Number of inputs."""
        return self.source.size

    def part(self, places: slice | np.ndarray) -> Transfer:
        """Return what moves the inputs at `places` alone."""
        scaling = self.scaling and (self.scaling[0][places], self.scaling[1][places])
        return Transfer(self.source[places], scaling)

    def move(self, outputs: np.ndarray, inputs: np.ndarray) -> None:
        """Write the `inputs` (n,) from the `outputs`."""
        outputs.take(self.source, out=inputs, mode="clip")
        if self.scaling is not None:
            np.multiply(inputs, self.scaling[0], out=inputs)
            np.add(inputs, self.scaling[1], out=inputs)

    def moved(self, outputs: np.ndarray, places: slice | np.ndarray) -> np.ndarray:
        """Return what the `outputs` say about the inputs at `places`, (len(places),)."""
        values = outputs[self.source[places]]
        return values if self.scaling is None else values * self.scaling[0][places] + self.scaling[1][places]


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
    first, torn : place of its first input in `Graph.u`, and how many of its inputs are torn
    incoming, forward : move all its inputs, those after the torn ones, from `Graph.y`
    forward_values : view of `Graph.u`, the inputs after the torn ones
    feedthrough : whether one of the outputs depends on one of the inputs without a step
    ends : its inputs at the end of the step that is being made, where other values act in it
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
    incoming: Transfer
    forward: Transfer
    forward_values: np.ndarray
    feedthrough: bool = False
    ends: np.ndarray | None = None

    def receive(self, y: np.ndarray) -> None:
        """Take the inputs that are not torn from the outputs `y`."""
        self.forward.move(y, self.forward_values)

    def receive_all(self, y: np.ndarray) -> None:
        """Take all inputs from the outputs `y`, torn ones too."""
        self.incoming.move(y, self.inputs.values)


class Arrays:
    """The values of all connections, component after component in the order of execution.

    Parameters
    ----------
    components : name → FMU
    links : checked connections
    order : the components in the order of execution

    Attributes
    ----------
    u : (n_u,) continuous inputs of all components, in their units
    acted : (n_u,) what acted in the last step: a master that interpolates takes `u` to the end of the step afterwards
    y : (n_y,) continuous outputs
    d, e : discrete inputs and outputs that are numbers
    r : (n_r,) rates of loads that no connection feeds (`free_rates`), for the master to set; `rate_of` (n_r,) are
        the loads' places in u
    links : the continuous connections, one for each place in u
    torn : (n_t,) places in `u` that are fed by a component later in the order (or itself): the unknowns of
        implicit masters
    input_names : of the places in u, ``component.variable``
    nodes : the components in the order of execution
    """

    def __init__(self, components: Mapping[str, Fmu], links: Sequence[Link], order: Sequence[str]):
        self.components = dict(components)
        rank = {name: i for i, name in enumerate(order)}
        self.texts = [k for k in links if self._kind(k) == "string"]
        numbers = [k for k in links if self._kind(k) != "string"]
        self._allocate_continuous([k for k in numbers if not k.discrete], rank)
        self._allocate_discrete([k for k in numbers if k.discrete], rank)
        signals = (self._inputs, self._outputs, self._discrete_inputs, self._discrete_outputs, self.free_rates)
        places = [_slices(some) for some in signals]
        self.nodes = [self._node(name, *(some.get(name, slice(0, 0)) for some in places)) for name in order]
        self.discrete = [n for n in self.nodes if n.discrete_inputs.names or n.discrete_outputs.names]

    def _kind(self, link: Link) -> str:
        return self.components[link.source[0]].ports[link.source[1]].kind

    def _allocate_continuous(self, links: list[Link], rank: Mapping[str, int]) -> None:
        # torn inputs first within each component, so that both kinds are one slice
        self.links = sorted(links, key=lambda k: (rank[k.target[0]], rank[k.source[0]] < rank[k.target[0]]))
        self._inputs, self._outputs = [k.target for k in self.links], _outputs(self.links, rank)
        self.u, self.acted, self.y = np.zeros(len(links)), np.zeros(len(links)), np.zeros(len(self._outputs))
        self._continuous = Transfer.along(self.links, self._outputs)
        torn = [i for i, k in enumerate(self.links) if rank[k.source[0]] >= rank[k.target[0]]]
        self.torn = np.array(torn, dtype=np.intp)
        self.input_names = [".".join(target) for target in self._inputs]
        self.free_rates, self.rate_of = self._free_rates()
        self.r = np.zeros(len(self.free_rates))

    def _allocate_discrete(self, links: list[Link], rank: Mapping[str, int]) -> None:
        links = sorted(links, key=lambda k: rank[k.target[0]])
        self._discrete_inputs, self._discrete_outputs = [k.target for k in links], _outputs(links, rank)
        self.d, self.e = np.zeros(len(links)), np.zeros(len(self._discrete_outputs))
        self._discrete = Transfer.along(links, self._discrete_outputs)

    def _free_rates(self) -> tuple[list[Signal], np.ndarray]:
        """Return the inputs ``_rate`` of connected loads that nothing feeds and nobody has set, and the places of those
        loads in u."""
        fed = set(self._inputs)
        rates, places = [], []
        for i, (component, name) in enumerate(self._inputs):
            fmu, rate = self.components[component], (component, suffixed(name, RATE))
            held = rate in fed or rate[1] in fmu.parameters
            if is_load(name, fmu.vocabulary) and fmu.ports[rate[1]].causality == "input" and not held:
                rates.append(rate)
                places.append(i)
        return rates, np.array(places, dtype=np.intp)

    def _node(
        self, name: str, inputs: slice, outputs: slice, discrete_inputs: slice, discrete_outputs: slice, rates: slice
    ) -> Node:
        """Return a component, given where its signals are in the arrays."""
        fmu = self.components[name]
        torn = int(np.sum((self.torn >= inputs.start) & (self.torn < inputs.stop)))
        forward = slice(inputs.start + torn, inputs.stop)
        return Node(
            name,
            fmu,
            inputs=_group(fmu, self._inputs, inputs, self.u),
            outputs=_group(fmu, self._outputs, outputs, self.y),
            discrete_inputs=_group(fmu, self._discrete_inputs, discrete_inputs, self.d),
            discrete_outputs=_group(fmu, self._discrete_outputs, discrete_outputs, self.e),
            rates=_group(fmu, self.free_rates, rates, self.r),
            acted=self.acted[inputs],
            first=inputs.start,
            torn=torn,
            incoming=self._continuous.part(inputs),
            forward=self._continuous.part(forward),
            forward_values=self.u[forward],
        )

    def gather(self) -> None:
        """Move all continuous outputs to the inputs: u from y."""
        self._continuous.move(self.y, self.u)

    def gathered(self, places: slice | np.ndarray) -> np.ndarray:
        """Return what the outputs say about the inputs at `places` of u: (len(places),)."""
        return self._continuous.moved(self.y, places)

    def exchange_discrete(self) -> bool:
        """Move the discrete connections (at a communication point); return whether a number among them has changed."""
        for link in self.texts:
            self.components[link.target[0]].write(link.target[1], self.components[link.source[0]].read(link.source[1]))
        if not self.d.size:
            return False
        before = self.d.copy()
        for node in self.discrete:
            node.discrete_outputs.get_finite()
        self._discrete.move(self.e, self.d)
        for node in self.discrete:
            node.discrete_inputs.set()
        return not np.array_equal(before, self.d)

    def companion(self, suffix: str) -> np.ndarray:
        """Return for each place in u the place of its companion (`RATE` or `MEAN`) of the same component, or -1."""
        place = {name: i for i, name in enumerate(self.input_names) if self._is_meant(i)}
        return np.array([place.get(suffixed(name, suffix), -1) for name in self.input_names], dtype=np.intp)

    def _is_meant(self, place: int) -> bool:
        """Return whether the name of an input means what it says, or what feeds it is the slope or the mean of a source."""
        ends = self.links[place].target, self.links[place].source
        (mine, taker), (theirs, giver) = ((name, self.components[owner].vocabulary) for owner, name in ends)
        return mine in taker or (theirs in giver and is_companion(theirs))


def _outputs(links: Sequence[Link], rank: Mapping[str, int]) -> list[Signal]:
    """Return the outputs that feed `links`, each once, component after component."""
    return sorted(dict.fromkeys(k.source for k in links), key=lambda signal: rank[signal[0]])


def _slices(signals: Sequence[Signal]) -> dict[str, slice]:
    """Return for each component where its own are among `signals`: they stand together."""
    found: dict[str, slice] = {}
    for i, (owner, _) in enumerate(signals):
        found[owner] = slice(found[owner].start if owner in found else i, i + 1)
    return found


def _group(fmu: Fmu, signals: Sequence[Signal], places: slice, values: np.ndarray) -> Group:
    """Return a handle on the signals at `places`, whose values are a slice of `values`."""
    return fmu.group([name for _, name in signals[places]], values[places])
