"""What a run leaves to be solved anew, in its page or elsewhere: ``start.bin`` and ``start.json``.

The first holds the landing at its start as a block of memory (`orchestrator/landing/monolithic/block.py`), and blocks of the
same landing at other points of the span and with other robots; the second says what stands where, which values can be
changed and by which keys of the scenario, and the limits by which each start is judged.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.module.variables import ModuleError
from orchestrator.catalogue import robot_spec
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.run.results import write_bytes
from orchestrator.landing.geometry import geometry
from orchestrator.landing.limits import pitch_by_mass
from orchestrator.landing.resolve import resolve
from orchestrator.landing.safety import Limits
from orchestrator.runs.directory import START, START_BLOCKS, RunDirectory
from orchestrator.runs.systems import LandingSystem, System
from orchestrator.scenario.inertia import MASS, goes_with_mass
from orchestrator.scenario.types import LandingScenario, RobotSection

if TYPE_CHECKING:
    from orchestrator.landing.monolithic.block import Block

FORMAT = 1
TOLERANCE = 1e-6
"""m; local error of the robot's position a step: leaves 3e-7 of the flagship's range (docs/concepts/whatif.md)."""
SHORTEST, LONGEST = 0.01, 0.02
"""s; between these the signals are shown: at the macro step, or a multiple or part of it."""
A_START = 250
"""Macro steps of a run for which one more start is solved: one costs 40 ms, such steps with their estimate 0.7 s."""
MOST = 12
"""Starts of a run."""
POSITIONS = (10.0, 20.0, 25.0, 50.0, 100.0)
"""m; landing points are multiples of one of these."""
IMPACT = "impact"


@dataclass(frozen=True)
class Slider:
    """A value that can be changed.

    Attributes
    ----------
    name : as in `orchestrator.landing.monolithic.entry`
    key : of the scenario; what `--set` sets
    least, most, step, value : in `unit`
    """

    name: str
    key: str
    label: str
    unit: str
    least: float
    most: float
    step: float
    value: float


def leave(directory: RunDirectory, system: System, others: bool = True) -> None:
    """Write both files of a landing that the monolithic solver can solve; where it cannot, ``start.json`` says why.

    Parameters
    ----------
    others : whether other points of the span and other robots are solved, too; a long run has more of them
    """
    if not isinstance(system, LandingSystem):
        return
    try:
        about, words = _left(system, others)
    except Exception as error:  # whatever it is: the run's numbers are there, and worth more
        about, words = _none(f"{type(error).__name__}: {error}"), None
    directory.write_json(START, about)
    if words is not None:
        write_bytes(directory.path / START_BLOCKS, words.astype("<f8").tobytes())


def _none(why: str) -> dict[str, Any]:
    return {"format": FORMAT, "reason": why, "starts": []}


def _left(system: LandingSystem, others: bool) -> tuple[dict[str, Any], np.ndarray | None]:
    """Return what is said of the starts, and their blocks."""
    why = _why_not(system)
    if why:
        return _none(why), None
    words, row = _start(system)
    found, rows, first = [words], [{"first": 0, **row}], words.size
    for one in _others(system) if others else ():
        try:
            words, row = _start(one)
        except (InputError, ModuleError):
            continue  # a robot that does not fit there
        found.append(words)
        rows.append({"first": first, **row})
        first += words.size
    return _about(system, rows), np.concatenate(found)


def _why_not(system: LandingSystem) -> str:
    """Return why a landing cannot be solved anew from a block; empty if it can."""
    from orchestrator.landing.monolithic.starts import why_not

    if system.problem() is None:
        return "the monolithic solver cannot stand for an FMU of this landing"
    if system.landing.controller is not None:
        return "a controller flies this landing, which the solver in the page does not have"
    return why_not(system.landing.robot.courses)


def step_of(macro_step: float) -> float:
    """Return after which time (s) signals are shown."""
    if macro_step < SHORTEST:
        return macro_step * math.ceil(SHORTEST / macro_step - 1e-9)
    return macro_step / math.ceil(macro_step / LONGEST - 1e-9)


def _about(system: LandingSystem, rows: list[dict[str, Any]]) -> dict[str, Any]:
    from orchestrator.landing.monolithic.block import kernels_hash
    from orchestrator.landing.monolithic.starts import REFINEMENT

    simulation = system.scenario.simulation
    return {
        "format": FORMAT,
        "reason": None,
        "kernels": kernels_hash(),
        "solver": "monolithic",
        "tolerance": TOLERANCE,
        "refinement": REFINEMENT,
        "step": step_of(simulation.macro_step),
        "end": simulation.stop_time,
        "scenario": system.scenario.name,
        "starts": rows,
    }


# -- one start ------------------------------------------------------------------------------------------------


def _start(system: LandingSystem) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the words of a landing's block, and what is to be known of it."""
    from orchestrator.landing.monolithic.solve import Integrator
    from orchestrator.landing.monolithic.starts import REFINEMENT, packed, places, signals

    made = system.problem()
    assert made is not None
    integrator = Integrator(made(), TOLERANCE, REFINEMENT, start_time=None)
    block = packed(integrator, inertia_stays=not goes_with_mass(system.scenario))
    return block.given, {
        "position": system.scenario.landing.position,
        "robot": system.scenario.robot.model or system.scenario.robot.fmu,
        "given": block.given.size,
        "words": block.words,
        "places": places(block),
        "signals": signals(block, integrator),
        "sliders": [asdict(slider) for slider in _sliders(system, block)],
        "held": _held(system),
        "limits": limits_content(system.limits),
        "pitch": pitch_by_mass(system.landing),
        "geometry": geometry(system.landing),
    }


