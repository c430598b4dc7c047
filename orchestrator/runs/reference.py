"""The reference of a comparison: the monolithic solver, or a much finer coupled run."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import reduce
from math import gcd

import numpy as np

from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import RunError
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.masters.options import master_options
from orchestrator.coupling.run.compare import communication_times, largest_difference
from orchestrator.landing import build as landing
from orchestrator.landing import monolithic
from orchestrator.runs.compare import Reference
from orchestrator.runs.components import only_couples, split_fields
from orchestrator.runs.coupled import completed
from orchestrator.runs.record import Progress
from orchestrator.scenario.types import DEFAULT_MASTER, LandingScenario, Scenario

TIGHTER = 1e-2
"""The reference's tolerance by that of the runs, so that it does not show what their iterations leave."""


def solve_reference(scenario: Scenario, macro_steps: Iterable[float], progress: Progress = lambda _: None) -> Reference:
    """Return the reference at the communication points of all `macro_steps`."""
    steps = list(macro_steps)
    if isinstance(scenario, LandingScenario) and landing.has_monolithic(scenario):
        return _monolithic_reference(scenario, communication_times(scenario.simulation.stop_time, steps), progress)
    return _fine_reference(scenario, steps, progress)


def _monolithic_reference(scenario: LandingScenario, times: np.ndarray, progress: Progress) -> Reference:
    try:
        solution = monolithic.solve(lambda: landing.problem(scenario), times, progress=progress)
    except ModuleError as error:
        raise RunError(str(error)) from None
    fields, table = split_fields(scenario, {"time": times, **solution.signals})
    contacts = sum(name.endswith(".normal_force") for name in table)
    table = {name: values for name, values in table.items() if not only_couples(name.partition(".")[2], contacts)}
    estimates = {name: solution.estimated_error[name] for name in table if name != "time"}
    return Reference("monolithic", table, solution.wall_s, estimates, fields)


def _fine_reference(scenario: Scenario, macro_steps: list[float], progress: Progress) -> Reference:
    """Return the same graph at a much smaller macro step; its error is taken from one twice as large."""
    common = common_divisor(macro_steps)
    try:
        fine, coarse = (completed(_accurate(scenario, common / n), progress) for n in (8, 4))
    except RunError:  # an FMU cannot go back: the master that was asked for has to do
        fine, coarse = (completed(scenario.changed(macro_step=common / n), progress) for n in (8, 4))
    kind = f"coupled, {fine.master}, macro step {fine.log.macro_step:g} s"
    return Reference(kind, fine.table, fine.log.wall, dict(largest_difference(coarse.table, fine.table)))


def _accurate(scenario: Scenario, macro_step: float) -> Scenario:
    """Return the scenario at `macro_step` (s) with an implicit master, its own if it has one, and a tight tolerance."""
    own = MASTERS[scenario.simulation.master].IMPLICIT
    name, options = (scenario.simulation.master, dict(scenario.master)) if own else (DEFAULT_MASTER, {})
    tolerance = options.get("tolerance", master_options()[name]["tolerance"])
    return scenario.changed(options | {"tolerance": TIGHTER * tolerance}, master=name, macro_step=macro_step)


def common_divisor(steps: Iterable[float]) -> float:
    """Return the largest step of which all `steps` are multiples, to nine digits."""
    fractions = [Fraction(step).limit_denominator(10**9) for step in steps]
    denominator = reduce(lambda a, b: a * b // gcd(a, b), (f.denominator for f in fractions))
    return reduce(gcd, (int(f * denominator) for f in fractions)) / denominator
