"""What can be run: a landing or a general graph, each resolved once; what both can be asked is the same."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from fmus.cable.mesh import TOLERANCE
from orchestrator.catalogue import library
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.modules import description
from orchestrator.coupling.course import Course
from orchestrator.coupling.errors import digits
from orchestrator.coupling.exchange import (
    EXCHANGES,
    PARAMETER,
    RATE,
    Choice,
    exchange_named,
    is_companion,
    is_rate_of_motion,
    stems,
    suffixed,
    suited_to,
)
from orchestrator.coupling.fmu.description import structure_of
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import instance
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, owner_of, variable_of
from orchestrator.coupling.graph.supply import Missing, Supply, chosen
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.columns import some_of
from orchestrator.coupling.run.results import Fields, Table
from orchestrator.landing import audit
from orchestrator.landing.build import has_monolithic, problem
from orchestrator.landing.contract import is_control, is_unused
from orchestrator.landing.fields import SHAPES, cable_fields, tension_of
from orchestrator.landing.geometry import geometry
from orchestrator.landing.impacts import Impact, impacts
from orchestrator.landing.limits import limits_of
from orchestrator.landing.resolve import MESH_KEYS, MESH_TOLERANCE, Landing, Variables
from orchestrator.landing.resolve import resolve as resolve_landing
from orchestrator.landing.safety import Limits, Safety, judge
from orchestrator.landing.trial.remembered import said
from orchestrator.landing.wiring import inner_step, lacking, landing_graph
from orchestrator.runs.foreign import departing
from orchestrator.scenario.isolation import isolation
from orchestrator.scenario.over_time import courses, held
from orchestrator.scenario.types import CableSection, Component, GraphScenario, LandingScenario, RobotSection, Scenario

if TYPE_CHECKING:
    from orchestrator.landing.monolithic import Problem

INNER_STEP = "integration_step"
Stepped = TypeVar("Stepped", CableSection, RobotSection, Component)


MESH_RATIO = 1.5
"""Number of elements of a finer mesh over that of the run's."""


@dataclass(frozen=True)
class Meshed:
    """A system with a finer mesh.

    Attributes
    ----------
    ratio : length of the run's elements over that of the finer ones; infinite where the run's mesh does not fit the landing
        and one that does is in its place: the difference is then the error
    """

    system: System
    ratio: float


