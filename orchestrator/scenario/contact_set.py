"""The contact's stiffness by the name of a set."""

from __future__ import annotations

from orchestrator.catalogue import contact_sets
from orchestrator.catalogue.documents import Document
from orchestrator.catalogue.quantities import Complaint
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.given import Given

KEY = "stiffness_set"


def given(contact: Document) -> tuple[list[Given], list[Complaint]]:
    """Return what the set gives that a contact names, and what is wrong with the name."""
    name = contact.get(KEY)
    if not isinstance(name, str):
        return [], []  # another type is what the types complain of
    try:
        found = contact_sets.load_set(name)
    except InputError as error:
        return [], [Complaint(f"contact.{KEY}", problem) for problem in error.problems]
    return [Given(f"the set {name}", frozenset([KEY]), found.parameters, contact_sets.file_of(name))], []
