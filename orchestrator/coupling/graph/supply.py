"""What components need and nothing feeds: means and slopes of an exchange, and other continuous inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from orchestrator.coupling.course import Course
from orchestrator.coupling.errors import nearest
from orchestrator.coupling.exchange import (
    EXCHANGES,
    MEAN,
    PARAMETER,
    RATE,
    Exchange,
    base_of,
    exchange_named,
    is_load,
    is_motion,
    split,
    suffixed,
)
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.links import Connection, GraphError, owner_of, variable_of


@dataclass(frozen=True)
class Missing:
    """What keeps a component from an exchange.

    Attributes
    ----------
    slopes : inputs of others for the slopes of its loads, ``component.variable``, that it does not feed or they do not have
    means : its own inputs for the means of motions that nothing feeds
    """

    slopes: tuple[str, ...]
    means: tuple[str, ...]

    def best(self, exchange: Exchange) -> Exchange:
        """Return `exchange`, or the next best that does without what is missing."""
        return exchange.possible(slopes=not self.slopes, means=not self.means)

    def why(self, exchange: Exchange) -> str:
        """Return in words what `exchange` lacks."""
        lacking = (*(self.means if exchange.means else ()), *(self.slopes if exchange.slopes else ()))
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        return f"nothing feeds {lacking[0]}{more}" if lacking else ""


class Supply:
    """Who feeds what, by component.

    Parameters
    ----------
    connections : those with an end that is no component are left out
    """

    def __init__(self, components: Mapping[str, Fmu], connections: Iterable[Connection]):
        self.components = components
        self.feeds: dict[str, str] = {}
        self.given: dict[str, list[Connection]] = {}
        for c in connections:
            if owner_of(c.source) in components and owner_of(c.target) in components:
                self.feeds[c.target] = c.source
                self.given.setdefault(owner_of(c.source), []).append(c)

    def missing(self, name: str) -> Missing:
        """Return which slopes and means the exchange of a component lacks; what is coupled to nothing lacks nothing."""
        names = self.components[name].vocabulary
        slopes = [
            _companion(c.target, RATE)
            for c in self.given.get(name, ())
            if is_load(variable_of(c.source), names)
            and self.feeds.get(_companion(c.target, RATE)) != _companion(c.source, RATE)
        ]
        means = [f"{name}.{mean}" for mean in self._means(name)]
        return Missing(tuple(slopes), tuple(mean for mean in means if mean not in self.feeds))

    def _means(self, name: str) -> list[str]:
        """Return the inputs for means at the places of a component that are fed at all."""
        fmu = self.components[name]
        inputs = [n for n, port in fmu.ports.items() if port.causality == "input"]
        known = fmu.vocabulary.intersection(inputs)
        fed = {n for n in inputs if f"{name}.{n}" in self.feeds}
        places = {split(n)[0] for n in fed} - {""}
        return [suffixed(n, MEAN) for n in inputs if is_motion(n, known) and (n in fed or split(n)[0] in places)]


def require_supplied(components: Mapping[str, Fmu], connections: Iterable[Connection]) -> None:
    """Raise `GraphError` where an FMU is told to use an exchange whose slopes or means do not come."""
    supply = Supply(components, connections)
    for name, fmu in components.items():
        exchange = exchange_named(fmu.exchange)
        lacks = supply.missing(name) if exchange.name else Missing((), ())
        if lacks.best(exchange) is not exchange:
            raise GraphError(
                f"{name}: {PARAMETER} = {exchange.name}, but {lacks.why(exchange)}; connect it, or set "
                f"parameters.{PARAMETER} of {name} to one that does without"
            )


def follow(components: Mapping[str, Fmu], connections: Iterable[Connection], inputs: Mapping[str, Course]) -> None:
    """Let inputs, ``component.input``, follow their courses; `GraphError` says which cannot."""
    feeds = {c.target: c.source for c in connections}
    courses: dict[str, dict[str, Course]] = {}
    for signal, course in inputs.items():
        name = owner_of(signal)
        if name not in components:
            raise GraphError(f"inputs: {signal}: no component {name!r}{nearest(name, components)}")
        if signal in feeds:
            raise GraphError(f"inputs: {signal} follows a table and is fed by {feeds[signal]}; drop one of the two")
        courses.setdefault(name, {})[variable_of(signal)] = course
    for name, own in courses.items():
        try:
            components[name].follow(own, [variable_of(s) for s in feeds if owner_of(s) == name])
        except ValueError as error:
            raise GraphError(f"inputs: {error}") from None


def chosen(wanted: str, choices: Iterable[str], lacks: Missing) -> str:
    """Return `wanted`, or the next best exchange among `choices` for a component that `lacks` something; empty: its own."""
    row, offered = lacks.best(EXCHANGES[wanted]), set(choices)
    while row.name not in offered and row.instead:
        row = EXCHANGES[row.instead]
    return row.name if row.name in offered else ""


def unfed(components: Mapping[str, Fmu], fed: Iterable[str], made: Iterable[str]) -> list[str]:
    """Return the continuous inputs that keep their start value through the run, ``component.variable``.

    Parameters
    ----------
    fed, made : inputs that connections feed, that the master sets
    """
    served = {*fed, *made}
    return [
        f"{name}.{n}"
        for name, fmu in components.items()
        for n, port in fmu.ports.items()
        if port.causality == "input" and port.kind == "real" and port.variability != "discrete"
        and f"{name}.{n}" not in served and n not in fmu.parameters and not _is_idle(name, n, fmu, served)
        and not (fmu.driven is not None and fmu.driven.sets(n))
    ]  # fmt: skip


def _is_idle(component: str, name: str, fmu: Fmu, served: set[str]) -> bool:
    """Return whether an input is a companion that is not used: its exchange has none, or its base is not fed either."""
    for suffix in (RATE, MEAN) if name in fmu.vocabulary else ():
        base = base_of(name, suffix)
        if base is not None and base in fmu.ports:
            used = suffix == RATE or exchange_named(fmu.exchange).means
            return f"{component}.{base}" not in served or not used
    return False


def _companion(signal: str, suffix: str) -> str:
    return f"{owner_of(signal)}.{suffixed(variable_of(signal), suffix)}"