class System(Protocol):
    """A scenario resolved."""

    @property
    def scenario(self) -> Scenario:
        """What it was made from."""
        ...

    @property
    def exchange(self) -> str | None:
        """The exchange that is asked for; None where each component has its own."""
        ...

    def graph(self) -> Graph:
        """Return the graph of newly loaded FMUs."""
        ...

    def notes(self, graph: Graph) -> list[str]:
        """Return what of the wiring of `graph` its author may not expect, a line each."""
        ...

    def problem(self) -> Callable[[], Problem] | None:
        """Return what makes the monolithic problem; None where there is none."""
        ...

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return what of the signals makes arrays over time, and the other signals."""
        ...

    def about(self, table: Table) -> dict[str, Any]:
        """Return what ``summary.json`` says of this kind of system alone."""
        ...

    def warnings(self, table: Table) -> list[str]:
        """Return what makes the results of a run doubtful, a line each."""
        ...

    def impacts(self, table: Table) -> list[Impact]:
        """Return the impacts of wheels on a cable, and how long each lasts."""
        ...

    def safety(
        self,
        table: Table,
        fields: Mapping[str, np.ndarray],
        errors: Mapping[str, float] | None = None,
        fault: str | None = None,
    ) -> Safety | None:
        """Return whether a landing was safe, parameters as for `judge`; None of what is no landing."""
        ...

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> System:
        """Return it with other options of the master and other simulation settings (macro_step, …)."""
        ...

    def stepped(self, ratio: float, longest: float = np.inf) -> System:
        """Return it with the inner steps of all components that have them `ratio` times as long, whatever the macro step;
        those above the `longest` (s) stay."""
        ...

    def meshed(self, ratio: float = MESH_RATIO) -> Meshed | None:
        """Return it with a finer mesh; None where there is no mesh, or it is that of a foreign FMU."""
        ...


@dataclass(frozen=True)
class LandingSystem:
    """A landing: cable, robot, one contact a wheel."""

    landing: Landing

    @property
    def scenario(self) -> LandingScenario:
        """What it was made from."""
        return self.landing.scenario

    @property
    def exchange(self) -> str:
        """The exchange that is asked for; cable and robot may not have what it needs."""
        return exchange_of(self.scenario)

    def graph(self) -> Graph:
        """Return cable, robot and contacts as loaded FMUs, connected by the contract."""
        return landing_graph(self.landing, self.exchange)

    def notes(self, graph: Graph) -> list[str]:
        """Return another exchange than that asked for, and what nothing feeds; our cable and robot need no more than is fed."""
        contacts = [name for name in graph.components if name.startswith("contact")]
        foreign = {"cable": self.landing.cable.foreign, "robot": self.landing.robot.foreign}
        if self.landing.controller is not None:
            foreign["controller"] = self.landing.controller.foreign
        named = [*contacts, *(name for name, file in foreign.items() if file is not None)]
        names = [n for n in graph.unfed if owner_of(n) in named and not is_unused(variable_of(n), len(contacts))]
        lacks = zip(contacts, lacking(graph.components), strict=True)
        fallen = [_fallen_back(name, graph.components[name], self.exchange, what) for name, what in lacks]
        unfed = _unfed([n for n in names if not is_control(variable_of(n))])
        return [*filter(None, fallen), *unfed, *_means_alone(graph), *departing(graph, named), *self._untried(graph)]

    def _untried(self, graph: Graph) -> Iterator[str]:
        """Yield which foreign FMUs have not passed a trial, as far as one is remembered."""
        parts = {"cable": self.landing.cable, "robot": self.landing.robot, "contact1": self.landing.contact}
        for name, part in parts.items():
            if part.foreign is not None:
                yield from filter(None, [said(graph.components[name].sha256, name.rstrip("1"), part.foreign)])

    def problem(self) -> Callable[[], Problem] | None:
        """Return what makes the monolithic problem; None where our modules cannot stand for a foreign FMU."""
        return (lambda: problem(self.landing)) if has_monolithic(self.landing) else None

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return the cable's shape and tension over time as arrays, and the table without them."""
        rest = some_of(table, [name for name in table if not name.startswith(SHAPES)])
        nodes = self.landing.mesh.nodes if self.landing.mesh is not None else None
        return cable_fields(table, self.landing.placement.cable_length, nodes), rest

    def about(self, table: Table) -> dict[str, Any]:
        """Return stiffness set, robot and geometry, and which signals an energy audit would need."""
        robot = self.scenario.robot
        energy = {"verdict": None, "missing": audit.missing(table)}
        mesh = self.landing.mesh.content() if self.landing.mesh is not None else None
        rest = self.landing.rest.content() if self.landing.rest is not None else None
        names = {"stiffness_set": self.scenario.cable.stiffness_set, "robot": robot.model or robot.fmu}
        return {**names, "line": rest, "mesh": mesh, "energy": energy, "geometry": geometry(self.landing)}

    def warnings(self, table: Table) -> list[str]:
        """Return which wheels are where the mesh does not resolve what they do, a line each."""
        if self.landing.mesh is None:
            return []
        arcs = (f"contact{k}.cable.s" for k in range(1, self.landing.n_wheels + 1))
        return list(self.landing.mesh.notes(table[name] for name in arcs if name in table))

    def impacts(self, table: Table) -> list[Impact]:
        """Return the impacts of the wheels, and how long each lasts."""
        return impacts(self.landing, table)

    @cached_property
    def limits(self) -> Limits:
        """What the landing is judged by."""
        return limits_of(self.landing)

    def safety(
        self,
        table: Table,
        fields: Mapping[str, np.ndarray],
        errors: Mapping[str, float] | None = None,
        fault: str | None = None,
    ) -> Safety:
        """Return the signals held against the limits; parameters as for `judge`."""
        simulation = self.scenario.simulation
        apart = (simulation.output_interval or 0.0) if simulation.every > 1 else 0.0
        return replace(judge(self.limits, table, tension_of(fields), errors, fault), apart=apart)

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> LandingSystem:
        """Return it with other options of the master and other simulation settings; the start stays as it is."""
        return LandingSystem(self.landing.changed(self.scenario.changed(dict(options), **simulation)))

    def stepped(self, ratio: float, longest: float = np.inf) -> LandingSystem:
        """Return it with other inner steps, whatever the macro step."""
        known, cable, robot = self.landing.sources.variables, self.scenario.cable, self.scenario.robot
        if cable.fmu is None and INNER_STEP not in cable.parameters:
            step = inner_step(self.landing, EXCHANGES[self.exchange])
            cable = cable.model_copy(update={"parameters": cable.parameters | {INNER_STEP: step}})
        sections = {
            "cable": _scaled(cable, known["cable"], ratio, longest),
            "robot": _scaled(robot, known["robot"], ratio, longest),
        }
        return LandingSystem(self.landing.changed(self.scenario.model_copy(update=sections)))

    def meshed(self, ratio: float = MESH_RATIO) -> Meshed | None:
        """Return it with a finer mesh; None where the cable is a foreign one."""
        cable, mesh = self.scenario.cable, self.landing.mesh
        if mesh is None:
            return None
        given = set(MESH_KEYS) & set(cable.parameters) if cable.parameters.get("n_elements", 0) else set()
        change = {MESH_TOLERANCE: float(self.landing.cable.module.get(MESH_TOLERANCE, TOLERANCE)) / ratio**4}
        if given and not mesh.is_coarse:
            given, change = set(), {"n_elements": round(ratio * mesh.n_elements)}
        kept = {name: value for name, value in cable.parameters.items() if name not in given}
        section = cable.model_copy(update={"parameters": kept | change})
        finer = self.landing.meshed(self.scenario.model_copy(update={"cable": section}))
        assert finer.mesh is not None
        return Meshed(LandingSystem(finer), np.inf if given else finer.mesh.n_elements / mesh.n_elements)


