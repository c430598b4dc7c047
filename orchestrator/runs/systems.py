"""What can be run: a landing or a general graph, each resolved once; what both can be asked is the same."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from orchestrator.catalogue import library
from orchestrator.catalogue import modules as vocabulary
from orchestrator.coupling.exchange import PARAMETER, Choice, exchange_named, is_companion, is_rate_of_motion, suited_to
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import instance
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.results import Table
from orchestrator.landing import audit
from orchestrator.landing.build import has_monolithic, problem
from orchestrator.landing.fields import cable_fields
from orchestrator.landing.impacts import Impact, impacts
from orchestrator.landing.resolve import Landing, Variables
from orchestrator.landing.resolve import resolve as resolve_landing
from orchestrator.landing.wiring import landing_graph
from orchestrator.scenario.types import CableSection, Component, GraphScenario, LandingScenario, RobotSection, Scenario

if TYPE_CHECKING:
    from orchestrator.landing.monolithic import Problem

INNER_STEP = "integration_step"
Fields = dict[str, np.ndarray]
Stepped = TypeVar("Stepped", CableSection, RobotSection, Component)


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

    def problem(self) -> Callable[[], Problem] | None:
        """Return what makes the monolithic problem; None where there is none."""
        ...

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return what of the signals makes arrays over time, and the other signals."""
        ...

    def about(self, table: Table) -> dict[str, Any]:
        """Return what ``summary.json`` says of this kind of system alone."""
        ...

    def impacts(self, table: Table) -> list[Impact]:
        """Return the impacts of wheels on a cable, and how long each lasts."""
        ...

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> System:
        """Return it with other options of the master and other simulation settings (macro_step, …)."""
        ...

    def stepped(self, ratio: float) -> System:
        """Return it with the inner steps of all components that have them `ratio` times as long."""
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

    def problem(self) -> Callable[[], Problem] | None:
        """Return what makes the monolithic problem; None where our modules cannot stand for a foreign FMU."""
        return (lambda: problem(self.landing)) if has_monolithic(self.landing) else None

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return the cable's shape and tension over time as arrays, and the table without them."""
        rest = {name: values for name, values in table.items() if not name.startswith("cable.shape[")}
        return cable_fields(table, self.landing.placement.cable_length), rest

    def about(self, table: Table) -> dict[str, Any]:
        """Return stiffness set and robot, and which signals an energy audit would need."""
        robot = self.scenario.robot
        energy = {"verdict": None, "missing": audit.missing(table)}
        return {"stiffness_set": self.scenario.cable.stiffness_set, "robot": robot.model or robot.fmu, "energy": energy}

    def impacts(self, table: Table) -> list[Impact]:
        """Return the impacts of the wheels, and how long each lasts."""
        return impacts(self.landing, table)

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> LandingSystem:
        """Return it with other options of the master and other simulation settings; the start stays as it is."""
        return LandingSystem(self.landing.changed(self.scenario.changed(dict(options), **simulation)))

    def stepped(self, ratio: float) -> LandingSystem:
        """Return it with other inner steps; those of our cable follow the macro step where the scenario gives none."""
        known, cable, robot = self.landing.sources.variables, self.scenario.cable, self.scenario.robot
        if cable.fmu is not None or INNER_STEP in cable.parameters:
            cable = _scaled(cable, known["cable"], ratio)
        sections = {"cable": cable, "robot": _scaled(robot, known["robot"], ratio)}
        return LandingSystem(self.landing.changed(self.scenario.model_copy(update=sections)))


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
                components[name] = self._loaded(name, section)
            return Graph(components, _kept(map(Connection.parse, self.scenario.connections), components))
        except BaseException:
            for fmu in components.values():
                fmu.close()
            raise

    def _loaded(self, name: str, section: Component) -> Fmu:
        fmu = instance(section.fmu or library.module_fmu(str(section.model)), name, section.steps)
        fmu.set_parameters({**self._own_exchange(name), **section.parameters, **section.inputs})
        return fmu

    def _own_exchange(self, name: str) -> dict[str, str]:
        """Return the exchange as a parameter of one of our modules, where it has this one."""
        known, exchange = self.variables[name].get(PARAMETER), exchange_of(self.scenario)
        ours = self.scenario.components[name].model is not None
        return {PARAMETER: exchange} if ours and known is not None and exchange in known.choices else {}

    def problem(self) -> None:
        """Return None: a general graph has no monolithic solver."""

    def split(self, table: Table) -> tuple[Fields, Table]:
        """Return no fields, and all of `table`."""
        return {}, table

    def about(self, table: Table) -> dict[str, Any]:
        """Return nothing that only a landing has."""
        return {"stiffness_set": None, "robot": None, "energy": {}}

    def impacts(self, table: Table) -> list[Impact]:
        """Return nothing: a general graph has no wheels."""
        return []

    def changed(self, options: Mapping[str, Any], **simulation: Any) -> GraphSystem:
        """Return it with other options of the master and other simulation settings."""
        return replace(self, scenario=self.scenario.changed(dict(options), **simulation))

    def stepped(self, ratio: float) -> GraphSystem:
        """Return it with other inner steps."""
        components = {n: _scaled(c, self.variables[n], ratio) for n, c in self.scenario.components.items()}
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


def _scaled(section: Stepped, known: Variables, ratio: float) -> Stepped:
    """Return the section of a component with its inner step `ratio` times as long, if it has one."""
    if INNER_STEP not in known or known[INNER_STEP].causality != "parameter":
        return section
    step = float(section.parameters.get(INNER_STEP, known[INNER_STEP].start))
    return section.model_copy(update={"parameters": section.parameters | {INNER_STEP: ratio * step}})


def _kept(connections: Iterable[Connection], components: Mapping[str, Fmu]) -> list[Connection]:
    """Return `connections` without those of slopes and means where one end holds values at an instant."""
    return [c for c in connections if not (is_companion(c.source) and _is_held(c, components))]


def _is_held(connection: Connection, components: Mapping[str, Fmu]) -> bool:
    """Return whether one end of a slope's or mean's connection holds values at an instant; the rate of a motion is one."""
    split = [signal.partition(".") for signal in (connection.source, connection.target)]
    ends = [(components[name], variable) for name, _, variable in split if name in components]
    holding = any(not exchange_named(fmu.exchange).slopes for fmu, _ in ends)
    return holding and not any(is_rate_of_motion(variable, fmu.ports) for fmu, variable in ends)
