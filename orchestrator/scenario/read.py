"""From a TOML file to a checked scenario."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from pydantic import ValidationError

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import Document, Stack, is_over_time, is_quantity
from orchestrator.catalogue.quantities import Complaint, complaints, quantity_complaints
from orchestrator.catalogue.scenarios import find
from orchestrator.coupling.errors import InputError
from orchestrator.scenario import layers
from orchestrator.scenario.check import check, known_variables, to_si
from orchestrator.scenario.conductor import fill_set, fill_strength, share_diameter
from orchestrator.scenario.inertia import scale_inertia
from orchestrator.scenario.line_state import STRUNG, fill_expansion, state_problems
from orchestrator.scenario.named_sets import fill_in
from orchestrator.scenario.over_time import parse
from orchestrator.scenario.types import GraphScenario, LandingScenario, Provenance, Scenario

LANDING_KEYS = ("cable", "robot", "contact", "controller", "landing")
GRAPH_KEYS = ("components", "connections")
COMMAND_LINE = "command line"
ELSEWHERE = {"robot.limits": "limits stand in [limits], or in the robot's own file"} | {
    f"cable.{key}": f"how the line is strung stands in [cable.state] as {key}" for key in STRUNG
}
"""Unknown key that has its place elsewhere → where."""


def load(
    path: Path | str, overrides: Iterable[str] = (), robot: str | None = None, master: str | None = None
) -> Scenario:
    """Read, check and return a scenario; raise `InputError` with all problems at once.

    Parameters
    ----------
    path : the TOML file, or the name of a shipped scenario
    overrides : ``key=value`` in TOML syntax, ``robot.parameters.mass=12``; they replace what the file says
    robot : in the robot's place: name of the catalogue, or path (relative to the current folder) of a robot's TOML file or
        of an FMU; the parameters and inputs of another do not fit it
    master : in the master's place, with its own defaults: exchange and options of another do not fit it, but for the
        tolerance
    """
    path = find(path)
    stack, notes = layers.files(path)
    if robot is not None:
        notes += layers.replace_robot(stack, robot)
    if master is not None:
        layers.replace_master(stack, master)
    notes += layers.override(stack, overrides, path.parent)
    layers.resolve_paths(stack.document, path.parent)
    problems: list[Complaint] = []
    provenance: dict[str, Provenance] = {}
    plain = _unwrap(stack, stack.document, "", provenance, problems)
    layers.resolve_paths(plain, path.parent)
    if "cable" in plain:
        plain.setdefault("contact", {})  # it shares the line's diameter
    known, unknown = known_variables(plain)
    said, wrong = fill_in(plain, known, stack, provenance)
    for fill in (fill_set, fill_strength, fill_expansion):
        fill(plain, provenance)
    problems += [*unknown, *wrong, *to_si(plain, known, provenance), *share_diameter(plain, known, provenance)]
    notes += [*said, *scale_inertia(plain, provenance)]
    scenario, invalid = _validated(plain)
    problems += [*invalid, *check(plain, known), *state_problems(plain, known)]
    if problems or scenario is None:
        raise InputError(f"{stack.place_of(problem.path)}: {problem}" for problem in problems)
    return scenario.read_from(path, _with_robot_file(plain, provenance), notes)


def _unwrap(
    stack: Stack, table: Document, prefix: str, found: dict[str, Provenance], problems: list[Complaint]
) -> Document:
    """Return `table` with bare values; what the quantities say about themselves goes to `found`."""
    plain: Document = {}
    for key, value in table.items():
        path = prefix + key
        if is_over_time(value):
            parsed = parse(path, value)
            problems += parsed.problems
            found[path] = replace(
                _provenance(value, stack.place_of(path)), written=parsed.written, sha256=parsed.sha256
            )
            plain |= {key: parsed.value} if parsed.value is not None else {}
            continue
        if isinstance(value, dict) and not is_quantity(value):
            plain[key] = _unwrap(stack, value, f"{path}.", found, problems)
            continue
        quantity = value if is_quantity(value) else {"value": value}
        problems += quantity_complaints(path, quantity)
        found[path] = _provenance(quantity, stack.place_of(path))
        plain[key] = quantity["value"]
    return plain


def _provenance(quantity: Document, place: str) -> Provenance:
    said = {key: str(quantity[key]) for key in ("source", "reason", "unit") if key in quantity}
    here = {"source": COMMAND_LINE} if place.startswith("--") else {"file": place}
    return Provenance(**(here | said))


def _validated(plain: Document) -> tuple[Scenario | None, list[Complaint]]:
    """Return the landing or general graph, whichever the tables are those of, or what is wrong with it."""
    kind = GraphScenario if any(key in plain for key in GRAPH_KEYS) else LandingScenario
    if kind is GraphScenario and any(key in plain for key in LANDING_KEYS):
        return None, [Complaint("", "has both components and a landing; give one of them")]
    try:
        return kind.model_validate(plain), []
    except ValidationError as error:
        return None, list(_with_what_is_missing(complaints(error, Scenario)))


def _with_what_is_missing(found: Iterable[Complaint]) -> Iterator[Complaint]:
    for one in found:
        whole = one.message == "missing" and one.path in LANDING_KEYS
        needed = "; a landing needs cable, robot and landing, a general graph components" if whole else ""
        lost = ELSEWHERE.get(one.path) if one.message.startswith("unknown key") else None
        yield Complaint(one.path, f"unknown key; {lost}" if lost else one.message + needed)


def _with_robot_file(plain: Document, provenance: dict[str, Provenance]) -> dict[str, Provenance]:
    """Return `provenance` with the hash of the robot's file, where the robot is one of its own."""
    model = plain.get("robot", {}).get("model")
    if model is None or not shelf.is_file(model):
        return provenance
    sha256 = hashlib.sha256(Path(model).read_bytes()).hexdigest()
    return provenance | {"robot.model": replace(provenance["robot.model"], sha256=sha256)}