@dataclass(frozen=True)
class GraphSystem:
    """A general graph of FMUs; `variables` are those of its components."""

    scenario: GraphScenario
    variables: Mapping[str, Variables]
    exchange: None = None

    def graph(self) -> Graph:
        """Return the components as loaded FMUs with the scenario's connections."""
        components: dict[str, Fmu] = {}
        try:
            for name, section in self.scenario.components.items():
                file = section.fmu or library.module_fmu(str(section.model))
                apart = isolation(section, self.scenario.simulation)
                structure = structure_of(description(Path(file)), section.parameters) if section.fmu else {}
                components[name] = instance(file, name, section.steps, section.continuous, apart, structure)
            connections = [Connection.parse(text) for text in self.scenario.connections]
            supply = Supply(components, connections)
            for name, section in self.scenario.components.items():
                own = self._own_exchange(name, supply) if self._follows(name) else {}
                components[name].set_parameters({**own, **section.parameters, **held(section.inputs)})
            inputs = {f"{name}.{key}": course for name, key, course in self._courses()}
            return Graph(components, _kept(connections, components), inputs=inputs)
        except BaseException:
            for fmu in components.values():
                fmu.close()
            raise

    def notes(self, graph: Graph) -> list[str]:
        """Return where the exchange is another than that asked for, and the inputs that nothing feeds."""
        supply = Supply(graph.components, map(Connection.parse, self.scenario.connections))
        fallen = [
            _fallen_back(name, fmu, exchange_of(self.scenario), supply.missing(name))
            for name, fmu in graph.components.items()
            if self._follows(name)
        ]
        said = [*filter(None, fallen), *_unfed(graph.unfed), *_means_alone(graph)]
        odd = departing(graph, self._foreign)
        return [*said, *self._discrete(graph), *self._below(graph), *_silent(graph), *odd]

    @property
    def _foreign(self) -> dict[str, Component]:
        return {name: section for name, section in self.scenario.components.items() if section.fmu is not None}

    def _discrete(self, graph: Graph) -> list[str]:
        """Return that reals of foreign FMUs in loops are declared discrete, if any are."""
        loops = [text for text in graph.discrete_loops if {*map(owner_of, text.split(" -> "))} & {*self._foreign}]
        what = f"reals in a loop, declared discrete, are exchanged after each step alone: {', '.join(loops)}"
        cure = 'no master iterates over them; if they are continuous, say at their component continuous = ["x"]'
        return [f"{what}; {cure}"] if loops else []

    def _below(self, graph: Graph) -> list[str]:
        """Return which foreign FMUs are stepped by less than the step that they are made for."""
        H = self.scenario.simulation.macro_step
        own = {name: graph.components[name].own_step or 0.0 for name in self._foreign}
        short = {
            name: H / part.steps for name, part in self._foreign.items() if H / part.steps < own[name] * (1.0 - 1e-9)
        }
        what = "are below the step size of its default experiment"
        return [f"{n}: its steps of {digits(h)} s {what}, {digits(own[n])} s" for n, h in short.items()]

    def _courses(self) -> Iterator[tuple[str, str, Course]]:
        """Yield component, input and course of the inputs over time."""
        for name, section in self.scenario.components.items():
            for key, course in courses(section.inputs).items():
                yield name, key, course

    def _follows(self, name: str) -> bool:
        """Return whether a component is one of our modules that has the exchange as a parameter, and is left to choose."""
        section = self.scenario.components[name]
        return section.model is not None and PARAMETER in self.variables[name] and PARAMETER not in section.parameters

    def _own_exchange(self, name: str, supply: Supply) -> dict[str, str]:
        """Return the exchange as a parameter of one of our modules: what is asked for, or the next best that it has."""
        exchange = chosen(exchange_of(self.scenario), self.variables[name][PARAMETER].choices, supply.missing(name))
        return {PARAMETER: exchange} if exchange else {}

    def problem(self) -> None:
        """Return None: a general graph has no monolithic solver."""

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return no fields, and all of `table`."""
        return {}, table

    def about(self, table: Table) -> dict[str, Any]:
        """Return nothing that only a landing has."""
        return {"stiffness_set": None, "robot": None, "line": None, "mesh": None, "energy": {}, "geometry": None}

    def warnings(self, table: Table) -> list[str]:
        """Return nothing: what a run of a general graph should not do is not known."""
        return []

    def impacts(self, table: Table) -> list[Impact]:
        """Return nothing: a general graph has no wheels."""
        return []

    def safety(
        self,
        table: Table,
        fields: Mapping[str, np.ndarray],
        errors: Mapping[str, float] | None = None,
        fault: str | None = None,
    ) -> None:
        """Return None: a general graph is no landing."""

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> GraphSystem:
        """Return it with other options of the master and other simulation settings."""
        return replace(self, scenario=self.scenario.changed(dict(options), **simulation))

    def meshed(self, ratio: float = MESH_RATIO) -> None:
        """Return None: nothing is known of the mesh of a component."""

    def stepped(self, ratio: float, longest: float = np.inf) -> GraphSystem:
        """Return it with other inner steps."""
        components = {n: _scaled(c, self.variables[n], ratio, longest) for n, c in self.scenario.components.items()}
        return replace(self, scenario=self.scenario.model_copy(update={"components": components}))


def resolve(scenario: Scenario) -> System:
    """Return the landing or general graph of `scenario`: each file that it names is read once.

    Raises
    ------
    InputError : a foreign FMU does not meet its contract, the robot has no place …
    """
    if isinstance(scenario, LandingScenario):
        return LandingSystem(resolve_landing(scenario))
    return GraphSystem(scenario, {name: _variables(section) for name, section in scenario.components.items()})


def _variables(section: Component) -> Variables:
    return vocabulary.of_fmu(Path(section.fmu)) if section.fmu else vocabulary.of_module(str(section.model))


def exchange_of(scenario: Scenario) -> Choice:
    """Return the exchange within a macro step: the scenario's, else what suits the master."""
    return scenario.simulation.exchange or suited_to(implicit=MASTERS[scenario.simulation.master].IMPLICIT)


