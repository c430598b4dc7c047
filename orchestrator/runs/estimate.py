"""The error of a coupled run, estimated without a reference: runs in which one part of it is refined.

*Coupling*: macro step halved and tolerances of the iteration divided by ten, inner steps as they are. *Inner steps*: those of
all components halved. *Mesh*: the monolithic solver, where there is one, on the run's mesh and on a finer one. For an
error of order p, e(h) ~ h^p, the largest difference d from a run with steps (or elements) r times shorter gives
(Richardson's rule)

    e(h) = d / (1 - r^-p),    between d and 2 d for r = 2 and any p >= 1

The sum of the parts is the error of the run. What no part has: the contact law, the data, a foreign FMU's own inner
steps and mesh (docs/concepts/error.md).
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Container, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import OrchestratorError, RunError
from orchestrator.coupling.exchange import EXPLICIT_ORDER, exchange_named
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.masters.options import master_options
from orchestrator.coupling.run.interrupt import Interruption, interruptible
from orchestrator.coupling.run.results import Table
from orchestrator.runs.coupled import Coupled, Interrupted, Reached, completed
from orchestrator.runs.errors import NAMES, Differences, Parts, differences, left_out, range_of
from orchestrator.runs.systems import System
from orchestrator.scenario.types import Scenario

RATIOS = {"finer": 0.5, "coarser": 2.0}
"""Estimate → macro step of the second run over that of the first."""
TOLERANCES = {"tolerance": 10.0, "local_tolerance": 32.0}
"""By this the master's tolerances are multiplied where steps are doubled, and divided where they are halved: the error of
the iteration changes about as much as that of the steps, a local error of order 5 as by doubled sub-steps."""
OF_INNER_STEPS = 1.0 / (1.0 - 0.5**3)
"""Factor of the difference from a run of half the inner steps: order 3, that of our cable's collocation."""
BEGINNING, ENOUGH, TRIFLE = 0.2, 20, 0.03
"""Share of a run, of so many macro steps at least, whose inner steps are looked at first; where they have less than this
share of the error, or of the tolerance, the rest is spared."""
ROUGH = 'by a coarser run an estimate is often three times too small on a line; estimate = "finer" is not'
GROSS = 0.5
"""Error, by the signal's range, beyond which the difference of two runs says that both are wrong, and no more."""
MESH_TOLERANCE = 1e-6
"""m; local error of a monolithic step, which leaves 3e-7 of the flagship's range: a hundredth of what a mesh leaves."""
Found = dict[str, Differences | None]
"""Part → its errors."""
Kept = list[Coupled]
"""Holds the second run, once it is made."""
Told = Callable[[str], Reached]
"""Returns what is told the time that the run for a part has come to."""


def factor(scenario: Scenario, exchange: str) -> float:
    """Return what the largest difference from the second run is multiplied by to estimate the error of the coupling.

    The order p of the error: 3 for `waveform`, which has 4 where the motion is smooth and about 2 where touch, lift-off
    or slip falls inside a step; 2 for other implicit coupling, of values at an instant; 1 at least for explicit coupling.
    """
    implicit = MASTERS[scenario.simulation.master].IMPLICIT
    order = exchange_named(exchange).order_of_estimates if implicit else EXPLICIT_ORDER
    finer = scenario.simulation.estimate == "finer"
    return (2**order if finer else 1) / (2**order - 1)


def second(system: System) -> System | None:
    """Return what the second run is made of; None if none is asked for, or one coarser of fewer than two macro steps.

    A finer one keeps the inner steps, which are a part of their own; in a coarser one they are doubled too.
    """
    scenario = system.scenario
    ratio = RATIOS.get(scenario.simulation.estimate)
    if ratio is None:
        return None
    step = ratio * scenario.simulation.macro_step
    count = int(scenario.simulation.duration / step * (1.0 + 1e-9))
    if count < 2:
        return None
    inner = system.stepped(1.0 if ratio < 1.0 else ratio)
    return inner.changed(
        _options(scenario, ratio), macro_step=step, stop_time=scenario.simulation.start_time + count * step
    )


