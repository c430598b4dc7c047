"""The start of a landing as a block, from which it can be solved anew with other masses, speeds, friction and damping."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from fmus.contact import places as at
from fmus.contact.law import IMPACT
from fmus.robot import rigid_body as rb
from orchestrator.coupling.course import Course
from orchestrator.landing.monolithic.block import Block, Parts, pack
from orchestrator.landing.monolithic.control_loads import ControlLoads
from orchestrator.landing.monolithic.entry import CONTACT, WHEEL_FORCE, Start
from orchestrator.landing.monolithic.solve import Integrator, recorded, shown_of

ALONG = ("shape[", "node[")
"""How the cable's outputs begin that are many along it; the state has its nodes, all of them."""
TENSION = 3
"""Place in a row of the shape."""
MOST_KINKS = 500
"""Of inputs over time; more would make the block many times as large."""
REFINEMENT = 2
"""As `solve` divides the intervals between output times, so that its solution is the same."""


def why_not(courses: Mapping[str, Course]) -> str:
    """Return why a landing whose inputs follow these courses cannot be packed; empty if it can."""
    kinks = len({t for course in courses.values() for t in course.kinks(0.0, np.inf)})
    return f"inputs over time with {kinks} kinks, more than {MOST_KINKS}" if kinks > MOST_KINKS else ""


def packed(integrator: Integrator, inertia_stays: bool = False) -> Block:
    """Return the block of a landing at its start.

    Parameters
    ----------
    integrator : newly made, begun or not
    inertia_stays : whether another mass leaves the inertia as it is
    """
    one, start = integrator, start_of(integrator, inertia_stays)
    return pack(Parts(one.system, one.state, one.control, start, shown_of(one.problem), one.space, one.work))


def start_of(one: Integrator, inertia_stays: bool = False) -> Start:
    """Return what a solution starts from beside system and state; parameters as for `packed`."""
    return Start(_wishes(one), _options(one, inertia_stays), _segments(one.loads))


def _wishes(one: Integrator) -> np.ndarray:
    """Return mass, damping, friction and speed as the landing has them."""
    contact = one.system.contacts[0]
    damping = contact[at.DAMPING_COEFFICIENT if contact[at.DAMPING_LAW] == IMPACT else at.DAMPING]
    speed = -_initial_rise(one)
    return np.array([one.system.robot[rb.MASS], damping, contact[at.FRICTION_COEFFICIENT], speed])


def _initial_rise(one: Integrator) -> float:
    """Return the speed upwards (m/s) of the robot's reference point at the start."""
    robot = one.problem.robot
    return float(robot.values[robot.table.index["initial.velocity.z"]])


def _options(one: Integrator, inertia_stays: bool) -> np.ndarray:
    turning = one.state.robot[rb.VELOCITY + 2] - _initial_rise(one)
    return np.array([float(inertia_stays), turning, *one.options[2:]])


def _segments(loads: ControlLoads) -> np.ndarray:
    """Return the times within which the control loads are straight, with loads and rates: (k, 2 + 2 m)."""
    edges = [0.0, *loads.kinks(0.0, np.inf), np.inf]
    rows = []
    for first, last in pairwise(edges):
        loads.set(first, last if np.isfinite(last) else first)
        rows.append([first, last, *loads.values.ravel()])
    loads.set(0.0, 0.0)
    return np.array(rows)


# -- what stands where ----------------------------------------------------------------------------------------


def places(block: Block) -> dict[str, Any]:
    """Return where, beside the signals, something is to be written or read: word and length; of the tension also stride."""
    wishes, nodes, cable, shape = (
        block.places[name] for name in ("start.wishes", "system.model.s", "state.cable", "shown.shape")
    )
    return {
        "wishes": wishes.first,
        "nodes": [nodes.first, *nodes.shape],
        "line": cable.first,
        "tension": [shape.first + TENSION, *shape.shape],
    }


def signals(block: Block, integrator: Integrator) -> dict[str, int]:
    """Return signal → its word in the block after `show`; those of the reference, and the forces on the wheels."""
    problem, n_wheels = integrator.problem, len(integrator.problem.contacts)
    names, places = recorded(problem.cable.table)
    found = {
        f"cable.{name}": _cable_word(block, place)
        for name, place in zip(names, places, strict=True)
        if not name.startswith(ALONG) and _port_of(name) <= n_wheels
    }
    first = block.places["shown.robot"].first
    robot = zip(*recorded(problem.robot.table), strict=True)
    return found | {f"robot.{name}": first + place for name, place in robot} | dict(_of_contacts(block, n_wheels))


def _port_of(name: str) -> int:
    """Return the number of the cable's port that an output belongs to; 0 of none."""
    return int(name[5 : name.index("]")]) if name.startswith("port[") else 0


def _cable_word(block: Block, place: int) -> int:
    """Return the word of an output of the cable, by its place among all of them."""
    ports = block.places["shown.ports"]
    behind = place - int(np.prod(ports.shape))
    return ports.first + place if behind < 0 else block.places["shown.cable"].first + behind


def _of_contacts(block: Block, n_wheels: int) -> Iterator[tuple[str, int]]:
    first, (_, width) = block.places["shown.contacts"]
    for k in range(n_wheels):
        for i, name in enumerate(CONTACT):
            yield f"contact{k + 1}.{name}", first + k * width + i
        for i, axis in enumerate("xyz"):
            yield f"contact{k + 1}.wheel.force.{axis}", first + k * width + WHEEL_FORCE + i
