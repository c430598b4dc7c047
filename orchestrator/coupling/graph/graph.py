"""Components and connections: checked once, then moved by a few array operations a macro step.

Two kinds of connection: *continuous* ones take part in every exchange; *discrete* ones (either end has FMI
variability ``discrete``, or is no real number) are moved at communication points alone, never inside the
iteration of a macro step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, Self

import numpy as np

from orchestrator.coupling.course import Course
from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.arrays import Arrays, Node
from orchestrator.coupling.graph.links import Connection, GraphError, checked_links
from orchestrator.coupling.graph.loops import AlgebraicLoop
from orchestrator.coupling.graph.order import Dependencies, dependencies_of, derived_order, discrete_loops, levels
from orchestrator.coupling.graph.supply import follow, require_supplied, unfed


class Observer(Protocol):
    """Is told of every accepted step, and can go back when the step is rolled back after all."""

    def __call__(self, t: float, h: float) -> None:
        """All components went from `t` to `t + h`; the inputs of that step are still in `Graph.u`."""

    def departs(self) -> None:
        """A step begins: the discrete connections have been moved."""

    def save(self) -> Any:
        """Return what `restore` needs."""

    def restore(self, saved: Any) -> None:
        """Go back to what was saved."""


class Graph(Arrays):
    """Components, connections, and what follows from them; a context manager that frees the FMUs at its end.

    A graph serves one run: FMUs cannot start anew.

    Parameters
    ----------
    components : name → loaded FMU; names have no dot
    connections : from outputs to inputs; a text is read as ``component.output -> component.input``
    order : Gauss–Seidel order; None derives it: along the connections, inside a loop components with
        feedthrough after those that feed them
    inputs : inputs that follow a course over time, ``component.input``

    Attributes
    ----------
    nodes : the components in Gauss–Seidel order
    feedthrough : component → output → the inputs it depends on without a step, None where the FMU does not say
    observers : are told of every accepted step

    Beside them what `Arrays` has: the values of all connections, of which masters write and read `u` and `y`.

    Raises
    ------
    GraphError
        if a connection cannot be: it says which, why, and what to do
    """

    def __init__(
        self,
        components: Mapping[str, Fmu],
        connections: Iterable[Connection | str],
        order: Sequence[str] | None = None,
        inputs: Mapping[str, Course] | None = None,
    ):
        _name(components)
        self.connections = tuple(Connection.parse(c) if isinstance(c, str) else c for c in connections)
        links = checked_links(components, self.connections)
        self.discrete_loops = discrete_loops(links, components)
        require_supplied(components, self.connections)
        follow(components, self.connections, inputs or {})
        self.feedthrough = dependencies_of(components, initial=False)
        self.order = (
            derived_order(components, links, self.feedthrough) if order is None else _checked_order(order, components)
        )
        super().__init__(components, links, self.order)
        self.observers: list[Observer] = []
        for node in self.nodes:
            node.feedthrough = self._has_feedthrough(node)
            if node.fmu.driven is not None:
                node.fmu.driven.shown = self._depends(node, node.fmu.driven.courses)
        self.stages, _ = self._stages(self.feedthrough)
        read_late = {node.name for stage in self.stages[1:] for node in stage}
        # outputs that feed nothing may depend on inputs too, and are recorded
        self.leaves = [node for node in self.nodes if node.feedthrough and node.name not in read_late]
        self.initial_stages, looped = self._stages(dependencies_of(self.components, initial=True))
        self.loop = AlgebraicLoop(self, looped)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def courses(self) -> dict[str, Course]:
        """The inputs that follow a course over time, ``component.input``, with their courses."""
        driven = {name: fmu.driven for name, fmu in self.components.items() if fmu.driven is not None}
        return {f"{name}.{i}": course for name, one in driven.items() for i, course in one.courses.items()}

    @property
    def unfed(self) -> list[str]:
        """Continuous inputs, ``component.variable``, that keep their start value: nothing feeds them, nobody has set them."""
        made = map(".".join, self.free_rates)
        return unfed(self.components, (c.target for c in self.connections), made)

    # -- outputs at a fixed time ----------------------------------------------------------------------------

    def _has_feedthrough(self, node: Node) -> bool:
        return self._depends(node, node.inputs.names)

    def _depends(self, node: Node, inputs: Iterable[str]) -> bool:
        """Return whether an output of a component depends on one of its `inputs` without a step."""
        fed = {node.fmu.ports[name].variable for name in inputs}
        return any(deps is None or deps & fed for deps in self.feedthrough[node.name].values())

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
                    node.receive_all(self.y)
                    node.inputs.set()
                node.outputs.get_finite()
        self.gather()
        for node in self.leaves:
            node.inputs.set()

    def communicate(self) -> None:
        """Move the discrete connections, and read anew what follows from them without a step: for masters that do not iterate.

        All inputs then belong to one instant. Where a contact point travels along a cable, its motion would else be that of
        the old point, and the contact, which counts from the new one, would take the difference for slip.
        """
        if self.exchange_discrete():
            self.refresh()

    def exchange_discrete(self) -> bool:
        """Move the discrete connections (at a communication point); return whether a number among them has changed."""
        changed = super().exchange_discrete()
        for observer in self.observers:
            observer.departs()
        return changed

    # -- the start ------------------------------------------------------------------------------------------

    def initialize(self, start: float, stop: float | None = None) -> None:
        """Initialise all FMUs consistently: values go along the connections, algebraic loops are solved.

        Many FMUs know their outputs only after their initialisation. So each leaves it in turn, in the order of
        execution, with what the ones before it show by then; where not all did at once, values go round once more before.
        """
        used = [node.name for node in self.nodes if node.fmu.initialized]
        if used:
            raise GraphError(f"{used[0]} has been started before, and FMUs cannot start anew; load the FMUs once more")
        for node in self.nodes:
            node.fmu.enter_initialization(start, stop)
        settled = self._settled(self.initial_stages)
        if settled and self.loop.places.size:
            self.loop.solve(start)
        for node in self.nodes:
            settled = settled or self._settled(self.initial_stages)
            node.receive_all(self.y)
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
            changed = self.exchange_discrete()
            self.refresh(stages)
            if not changed:
                break

    # -- states ---------------------------------------------------------------------------------------------

    def save(self) -> list[SavedState]:
        """Save the states of all components."""
        return [node.fmu.save() for node in self.nodes]

    def restore(self, states: list[SavedState]) -> None:
        """Take all components back to the states saved."""
        for node, state in zip(self.nodes, states, strict=True):
            node.fmu.restore(state)

    def release(self, states: list[SavedState]) -> None:
        """Free saved states."""
        for node, state in zip(self.nodes, states, strict=True):
            node.fmu.release(state)

    def accepted(self, t: float, h: float) -> None:
        """Tell the observers that all components went from `t` to `t + h`."""
        for observer in self.observers:
            observer(t, h)

    def close(self) -> None:
        """Free all instances; none if a call was given up, for it may return and go on with the others."""
        if any(fmu.abandoned for fmu in self.components.values()):
            return
        for fmu in self.components.values():
            fmu.close()


def _name(components: Mapping[str, Fmu]) -> None:
    """Give the FMUs the names of their components; raise `GraphError` where that cannot be."""
    owners: dict[int, str] = {}
    for name, fmu in components.items():
        if "." in name or not name:
            raise GraphError(f"component {name!r}: names are not empty and have no dot; rename it")
        if id(fmu) in owners:
            raise GraphError(f"components {owners[id(fmu)]} and {name} are one instance; load the FMU once for each")
        owners[id(fmu)] = fmu.name = name


def _checked_order(order: Sequence[str], components: Mapping[str, Fmu]) -> tuple[str, ...]:
    if sorted(order) != sorted(components):
        raise GraphError(f"order {', '.join(order)}: must name each of {', '.join(components)} once")
    return tuple(order)