def _options(scenario: Scenario, ratio: float) -> dict[str, Any]:
    """Return the options of the master with tolerances that go with steps `ratio` times as long."""
    all_options = master_options()[scenario.simulation.master] | scenario.master
    by = {name: change if ratio > 1.0 else 1.0 / change for name, change in TOLERANCES.items()}
    return dict(scenario.master) | {n: all_options[n] * change for n, change in by.items() if all_options.get(n)}


def estimate_error(
    coupled: Coupled, told: Told = lambda _: lambda _: None, parts: Container[str] = frozenset(NAMES)
) -> Coupled | None:
    """Estimate the parts of a finished run's error, and note them in `coupled`; a failure is noted, not raised.

    Parameters
    ----------
    parts : those that are wanted, of `NAMES`

    Returns
    -------
    Coupled or None
        the second run, that of the coupling; None where there is none, or it failed
    """
    again = second(coupled.system) if coupled.log.error is None else None
    if again is None:
        return None
    found, second_run = Found(), Kept()
    makers = {
        "coupling": lambda: _of_coupling(coupled, again, second_run, told(NAMES["coupling"])),
        "mesh": lambda: _of_mesh(coupled, told(NAMES["mesh"])),
        "inner_steps": lambda: _of_inner_steps(coupled, second_run, found, told(NAMES["inner_steps"])),
    }
    for part, make in ((name, make) for name, make in makers.items() if name in parts):
        found[part], goes_on = _attempted(coupled, part, make)
        if not goes_on:
            break
    coupled.error_parts = {n: _parts([(found.get(part) or {}).get(n) for part in NAMES]) for n in coupled.judged}
    coupled.estimate_doubts = [line for run in second_run for line in doubts(coupled, run)]
    return second_run[0] if second_run else None


def doubts(coupled: Coupled, second_run: Coupled) -> list[str]:
    """Return what makes an estimate one that no calibration speaks for, a line each."""
    bad = second_run.log.unconverged
    lines = [ROUGH] if coupled.scenario.simulation.estimate == "coarser" else []
    lines += [f"{bad} macro steps of the second run did not converge"] if bad else []
    large = [n for n, parts in coupled.error_parts.items() if parts.total >= GROSS * range_of(coupled.table[n])]
    return lines + [
        f"the error of {name} is half its range or more: so far apart two runs tell no error" for name in large
    ]


def _attempted(coupled: Coupled, part: str, make: Callable[[], Differences | None]) -> tuple[Differences | None, bool]:
    """Return the errors of a part by signal, and whether to go on with others: not after Ctrl-C.

    They are NaN where its run failed, which is noted; None where there is no such part.
    """
    try:
        return make(), True
    except (OrchestratorError, ModuleError) as error:
        coupled.estimate_failure += f"{'; ' if coupled.estimate_failure else ''}{NAMES[part]}: {error}"
        if isinstance(error, Interrupted) and error.number != signal.SIGINT:
            coupled.stopped = error.number
        return dict.fromkeys(coupled.judged, float("nan")), not isinstance(error, Interrupted)


def _parts(values: Sequence[float | None]) -> Parts:
    """Return the error of a signal from its parts, in the order of their names."""
    return Parts(*values, total=float(np.sum([value for value in values if value is not None])))


# -- the parts ------------------------------------------------------------------------------------------------


def _of_coupling(coupled: Coupled, again: System, kept: Kept, progress: Reached) -> Differences:
    other = completed(again, progress, _place(coupled, "coupling"))
    kept.append(other)
    return _scaled(coupled.table, other.table, coupled.judged, factor(coupled.scenario, coupled.exchange))


