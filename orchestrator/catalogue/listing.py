"""What there is to choose from, with a line each: scenarios, robots, conductors, contact stiffness sets, masters."""

from __future__ import annotations

from collections.abc import Callable

from orchestrator.catalogue import conductor_spec, robot_spec
from orchestrator.catalogue import contact_sets as sets
from orchestrator.catalogue import scenarios as shipped
from orchestrator.catalogue.documents import chain
from orchestrator.coupling.errors import InputError


def scenarios() -> dict[str, str]:
    """Return the titles of the shipped scenarios by name; what is wrong with a faulty one in its title's place."""
    return {name: _or_fault(lambda name=name: _title(name)) for name in shipped.names()}


def robots() -> dict[str, str]:
    """Return the titles of the robots of the catalogue by name; what is wrong with a faulty one in its title's place."""
    return {name: _or_fault(lambda name=name: robot_spec.load_robot(name).title) for name in robot_spec.names()}


def conductors() -> dict[str, str]:
    """Return a line for each conductor by name: title, diameter, mass, rated strength, sets; of a faulty one what is wrong."""
    return {name: _or_fault(lambda name=name: _conductor(name)) for name in conductor_spec.names()}


def _conductor(name: str) -> str:
    spec = conductor_spec.load_conductor(name)
    numbers = [f"{1e3 * spec.diameter.value:.4g} mm", f"{spec.linear_density.value:.4g} kg/m"]
    numbers += [f"{1e-3 * spec.rated_strength.value:.4g} kN"] if spec.rated_strength is not None else []
    return f"{spec.title}; {', '.join(numbers)} ({', '.join(spec.sets)})"


def contact_sets() -> dict[str, str]:
    """Return the titles of the contact's stiffness sets by name; what is wrong with a faulty one in its title's place."""
    return {name: _or_fault(lambda name=name: sets.load_set(name).title) for name in sets.names()}


def masters() -> dict[str, str]:
    """Return the titles of the masters by name."""
    from orchestrator.coupling.masters import MASTERS

    return {name: master.TITLE for name, master in MASTERS.items()}


def _title(scenario: str) -> str:
    """Return the title that a scenario gives, or the nearest file that it extends."""
    titles = [document.get("title") for _, document in chain(shipped.find(scenario), shipped.find)]
    return next((str(title) for title in reversed(titles) if title), "")


def _or_fault(title: Callable[[], str]) -> str:
    try:
        return title()
    except InputError as error:
        return f"faulty: {error.problems[0]}"
