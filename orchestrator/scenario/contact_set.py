"""The contact's stiffness by the name of a set: it fills in what the scenario does not say itself."""

from __future__ import annotations

from typing import Any

from orchestrator.catalogue import contact_sets
from orchestrator.catalogue.documents import Document, Stack, is_quantity
from orchestrator.catalogue.quantities import Complaint
from orchestrator.coupling.errors import InputError

KEY = "stiffness_set"
PLACE = f"contact.{KEY}"


def make_room(document: Document, above: Document) -> list[str]:
    """Take from `document` the contact's parameters that a set speaks of which `above` names; return what is to be said.

    So what a file gives of its own wins over the set that it names, and a set named later over what an earlier file gave.
    """
    parameters, name = _section(document).get("parameters"), _set_named(above)
    if name is None or not isinstance(parameters, dict):
        return []
    gone = [key for key in contact_sets.parameters_of(name) if key in parameters]
    for key in gone:
        del parameters[key]
    return [f"contact: {', '.join(gone)} are those of the set {name}"] if gone else []


def fill_in(stack: Stack) -> list[Complaint]:
    """Lay the parameters of the set that the scenario names under its own; return what is wrong with the name."""
    name = _bare(_section(stack.document).get(KEY))
    if not isinstance(name, str):
        return []  # the types say so
    try:
        given = contact_sets.parameters_of(name)
    except InputError as error:
        return [Complaint(PLACE, problem) for problem in error.problems]
    parameters = stack.document["contact"].setdefault("parameters", {})
    new = {key: quantity for key, quantity in given.items() if key not in parameters}
    parameters |= new
    here = str(contact_sets.file_of(name))
    stack.layers.insert(0, (here, frozenset(f"contact.parameters.{key}" for key in new)))
    return []


def _section(document: Document) -> Document:
    section = document.get("contact")
    return section if isinstance(section, dict) else {}


def _bare(value: Any) -> Any:
    return value["value"] if is_quantity(value) else value


def _set_named(document: Document) -> str | None:
    """Return the set that `document` names, if there is one of that name."""
    name = _bare(_section(document).get(KEY))
    return name if isinstance(name, str) and name in contact_sets.names() else None