def _of_inner_steps(coupled: Coupled, second_run: Kept, found: Found, progress: Reached) -> Differences | None:
    """Return the errors of the inner steps; None where no component has them, or the second run has shown them already.

    A finer run shows those that are longer than its macro steps, since it shortens them.
    """
    system, finer = coupled.system, 0.5 * coupled.scenario.simulation.macro_step
    again = system.stepped(0.5, longest=finer)
    if coupled.scenario.simulation.estimate == "coarser" or again.scenario == system.stepped(1.0).scenario:
        return None
    steps = int(BEGINNING * (len(coupled.table["time"]) - 1))
    if second_run and found["coupling"] is not None and steps >= ENOUGH:
        small = _where_small(coupled, again, second_run[0], found, steps, progress)
        if small is not None:
            return small
    return _scaled(
        coupled.table, completed(again, progress, _place(coupled, "inner_steps")).table, coupled.judged, OF_INNER_STEPS
    )


def _where_small(
    coupled: Coupled, again: System, second_run: Coupled, found: Found, steps: int, progress: Reached
) -> Differences | None:
    """Return the errors of the inner steps from the run's beginning alone; None where they may be more than a trifle.

    What they are of the coupling's there they are taken to be in the end.
    """
    end = coupled.table["time"][steps]
    begun, second_begun = (until(table, end) for table in (coupled.table, second_run.table))
    brief = completed(again.changed(dict(coupled.scenario.master), stop_time=float(end)), progress).table
    names = coupled.judged
    inner, coupling = differences(begun, brief, names), differences(begun, second_begun, names)
    whole, by = found["coupling"] or {}, OF_INNER_STEPS / factor(coupled.scenario, coupled.exchange)
    errors: Differences = {}
    for name in names:
        ratio = inner[name] / coupling[name] if coupling[name] > 0.0 else 0.0
        errors[name] = max(by * ratio * whole[name], OF_INNER_STEPS * inner[name])
        known = sum((part or {}).get(name, 0.0) for part in found.values())
        tolerance = coupled.scenario.simulation.tolerances.get(name, 0.0)
        if not errors[name] <= TRIFLE * max(known, tolerance * range_of(coupled.table[name])):
            return None
    return errors


def until(table: Table, end: float) -> Table:
    """Return the rows of a table up to the time `end`."""
    rows = table["time"] <= end * (1.0 + 1e-9)
    return {name: values[rows] for name, values in table.items()}


def _of_mesh(coupled: Coupled, progress: Reached) -> Differences | None:
    """Return the errors of the mesh; None where there is none, or it is that of a foreign FMU."""
    system = coupled.system
    finer = system.meshed()
    if finer is None:
        return None
    by = left_out(finer.ratio)
    if system.problem() is None or finer.system.problem() is None:
        table = completed(finer.system, progress, _place(coupled, "mesh")).table
        return _scaled(coupled.table, table, coupled.judged, by)
    own, fine = (solved(one, coupled.table["time"], progress) for one in (system, finer.system))
    return _scaled(own, fine, coupled.judged, by)


def _place(coupled: Coupled, part: str) -> Path | None:
    """Return where the run for a part is kept while it is needed."""
    return coupled.folder / part if coupled.folder is not None else None


def solved(system: System, times: np.ndarray, progress: Reached, tolerance: float = MESH_TOLERANCE) -> Table:
    """Return the signals of the monolithic solution at `times` (n,), s; `RunError` if there is none."""
    from orchestrator.landing import monolithic  # with its kernels, which other runs do not need

    problem = system.problem()
    assert problem is not None
    try:
        with interruptible() as check:
            found = monolithic.solve(problem, times, tolerance, estimate=False, progress=_both(progress, check))
    except Interruption as error:
        raise Interrupted(str(error), error.time, error.number) from None
    except ModuleError as error:
        raise RunError(str(error)) from None
    return {"time": found.time, **found.signals}


def _both(first: Reached, second: Reached) -> Reached:
    def told(time: float) -> None:
        first(time)
        second(time)

    return told


def _scaled(table: Table, other: Table, names: Sequence[str], by: float) -> Differences:
    return {name: by * value for name, value in differences(table, other, names).items()}
