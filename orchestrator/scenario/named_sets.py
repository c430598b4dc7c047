"""Sets of the catalogue that a scenario names: one rule for the line's conductor and for the contact's stiffness.

What a file gives itself wins over the set that it names; a set named later wins over what an earlier file gave. The
``--set`` of a command are one file, the last.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fmus.module.variables import Variable
from orchestrator.catalogue.documents import Document, Stack, bare, parameters_of, table_of
from orchestrator.catalogue.quantities import Complaint
from orchestrator.scenario import conductor, contact_set
from orchestrator.scenario.check import Known
from orchestrator.scenario.given import Given, said
from orchestrator.scenario.types import Provenance

GIVERS = {"cable": conductor.given, "contact": contact_set.given}
"""Section → what the sets give that it names."""


def make_room(document: Document, above: Document) -> list[str]:
    """Take from `document` what the sets give that `above` names; return what is to be said of it."""
    other_set = list(conductor.make_room_for_set(document, above))
    return other_set + [note for section in GIVERS for note in _make_room(section, document, above)]


def _make_room(section: str, document: Document, above: Document) -> Iterator[str]:
    below, own = table_of(document, section), table_of(above, section)
    parameters, kept = table_of(below, "parameters"), table_of(own, "parameters")
    found, _ = GIVERS[section](_bare(below | own))
    for one in found:
        gone = [name for name in one.parameters if name in parameters and name not in kept]
        if gone and one.named_by & own.keys():
            for name in gone:
                del parameters[name]
            yield f"{section}: {', '.join(gone)} are those of {one.title}"


def _bare(section: Document) -> Document:
    return {key: bare(value) for key, value in section.items()}


def fill_in(
    plain: Document, known: Known, stack: Stack, provenance: dict[str, Provenance]
) -> tuple[list[str], list[Complaint]]:
    """Give the sections of `plain` what their sets say and the scenario does not.

    Returns
    -------
    notes : what is to be said of it
    problems : what is wrong with the names
    """
    notes: list[str] = []
    problems: list[Complaint] = []
    for section, given in GIVERS.items():
        found, wrong = given(table_of(plain, section))
        problems += wrong
        parameters = parameters_of(plain, section) if found else None
        if parameters is None or section not in known:
            continue  # the types, or the section's model, are what is complained of
        for one in found:
            notes += _notes(section, one, parameters, known[section])
            new = {n: q for n, q in one.parameters.items() if n in known[section] and n not in parameters}
            parameters |= {name: quantity.value for name, quantity in new.items()}
            places = {f"{section}.parameters.{name}": said(q, one.file) for name, q in new.items()}
            provenance |= places
            stack.layers.insert(0, (str(one.file), frozenset(places)))
    return notes, problems


def _notes(section: str, one: Given, parameters: Document, variables: Mapping[str, Variable]) -> Iterator[str]:
    """Yield where the scenario gives itself what a set would, and where there is nobody to take it."""
    own = [name for name in one.parameters if name in parameters]
    lost = [name for name in one.parameters if name not in variables]
    if own:
        yield f"{section}: {', '.join(own)} of the scenario is taken, not that of {one.title}"
    if lost:
        yield f"{section}: its FMU has no {', '.join(lost)} for what {one.title} gives"
