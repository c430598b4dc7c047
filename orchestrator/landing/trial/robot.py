"""The trial of a robot: its start, free fall, known loads, motion, means, energy, a ride under all loads."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from orchestrator.coupling.fmu.description import Value
from orchestrator.landing.contract import ROBOT
from orchestrator.landing.trial import loads as known_loads
from orchestrator.landing.trial.answers import (
    Asked,
    Stance,
    body_found,
    body_shown,
    input_of,
    load_names,
    stance,
    wheels,
)
from orchestrator.landing.trial.bench import Bench, Isolation, held
from orchestrator.landing.trial.body import Body, Wrench
from orchestrator.landing.trial.falling import falling, holds_itself, starts, up_to_date
from orchestrator.landing.trial.means import means, motions, pair
from orchestrator.landing.trial.moving import kinematics, ride, work
from orchestrator.landing.trial.row import Row, untestable

START: dict[str, Value] = {
    "initial.position.x": 0.3, "initial.position.y": 20.0, "initial.position.z": 4.0,
    "initial.roll": 0.2, "initial.pitch": -0.15, "initial.yaw": 0.4,
}  # fmt: skip
"""Where experiments start, as far as the robot has such parameters: turned, so that frames cannot be mixed up unseen."""
FROM_PARAMETERS = "Newton–Euler with the mass, centre of mass and inertia that it shows"
FROM_ANSWERS = "Newton–Euler with the mass, centre of mass and inertia found from its own answers"


def bench_of(path: Path, macro_step: float | None = None, isolate: Isolation = False) -> Bench:
    """Return a bench on which a robot starts turned, with nothing applied."""
    names = (name for point in ROBOT if point.causality == "input" for k in range(1, 5) for name in point.names(k))
    from orchestrator.catalogue.modules import of_fmu

    start = {name: value for name, value in START.items() if name in of_fmu(path)}
    return Bench(path, start, macro_step, dict.fromkeys(names), isolate)


def robot_rows(bench: Bench) -> Iterator[Row]:
    """Yield what a robot's answers say, row by row."""
    n = wheels(bench)
    if n == 0:
        yield untestable("robot", "it has no wheels (outputs wheel[k].position.*)")
        return
    yield from starts(bench, n)
    current = up_to_date(bench, n)
    yield current
    if current.verdict == "FAIL":
        yield untestable("free fall, known loads, means, energy", "its outputs are not those of the step")
        return
    yield from falling(bench, n)
    asked = Asked(bench)
    stands = stance(bench.run({}, bench.H, 1), n)
    body, source = _body(bench, asked, stands)
    judge = known_loads.Judge(asked, stands, body, source)
    single = list(known_loads.single_loads(judge))
    yield from single
    yield known_loads.together(judge)
    yield known_loads.reciprocity(judge)
    yield from known_loads.control(judge)
    yield from known_loads.slopes(judge)
    yield from _moved(bench, n, judge, all(row.verdict == "pass" for row in single))


def _body(bench: Bench, asked: Asked, stands: Stance) -> tuple[Body | None, str]:
    """Return the body that a robot is held against, and where it is known from."""
    shown = body_shown(bench, stands)
    return (shown, FROM_PARAMETERS) if shown is not None else (body_found(asked, stands), FROM_ANSWERS)


def _moved(bench: Bench, n: int, judge: known_loads.Judge, obeys: bool) -> Iterator[Row]:
    """Yield rows of the motion under all loads at once."""
    wrench = shaking(judge.body, n)
    loads = inputs_of(wrench)
    two = pair(bench, held(loads, 2 * bench.H))
    yield from kinematics(bench, two, loads, n)
    yield from means(two, motions(bench))
    yield work(bench, two, loads, n)
    if judge.body is None or not obeys:
        yield untestable("all loads over 0.3 s", "single loads do not act as they should")
    elif holds_itself(bench):
        yield untestable("all loads over 0.3 s", "it holds itself in the air, by a control of its own")
    else:
        yield ride(bench, judge, wrench, loads)


def shaking(body: Body | None, n: int) -> Wrench:
    """Return loads at all wheels that move a robot by some m/s² and turn it by some rad/s²."""
    mass, turning = (body.mass, np.diag(body.inertia)) if body is not None else (30.0, np.full(3, 5.0))
    shares = np.array([[1.0, -0.8, 0.6], [-0.4, 1.0, 0.7], [0.7, 0.5, -1.0], [-0.6, -0.9, 0.8]])[:n] / n
    return Wrench(5.0 * mass * shares, 8.0 * turning * shares[:, [2, 0, 1]])


def inputs_of(wrench: Wrench) -> dict[str, float]:
    """Return loads at the wheels by the robot's inputs."""
    n = len(wrench.force)
    return {input_of(load): float(getattr(wrench, load[1])[load[0], load[2]]) for load in load_names(n)}
