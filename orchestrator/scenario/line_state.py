"""The state of the line, ``[cable.state]``: how it is strung, at which temperature, and how warm and icy it is now."""

from __future__ import annotations

from collections.abc import Iterator

from orchestrator.catalogue.documents import Document, table_of
from orchestrator.catalogue.quantities import Complaint
from orchestrator.scenario.check import Known
from orchestrator.scenario.conductor import conductor_of
from orchestrator.scenario.given import said
from orchestrator.scenario.types import Provenance

STATE = "cable.state"
STRUNG = ("sag", "horizontal_tension", "tension_share", "unstretched_length")
"""Keys of the state that say how the line is strung, of which one is given."""
LENGTHS = ("unstretched_length", "sag")
"""The cable's parameters that say the same without a state."""


def make_room(document: Document, above: Document) -> Iterator[str]:
    """Take from `document` how the line is strung, where `above` strings it anew; yield what is to be said of it."""
    cable, own = table_of(document, "cable"), table_of(above, "cable")
    state, parameters = table_of(cable, "state"), table_of(cable, "parameters")
    new = [key for key in STRUNG if key in table_of(own, "state")]
    if new:
        gone = [f"state.{key}" for key in STRUNG if key in state and key not in new]
        gone += [f"parameters.{key}" for key in LENGTHS if key in parameters]
        _drop(state, [key for key in STRUNG if key not in new])
        _drop(parameters, LENGTHS)
        if gone:
            yield f"cable: the line is strung by state.{new[0]}, not by {', '.join(gone)}"
    given = [key for key in LENGTHS if key in table_of(own, "parameters")]
    if given and not new and state:
        del cable["state"]
        yield f"cable: the line is strung by parameters.{given[0]}; the state is left out"


def _drop(table: Document, keys: Iterator[str] | list[str] | tuple[str, ...]) -> None:
    for key in keys:
        table.pop(key, None)


def fill_expansion(plain: Document, provenance: dict[str, Provenance]) -> None:
    """Write the conductor's thermal expansion, where the state does not give it."""
    spec, state = conductor_of(plain), table_of(plain, "cable").get("state")
    expansion = spec.thermal_expansion if spec is not None else None
    if spec is None or expansion is None or not isinstance(state, dict) or "thermal_expansion" in state:
        return
    state["thermal_expansion"] = expansion.value
    provenance[f"{STATE}.thermal_expansion"] = said(expansion, spec.path)


def state_problems(plain: Document, known: Known) -> Iterator[Complaint]:
    """Yield what of the state contradicts itself, or the cable's parameters, and what it lacks."""
    cable = table_of(plain, "cable")
    state, parameters = table_of(cable, "state"), table_of(cable, "parameters")
    if not isinstance(cable.get("state"), dict):
        return
    yield from _strung_problems(state, parameters)
    yield from _temperature_problems(state)
    if "tension_share" in state and "rated_strength" not in table_of(plain, "limits"):
        cure = "give limits.rated_strength, a conductor that has one, or horizontal_tension in N"
        yield Complaint(f"{STATE}.tension_share", f"is a share of the rated tensile strength; {cure}")
    if state.get("ice_thickness") and not parameters.get("diameter"):
        cure = "give cable.parameters.diameter, or a conductor"
        yield Complaint(f"{STATE}.ice_thickness", f"is ice around a line whose diameter is not known; {cure}")
    for name in ("unstretched_length", "linear_density"):
        if "cable" in known and name not in known["cable"]:
            cure = "leave [cable.state] out and set the FMU's own parameters"
            yield Complaint(STATE, f"follows into the parameter {name}, which the cable's FMU does not have; {cure}")


def _strung_problems(state: Document, parameters: Document) -> Iterator[Complaint]:
    given = [key for key in STRUNG if key in state]
    if not given:
        yield Complaint(STATE, f"says not how the line is strung; give one of {', '.join(STRUNG)}")
    if len(given) > 1:
        yield Complaint(f"{STATE}.{given[1]}", f"contradicts {STATE}.{given[0]}; give one of {', '.join(STRUNG)}")
    for key in LENGTHS:
        if key in parameters:
            cure = f"give it as {STATE}.{key}, or leave the state out"
            yield Complaint(f"cable.parameters.{key}", f"strings the line a second time; {cure}")


def _temperature_problems(state: Document) -> Iterator[Complaint]:
    at, now = state.get("at_temperature"), state.get("temperature")
    if now is not None and at is None:
        yield Complaint(
            f"{STATE}.temperature", "says nothing without at_temperature, at which the line is strung; give both"
        )
    if at is not None and now is not None and at != now and "thermal_expansion" not in state:
        cure = f"give {STATE}.thermal_expansion in 1/K, or a conductor that has one"
        yield Complaint(
            f"{STATE}.temperature", f"differs from at_temperature, but no thermal expansion is known; {cure}"
        )