def _held(system: LandingSystem) -> dict[str, float]:
    """Return what a run of the same mesh has to be given where the mass is another: the mesh is found for a weight."""
    load = "landing_load"
    settings = system.landing.cable.settings
    return {f"cable.parameters.{load}": float(settings[load])} if load in settings else {}


def limits_content(limits: Limits) -> dict[str, Any]:
    """Return the limits as the page's judge takes them."""
    known = {
        name: {
            "limit": limit.value,
            "unit": limit.unit,
            "source": limit.source,
            "formula": f"{limit.formula.text} = {limit.formula.filled}" if limit.formula is not None else "",
            "reference": limit.reference,
        }
        for name, limit in limits.known.items()
    }
    return {"known": known, "missing": dict(limits.missing)}


def _sliders(system: LandingSystem, block: Block) -> Iterator[Slider]:
    mass, damping, friction, speed = block.view(block.given, "start.wishes").tolist()
    fine = 10.0 ** math.floor(math.log10(mass)) / 20.0
    yield _slider("mass", MASS, "Mass", "kg", mass, 0.4 * mass, 2.5 * mass, fine)
    yield _slider("speed", "landing.velocity", _speed(system), "m/s", speed, 0.0, max(1.0, 2.0 * speed), 0.01)
    key = "contact.parameters.friction_coefficient"
    yield _slider("friction", key, "Friction", "1", friction, 0.0, max(1.2, 1.5 * friction), 0.01)
    if system.landing.contact.settings.get("damping_law") == IMPACT:
        most = 3.0 * damping or 1e4
        key, unit = "contact.parameters.damping_coefficient", "N.s/m"
    else:
        most, key, unit = max(3.0, 2.0 * damping), "contact.parameters.damping", "s/m"
    yield _slider("damping", key, "Damping of the contact", unit, damping, 0.0, most, most / 60.0)


def _speed(system: LandingSystem) -> str:
    return "Speed at the start" if system.scenario.landing.height > 0.0 else "Speed at touch-down"


def _slider(name: str, key: str, label: str, unit: str, value: float, low: float, high: float, step: float) -> Slider:
    """Return a slider one of whose steps is the value that the landing has."""
    below, above = (math.floor(abs(end - value) / step + 1e-9) for end in (low, high))
    return Slider(name, key, label, unit, max(value - below * step, 0.0), value + above * step, step, value)


# -- other starts ---------------------------------------------------------------------------------------------


def _others(system: LandingSystem) -> Iterator[LandingSystem]:
    """Yield other robots where the landing is, then the landing at other points of the span, as many as the run is worth."""
    scenario = system.scenario
    worth = min(MOST, int(scenario.simulation.stop_time / scenario.simulation.macro_step / A_START)) - 1
    robots = list(_robots(scenario)) if worth > 0 else []
    changes = [*robots, *_positions(scenario, float(geometry(system.landing)["span"]), worth - len(robots))]
    for change in changes[: max(worth, 0)]:
        with contextlib.suppress(InputError):  # a robot that has no place there
            yield LandingSystem(resolve(_with(scenario, change)))


def _with(scenario: LandingScenario, change: dict[str, Any]) -> LandingScenario:
    changed = scenario.model_copy(update=change)
    return changed.read_from(scenario.path, scenario.provenance, scenario.notes)


def _robots(scenario: LandingScenario) -> Iterator[dict[str, Any]]:
    """Yield the robots of the catalogue built otherwise, not heavier alone; none where the scenario's has values of its own."""
    section = scenario.robot
    if section.model is None or section.parameters or section.inputs:
        return
    seen = [_build(robot_spec.load_robot(section.model))]
    for name, spec in robot_spec.catalogue().items():
        if _build(spec) not in seen:
            seen.append(_build(spec))
            yield {"robot": RobotSection(model=name)}


def _build(spec: robot_spec.RobotSpec) -> tuple[Any, ...]:
    wheels = [wheel.parameters("wheel") for wheel in spec.wheel]
    return spec.layout, spec.contact_parameters, wheels, spec.body.center_of_mass.value


def _positions(scenario: LandingScenario, span: float, most: int) -> Iterator[dict[str, Any]]:
    """Yield landing points along the span, at round distances, so many at most."""
    if scenario.cable.parameters.get("n_elements", 0):
        return  # a mesh that was made for one point
    own = scenario.landing.position
    for distance in (span / 200.0 * round_ for round_ in POSITIONS):
        points = np.arange(distance, span - 1e-9, distance)
        points = points[np.abs(points - own) > 1e-6]
        if len(points) <= most:
            for point in points.tolist():
                yield {"landing": scenario.landing.model_copy(update={"position": float(point)})}
            return
