"""The reference of a comparison: the monolithic solver, or a much finer coupled run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import reduce
from math import gcd
from typing import Any

import numpy as np

from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import RunError
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.masters.options import master_options
from orchestrator.coupling.run.compare import communication_times, largest_difference
from orchestrator.coupling.run.results import Table, plain
from orchestrator.landing import monolithic
from orchestrator.landing.monolithic import Problem
from orchestrator.runs.compare import Reference
from orchestrator.runs.components import is_idle, opened
from orchestrator.runs.coupled import Interrupted, Reached, completed
from orchestrator.runs.errors import differences, judged, left_out
from orchestrator.runs.estimate import solved
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.types import DEFAULT_MASTER, Scenario

FINER_MESH = 2.0
"""Elements of the mesh that the runs' is held against, over theirs: it leaves an eighth of their error."""
ON_FINER_MESH = 1e-8
"""m; local error of a step there, which leaves a thousandth of the error of a mesh."""
TIGHTER = 1e-2
"""The reference's tolerance by that of the runs, so that it does not show what their iterations leave."""


def solve_reference(
    system: System | Scenario, macro_steps: Iterable[float], progress: Reached = lambda _: None
) -> Reference:
    """Return the reference at the communication points of all `macro_steps`; a scenario is resolved first."""
    if isinstance(system, Scenario):
        system = resolve(system)
    steps, problem = list(macro_steps), system.problem()
    if problem is None:
        return _fine_reference(system, steps, progress)
    return _monolithic_reference(
        system, problem, communication_times(system.scenario.simulation.stop_time, steps), progress
    )


def _monolithic_reference(
    system: System, problem: Callable[[], Problem], times: np.ndarray, progress: Reached
) -> Reference:
    try:
        solution = monolithic.solve(problem, times, progress=progress)
    except ModuleError as error:
        raise RunError(str(error)) from None
    fields, table = system.split({"time": times, **solution.signals})
    contacts = sum(name.endswith(".normal_force") for name in table)
    table = {name: values for name, values in table.items() if not is_idle(name.partition(".")[2], contacts)}
    estimates = {name: solution.estimated_error[name] for name in table if name != "time"}
    finer = system.meshed(FINER_MESH)
    if finer is None:
        said = _safety(system, table, fields, estimates)
        return Reference("monolithic", table, solution.wall_s, estimates, fields, safety=said)
    on_finer = solved(finer.system, times, progress, ON_FINER_MESH)
    by = left_out(finer.ratio) - 1.0  # what is left of the error of a mesh on the finer one, by their difference
    for name, value in differences(table, on_finer, judged(table, system.scenario.simulation.tolerances)).items():
        estimates[name] += by * value
    said = _safety(system, table, fields, estimates)
    return Reference("monolithic", table, solution.wall_s, estimates, fields, on_finer, finer.ratio, said)


def _safety(system: System, table: Table, fields: dict[str, np.ndarray], errors: Mapping[str, float]) -> dict[str, Any]:
    """Return what is to be said of the safety of a landing; nothing of a general graph."""
    found = system.safety(table, fields, errors)
    return plain(found.content()) if found is not None else {}


def _fine_reference(system: System, macro_steps: list[float], progress: Reached) -> Reference:
    """Return the same graph at a much smaller macro step; its error is taken from one twice as large."""
    common, own = common_divisor(macro_steps), system.scenario.master
    try:
        fine, coarse = (completed(_accurate(system, common / n), progress) for n in (8, 4))
    except Interrupted:
        raise
    except RunError:  # an FMU cannot go back: the master that was asked for has to do
        try:
            fine, coarse = (completed(system.changed(own, macro_step=common / n), progress) for n in (8, 4))
        except Interrupted:
            raise
        except RunError as error:
            raise _without_reference(system, error) from None
    kind = f"coupled, {fine.master}, macro step {fine.log.macro_step:g} s"
    errors = dict(largest_difference(coarse.table, fine.table))
    said = _safety(system, fine.table, fine.fields, errors)
    return Reference(kind, fine.table, fine.log.wall, errors, safety=said)


def _without_reference(system: System, error: RunError) -> RunError:
    """Return that there is no finer run because of `error`, and whose fault it is where FMUs cannot vary their steps."""
    with opened(system) as graph:
        fixed = [name for name, fmu in graph.components.items() if not fmu.capabilities.variable_step]
    whose = (
        f"{', '.join(fixed)} cannot vary the step (canHandleVariableCommunicationStepSize is false): " if fixed else ""
    )
    message = f"no reference to hold the runs against: {whose}a finer run fails: {error}; `run` alone can be had"
    return RunError(message, error.time)


def _accurate(system: System, macro_step: float) -> System:
    """Return the system at `macro_step` (s) with an implicit master, its own if it has one, and a tight tolerance."""
    scenario = system.scenario
    own = MASTERS[scenario.simulation.master].IMPLICIT
    name, options = (scenario.simulation.master, dict(scenario.master)) if own else (DEFAULT_MASTER, {})
    tolerance = options.get("tolerance", master_options()[name]["tolerance"])
    return system.changed(options | {"tolerance": TIGHTER * tolerance}, master=name, macro_step=macro_step)


def common_divisor(steps: Iterable[float]) -> float:
    """Return the largest step of which all `steps` are multiples, to nine digits."""
    fractions = [Fraction(step).limit_denominator(10**9) for step in steps]
    denominator = reduce(lambda a, b: a * b // gcd(a, b), (f.denominator for f in fractions))
    return reduce(gcd, (int(f * denominator) for f in fractions)) / denominator
