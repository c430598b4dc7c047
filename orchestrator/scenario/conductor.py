"""A line that names its conductor: diameter, mass and a set of stiffnesses come from the catalogue.

The diameter is one fact that cable and contact share.
"""

from __future__ import annotations

from collections.abc import Iterator

from orchestrator.catalogue.conductor_spec import ConductorSpec, load_conductor
from orchestrator.catalogue.documents import Document, bare, parameters_of, table_of
from orchestrator.catalogue.quantities import Complaint
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.check import Known
from orchestrator.scenario.given import Given, said
from orchestrator.scenario.types import Provenance

CONDUCTOR, SET = "conductor", "stiffness_set"
DIAMETERS = (("cable", "diameter"), ("contact", "cable_diameter"))


def given(cable: Document) -> tuple[list[Given], list[Complaint]]:
    """Return what the conductor and the set give that a cable names, and what is wrong with the names."""
    name, wanted = cable.get(CONDUCTOR), cable.get(SET)
    if not isinstance(name, str):
        return [], []  # another type is what the types complain of
    try:
        spec = load_conductor(name)
    except InputError as error:
        return [], [Complaint(f"cable.{CONDUCTOR}", problem) for problem in error.problems]
    there, wanted = list(spec.sets), spec.default_set if wanted is None else wanted
    if wanted is None:
        return [], [Complaint(f"cable.{SET}", f"missing; {name} has {', '.join(there)}")]
    if not isinstance(wanted, str):
        return [], []
    if wanted not in there:
        hint = nearest(str(wanted), there) or f"; it has {', '.join(there)}"
        return [], [Complaint(f"cable.{SET}", f"{name} has no set {wanted!r}{hint}")]
    line = Given(f"the conductor {name}", frozenset([CONDUCTOR]), spec.parameters, spec.path)
    pair = Given(f"{name}'s set {wanted}", frozenset([CONDUCTOR, SET]), spec.stiffnesses(wanted), spec.path)
    return [line, pair], []


def fill_set(plain: Document, provenance: dict[str, Provenance]) -> None:
    """Write the name of the conductor's default set, where the scenario names none."""
    spec = conductor_of(plain)
    if spec is not None and spec.default_set is not None and SET not in plain["cable"]:
        plain["cable"][SET] = spec.default_set
        provenance[f"cable.{SET}"] = Provenance("the conductor's default", file=str(spec.path))


def make_room_for_set(document: Document, above: Document) -> Iterator[str]:
    """Take from `document` a set that the conductor which `above` names does not have, if that one has a default."""
    below, own = table_of(document, "cable"), table_of(above, "cable")
    spec = conductor_of({"cable": {CONDUCTOR: bare(own.get(CONDUCTOR))}})
    if SET in own or spec is None or spec.default_set is None or SET not in below:
        return
    was = bare(below[SET])
    if isinstance(was, str) and was not in spec.sets:
        del below[SET]
        yield f"cable: {spec.path.stem} has no set {was}; {spec.default_set} is taken"


def fill_strength(plain: Document, provenance: dict[str, Provenance]) -> None:
    """Write the rated strength that limits of tension are counted by, where the scenario does not give it."""
    spec = conductor_of(plain)
    strength = spec.rated_strength if spec is not None else None
    if spec is None or strength is None:
        return
    limits = plain.setdefault("limits", {})
    if isinstance(limits, dict) and "rated_strength" not in limits:
        limits["rated_strength"] = strength.value
        provenance["limits.rated_strength"] = said(strength, spec.path)


def conductor_of(plain: Document) -> ConductorSpec | None:
    """Return the conductor that a scenario names; None if it names none, or none that there is."""
    cable = plain.get("cable")
    name = cable.get(CONDUCTOR) if isinstance(cable, dict) else None
    try:
        return load_conductor(name) if isinstance(name, str) else None
    except InputError:
        return None  # `given` says what is wrong with it


def share_diameter(plain: Document, known: Known, provenance: dict[str, Provenance]) -> Iterator[Complaint]:
    """Give the diameter to that of cable and contact which lacks it; yield where they contradict each other."""
    places = [(f"{key}.parameters.{name}", parameters_of(plain, key), key, name) for key, name in DIAMETERS]
    there = [(path, values[name]) for path, values, _, name in places if values is not None and name in values]
    if len(there) == 2 and there[0][1] != there[1][1]:
        (one, first), (other, second) = there
        yield Complaint(
            other, f"{second} m, but {one} is {first} m; both are the line's diameter, leave one of them out"
        )
    if len(there) != 1:
        return
    source, value = there[0]
    for path, values, key, name in places:
        if path != source and values is not None and name in known.get(key, {}):
            values[name], provenance[path] = value, provenance[source]
