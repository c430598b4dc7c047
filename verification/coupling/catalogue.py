"""Each robot of the catalogue is let go at midspan, at point 9 and on the rig, coupled at 5 ms, against the monolithic solver.

Wanted is an error of 1e-3 of the range of Z, and of a landing that fails the same end: toppled (turned by more than a
quarter turn in roll or pitch), or a wheel that the cable has left, within 1 % of the same time. After that the
motion is no landing any more, and Z is compared up to there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path

import numpy as np

from fmus.contact.law import LEFT
from fmus.module.variables import ModuleError
from orchestrator.catalogue.modules import robots
from orchestrator.coupling.errors import OrchestratorError
from orchestrator.landing.build import problem
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario
from verification.study import Result, Row

TITLE = "Every robot of the catalogue"
LINES = {"midspan": "landing_200m_midspan", "point 9": "landing_200m_point9", "rig": "rig_10m"}
STOP, MACRO_STEP, TOLERANCE = 10.0, 0.005, 1e-9
"""s; s; m, local error of the reference's steps, which leaves less than 1e-7 of its range."""
WANTED, SAME_TIME = 1e-3, 1e-2
HEIGHT = "robot.body.position.z"
Signals = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Ended:
    """What became of a landing.

    Attributes
    ----------
    how : ``landed``, ``toppled``, ``left the groove``, or ``stopped``: it could not go on
    time : when, s; the end of the run where it landed
    z : (n,) m, heights at the communication points that were reached
    why : what was said of a run that stopped
    """

    how: str
    time: float
    z: np.ndarray
    why: str = ""


def ended(time: np.ndarray, signals: Signals, why: str = "") -> Ended:
    """Return what became of a landing whose run ended at the last of `time`, at the stop time unless `why` says else."""
    statuses = [values for name, values in signals.items() if name.startswith("contact") and name.endswith(".status")]
    turned = np.abs([signals["robot.roll"], signals["robot.pitch"]]) > math.pi / 2.0
    found = {"left the groove": np.any(np.array(statuses) == LEFT, axis=0), "toppled": np.any(turned, axis=0)}
    first = {how: float(time[np.argmax(when)]) for how, when in found.items() if np.any(when)}
    how = min(first, key=lambda name: first[name], default="stopped" if why else "landed")
    return Ended(how, first.get(how, float(time[-1])), signals[HEIGHT], why)


def both(case: tuple[str, str]) -> tuple[Ended, Ended]:
    """Return what becomes of a robot on a line, coupled and monolithic."""
    robot, line = case
    one = load(LINES[line], [f"simulation.stop_time={STOP}", f"simulation.macro_step={MACRO_STEP}"], robot)
    run = run_coupled(one)
    coupled = ended(run.table["time"], run.table, str(run.log.error or ""))
    return coupled, _monolithic(one)


def _monolithic(one: Scenario) -> Ended:
    """Return what becomes of it in the reference, up to where that cannot go on."""
    times = MACRO_STEP * np.arange(round(STOP / MACRO_STEP) + 1)
    reached = [0.0]
    try:
        found = integrate(lambda: problem(one), times, TOLERANCE, progress=reached.append)
        return ended(times, found.signals)
    except (ModuleError, OrchestratorError) as error:
        times = times[times <= reached[-1]]
        return ended(times, integrate(lambda: problem(one), times, TOLERANCE).signals, str(error))


def rows(robot: str, line: str, coupled: Ended, reference: Ended) -> Iterator[Row]:
    """Yield the rows of a landing."""
    where, source = f"{robot}, {line}", f"monolithic: {reference.how}"
    alike = coupled.how == reference.how
    if reference.how != "landed" or not alike:
        what = f"{where}: {coupled.how}, s" if alike else f"{where}: {coupled.how}, not {reference.how}"
        yield Row(what, coupled.time if alike else math.inf, reference.time, source, SAME_TIME)
    n = round(min(coupled.time, reference.time) / MACRO_STEP * (1.0 if reference.how == "landed" else 1.0 - SAME_TIME))
    z, exact = coupled.z[:n], reference.z[:n]
    yield Row(f"{where}: Z by its range", float(np.max(np.abs(z - exact)) / np.ptp(exact)), 0.0, source, WANTED, False)


def run(figures: Path) -> Result:
    """Run all landings, as many at a time as there are processors."""
    cases = [(robot, line) for line in LINES for robot in robots()]
    with ProcessPoolExecutor(cpu_count(), mp_context=get_context("spawn")) as pool:
        found = list(pool.map(both, cases))
    table = [row for case, pair in zip(cases, found, strict=True) for row in rows(*case, *pair)]
    ends = {how: sum(reference.how == how for _, reference in found) for how in dict.fromkeys(r.how for _, r in found)}
    counted = ", ".join(f"{how}: {count}" for how, count in ends.items())
    stopped = [(case, one.why) for case, pair in zip(cases, found, strict=True) for one in pair if one.why]
    said = [f"- {robot}, {line}: {why}" for (robot, line), why in stopped]
    return Result(table, remark="\n".join([f"{STOP:g} s each. {counted}.", "", *said]).strip())