def _fallen_back(name: str, fmu: Fmu, asked: str, lacks: Missing) -> str:
    """Return that a component has another exchange than that `asked` for, and why; empty if nothing keeps it from that."""
    why = lacks.why(EXCHANGES[asked])
    if not why or fmu.exchange == asked:
        return ""
    return f"{name}: exchange {fmu.exchange} in the place of {asked}, because {why}"


def _unfed(names: Sequence[str]) -> list[str]:
    """Return the line that lists inputs which nothing feeds, x, y, z together; none if there is none."""
    return [f"inputs that nothing feeds keep their start values: {', '.join(stems(names))}"] if names else []


def _means_alone(graph: Graph) -> list[str]:
    """Return a line for each component that is told of an input over time the means over its steps alone."""
    driven = {name: fmu.driven.without_slope for name, fmu in graph.components.items() if fmu.driven is not None}
    what = "given as the mean over each macro step, without slope: the FMU has no input"
    return [f"{n}: {', '.join(stems(ins))} {what} {suffixed(ins[0], RATE)}" for n, ins in driven.items() if ins]


def _silent(graph: Graph) -> list[str]:
    """Return that no FMU shows anything, if that is so."""
    if any(p.causality == "output" and p.is_number for fmu in graph.components.values() for p in fmu.ports.values()):
        return []
    return ['no FMU has a numeric output: choose local variables, [simulation] record = ["component.variable"]']


def _scaled(section: Stepped, known: Variables, ratio: float, longest: float) -> Stepped:
    """Return the section of a component with its inner step `ratio` times as long, if it has one, and no longer one."""
    if INNER_STEP not in known or known[INNER_STEP].causality != "parameter":
        return section
    step = float(section.parameters.get(INNER_STEP, known[INNER_STEP].start))
    scaled = ratio * step if step <= longest * (1.0 + 1e-9) else step
    return section.model_copy(update={"parameters": section.parameters | {INNER_STEP: scaled}})


def _kept(connections: Iterable[Connection], components: Mapping[str, Fmu]) -> list[Connection]:
    """Return `connections` without those of slopes and means where one end holds values at an instant."""
    return [c for c in connections if not (is_companion(c.source) and _is_held(c, components))]


def _is_held(connection: Connection, components: Mapping[str, Fmu]) -> bool:
    """Return whether one end of a slope's or mean's connection holds values at an instant; the rate of a motion is one."""
    split = [signal.partition(".") for signal in (connection.source, connection.target)]
    ends = [(components[name], variable) for name, _, variable in split if name in components]
    holding = any(not exchange_named(fmu.exchange).slopes for fmu, _ in ends)
    return holding and not any(is_rate_of_motion(variable, fmu.vocabulary) for fmu, variable in ends)
