"""The error of a coupled run, estimated without a reference: the run is repeated with everything coarser.

Macro step and inner steps are doubled and the tolerances of the iteration raised, so that each of the errors grows;
the largest difference between both runs over a divisor, 2^p - 1 for an error of order p, then estimates the error of
the finer one (Richardson's rule). p is not measured by a third run: on the landings that predicts worse
(docs/estimate.md).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator import vocabulary
from orchestrator.masters import MASTERS
from orchestrator.results import Table
from orchestrator.scenario import CableSection, Component, RobotSection, Scenario

RAISED = {"tolerance": 10.0, "local_tolerance": 32.0}
"""By this the master's tolerances are multiplied: the error of the iteration grows about as much as that of the step, a
local error of order 5 as by doubled sub-steps."""
INNER_STEP = "integration_step"


def divisor(scenario: Scenario, exchange: str) -> float:
    """Return what the difference between both runs is divided by.

    `waveform` has order 4 where the motion is smooth and about 2 where touch, lift-off or slip falls inside a step: p
    is taken as 3. Other implicit coupling, of values at an instant, has order 2. For explicit coupling, of order 1 at
    least, the difference is taken as it is.
    """
    if not MASTERS[scenario.simulation.master].IMPLICIT:
        return 1.0
    return 7.0 if exchange == "waveform" else 3.0


def coarser(scenario: Scenario) -> Scenario | None:
    """Return the scenario with everything coarser; None if it has fewer than four macro steps."""
    simulation = scenario.simulation
    count, doubled = round(simulation.stop_time / simulation.macro_step), 2.0 * simulation.macro_step
    if count < 4:
        return None
    copy = scenario.changed(macro_step=doubled, stop_time=(count // 2) * doubled)
    for section, step in _inner_steps(copy):
        section.parameters[INNER_STEP] = 2.0 * step
    options = vocabulary.masters()[simulation.master] | copy.master
    copy.master.update({name: factor * options[name] for name, factor in RAISED.items() if options.get(name)})
    return copy


def _inner_steps(scenario: Scenario) -> Iterator[tuple[CableSection | RobotSection | Component, float]]:
    """Yield the sections of all components that have an inner step of their own, and that step, s.

    That of our cable follows the macro step where the scenario gives none (`orchestrator.landing`).
    """
    for section in (scenario.cable, scenario.robot, *scenario.components.values()):
        if section is not None and INNER_STEP in section.parameters:
            yield section, float(section.parameters[INNER_STEP])
    robot = scenario.robot
    if robot is not None and robot.fmu is None and INNER_STEP not in robot.parameters:
        yield robot, float(vocabulary.of_module("robot")[INNER_STEP].start)


def estimated_error(fine: Table, coarse: Table, divisor: float) -> dict[str, float]:
    """Return the estimated largest error of every signal of `fine`, in its unit; every other row is in `coarse`."""
    rows = slice(0, 2 * len(coarse["time"]) - 1, 2)
    return {
        name: float(np.max(np.abs(values[rows] - coarse[name]))) / divisor
        for name, values in fine.items()
        if name in coarse and name != "time"
    }
