"""The error of a coupled run, estimated without a reference: the run is made once more, finer or coarser.

Macro step, inner steps and tolerances of the iteration change together, so that no part of the error is common to both
runs. For an error of order p, e(H) ~ H^p, their largest difference d gives the error of the run at H (Richardson's
rule):

    finer, at H/2:   e(H) = d 2^p / (2^p - 1),  between d and 2 d for any p >= 1
    coarser, at 2H:  e(H) = d / (2^p - 1),      between d / 15 and d for p from 4 to 1

What the estimate depends on is whether the error falls with the step, and at H/2 it mostly does (docs/notebook/estimate.md).
"""

from __future__ import annotations

from typing import Any

from orchestrator.coupling.errors import OrchestratorError
from orchestrator.coupling.exchange import EXPLICIT_ORDER, exchange_named
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.masters.options import master_options
from orchestrator.coupling.run.compare import largest_difference
from orchestrator.runs.coupled import Coupled, Reached, completed
from orchestrator.runs.systems import System
from orchestrator.scenario.types import Scenario

RATIOS = {"finer": 0.5, "coarser": 2.0}
"""Estimate → steps of the second run over those of the first."""
TOLERANCES = {"tolerance": 10.0, "local_tolerance": 32.0}
"""By this the master's tolerances are multiplied where steps are doubled, and divided where they are halved: the error of
the iteration changes about as much as that of the steps, a local error of order 5 as by doubled sub-steps."""


def factor(scenario: Scenario, exchange: str) -> float:
    """Return what the largest difference between both runs is multiplied by to estimate the error.

    The order p of the error: 3 for `waveform`, which has 4 where the motion is smooth and about 2 where touch, lift-off
    or slip falls inside a step; 2 for other implicit coupling, of values at an instant; 1 at least for explicit coupling.
    """
    implicit = MASTERS[scenario.simulation.master].IMPLICIT
    order = exchange_named(exchange).order_of_estimates if implicit else EXPLICIT_ORDER
    finer = scenario.simulation.estimate == "finer"
    return (2**order if finer else 1) / (2**order - 1)


def second(system: System) -> System | None:
    """Return what the second run is made of; None if none is asked for, or one coarser of fewer than two macro steps."""
    scenario = system.scenario
    ratio = RATIOS.get(scenario.simulation.estimate)
    if ratio is None:
        return None
    step = ratio * scenario.simulation.macro_step
    count = int(scenario.simulation.stop_time / step * (1.0 + 1e-9))
    if count < 2:
        return None
    changed = system.changed(_options(scenario, ratio), macro_step=step, stop_time=count * step)
    return changed.stepped(ratio)


def _options(scenario: Scenario, ratio: float) -> dict[str, Any]:
    """Return the options of the master with tolerances that go with steps `ratio` times as long."""
    all_options = master_options()[scenario.simulation.master] | scenario.master
    by = {name: change if ratio > 1.0 else 1.0 / change for name, change in TOLERANCES.items()}
    return dict(scenario.master) | {n: all_options[n] * change for n, change in by.items() if all_options.get(n)}


def estimate_error(coupled: Coupled, progress: Reached = lambda _: None) -> Coupled | None:
    """Estimate the error of a finished run by a second one, and note it in `coupled`; a failure is noted, not raised.

    Returns
    -------
    Coupled or None
        the second run; None where there is none, or it failed
    """
    scenario = coupled.scenario
    again = second(coupled.system) if coupled.log.error is None else None
    if again is None:
        return None
    signals = [name for name in scenario.simulation.tolerances if name in coupled.table]
    coupled.estimated_error = dict.fromkeys(signals, float("nan"))
    try:
        other = completed(again, progress)
    except OrchestratorError as error:
        coupled.estimate_failure = str(error)
        return None
    coarse, fine = sorted((coupled.table, other.table), key=lambda table: len(table["time"]))
    difference, by = largest_difference(coarse, fine), factor(scenario, coupled.exchange)
    coupled.estimated_error = {name: by * difference[name] for name in signals}
    return other
