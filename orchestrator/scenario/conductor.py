"""A line that names its conductor: diameter, mass and a set of stiffnesses come from the catalogue.

What the scenario gives itself stands. The diameter is one fact that cable and contact share.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from orchestrator.catalogue.conductor_spec import ConductorSpec, load_conductor
from orchestrator.catalogue.documents import Document
from orchestrator.catalogue.quantities import Complaint, Number
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.check import Known
from orchestrator.scenario.types import Provenance

CONDUCTOR, SET = "cable.conductor", "cable.stiffness_set"
DIAMETERS = (("cable", "diameter"), ("contact", "cable_diameter"))
STIFFNESSES = ("axial_stiffness", "bending_stiffness")


def fill_line(plain: Document, known: Known, provenance: dict[str, Provenance]) -> tuple[list[str], list[Complaint]]:
    """Give cable and contact of `plain` what their conductor says and the scenario does not.

    Returns
    -------
    notes : what is to be said of it
    problems : what is wrong with it
    """
    notes: list[str] = []
    try:
        chosen = _chosen(plain.get("cable"))
    except InputError as error:
        return [], [Complaint("", problem) for problem in error.problems]
    if chosen is not None:
        notes += _fill_cable(plain["cable"], *chosen, known, provenance)
        _fill_strength(plain, chosen[0], provenance)
    return notes, list(_share_diameter(plain, known, provenance))


def _chosen(cable: Any) -> tuple[ConductorSpec, str] | None:
    """Return the conductor that the scenario names, and the set of it; None if it names none."""
    name = cable.get("conductor") if isinstance(cable, dict) else None
    if not isinstance(name, str):
        return None  # another type is what the types complain of
    try:
        spec = load_conductor(name)
    except InputError as error:
        raise InputError(f"{CONDUCTOR}: {problem}" for problem in error.problems) from None
    wanted, there = cable.get("stiffness_set"), list(spec.stiffness_sets)
    if wanted is None:
        raise InputError(f"{SET}: missing; {name} has {', '.join(there)}")
    if wanted not in there:
        hint = nearest(str(wanted), there) or f"; it has {', '.join(there)}"
        raise InputError(f"{SET}: {name} has no set {wanted!r}{hint}")
    return spec, wanted


def _fill_cable(
    cable: Document, spec: ConductorSpec, chosen: str, known: Known, provenance: dict[str, Provenance]
) -> Iterator[str]:
    """Write what the scenario does not give; yield what is to be said where it gives a stiffness itself."""
    parameters = _parameters({"cable": cable}, "cable")
    if parameters is None:
        return
    own = [name for name in STIFFNESSES if name in parameters]
    if own:
        yield f"cable: {', '.join(own)} of the scenario is taken, not that of {cable['conductor']}'s set {chosen}"
    for name, quantity in spec.parameters(chosen).items():
        if name not in parameters and name in known.get("cable", {}):
            parameters[name] = quantity.value
            provenance[f"cable.parameters.{name}"] = _said(quantity, spec)


def _fill_strength(plain: Document, spec: ConductorSpec, provenance: dict[str, Provenance]) -> None:
    """Write the rated strength that limits of tension are counted by, where the scenario does not give it."""
    limits = plain.setdefault("limits", {})
    if spec.rated_strength is not None and isinstance(limits, dict) and "rated_strength" not in limits:
        limits["rated_strength"] = spec.rated_strength.value
        provenance["limits.rated_strength"] = _said(spec.rated_strength, spec)


def _said(quantity: Number, spec: ConductorSpec) -> Provenance:
    return Provenance(str(quantity.source), quantity.reason or "", quantity.unit, file=str(spec.path))


def _share_diameter(plain: Document, known: Known, provenance: dict[str, Provenance]) -> Iterator[Complaint]:
    """Give the diameter to that of cable and contact which lacks it; yield where they contradict each other."""
    places = [(f"{key}.parameters.{name}", _parameters(plain, key), key, name) for key, name in DIAMETERS]
    given = [(path, values[name]) for path, values, _, name in places if values is not None and name in values]
    if len(given) == 2 and given[0][1] != given[1][1]:
        (one, first), (other, second) = given
        yield Complaint(
            other, f"{second} m, but {one} is {first} m; both are the line's diameter, leave one of them out"
        )
    if len(given) != 1:
        return
    said, value = given[0]
    for path, values, key, name in places:
        if path != said and values is not None and name in known.get(key, {}):
            values[name], provenance[path] = value, provenance[said]


def _parameters(plain: Document, key: str) -> Document | None:
    """Return the parameters of a section, made where there are none; None if they are no table."""
    section = plain.get(key)
    found = section.setdefault("parameters", {}) if isinstance(section, dict) else None
    return found if isinstance(found, dict) else None
