"""A trial put together: which experiments an FMU is given, and what came of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.coupling.errors import InputError, RunError
from orchestrator.coupling.fmu.failure import FmuEnd, FmuError
from orchestrator.landing.trial import cable, contact, robot
from orchestrator.landing.trial.answers import wheels
from orchestrator.landing.trial.bench import Bench, Course, Isolation, held
from orchestrator.landing.trial.general import STEPS, general_rows
from orchestrator.landing.trial.masters import macro_step_row, masters_row
from orchestrator.landing.trial.means import means, motions, pair
from orchestrator.landing.trial.row import Row


@dataclass
class Trial:
    """What came of a trial.

    Attributes
    ----------
    kind : ``robot``, ``cable``, ``contact``, or ``any`` for what has no contract
    macro_step : s
    rows : the findings
    failure : why it ended early, if it did
    """

    kind: str
    macro_step: float = 0.0
    rows: list[Row] = field(default_factory=list)
    failure: str = ""

    @property
    def passed(self) -> bool:
        """Whether no finding fails; what cannot be tested does not count."""
        return not self.failure and all(row.verdict != "FAIL" for row in self.rows)

    def content(self) -> dict[str, Any]:
        """Return the trial as it is written to a file."""
        rows = [row.content() for row in self.rows]
        return {
            "contract": self.kind,
            "macro_step": self.macro_step,
            "passed": self.passed,
            "failure": self.failure,
            "rows": rows,
        }


def put_on_trial(path: Path, kind: str, macro_step: float | None = None, isolate: Isolation = False) -> Trial:
    """Start the FMU at `path`, load and step it, and return what its answers say.

    Parameters
    ----------
    kind : the contract that it meets as far as it can be read; ``any`` for none
    macro_step : s; its own, or 5 ms, if none is given
    isolate : whether each instance lives in a process of its own, and within which limits

    Raises
    ------
    InputError : it cannot be loaded
    RunError : it cannot be started
    """
    trial = Trial(kind)
    try:
        with _bench(path, kind, macro_step, isolate) as bench:
            trial.macro_step = bench.H
            _fill(trial, bench)
    except ValueError as error:
        raise InputError(str(error)) from None
    except FmuError as error:
        if not trial.macro_step:
            raise RunError(str(error), error.time) from None
        trial.failure = str(error)
    except FmuEnd as error:
        trial.failure = str(error)
    return trial


def _bench(path: Path, kind: str, macro_step: float | None, isolate: Isolation) -> Bench:
    if kind == "robot":
        return robot.bench_of(path, macro_step, isolate)
    if kind == "cable":
        return cable.bench_of(path, macro_step, isolate)
    if kind == "contact":
        return contact.bench_of(path, macro_step, isolate)
    return Bench(path, None, macro_step, (), isolate)


def _fill(trial: Trial, bench: Bench) -> None:
    """Add the findings one by one, so that those before a failure are kept."""
    for row in ROWS.get(trial.kind, any_rows)(bench):
        trial.rows.append(row)
    course = _course(trial.kind, bench)
    for row in general_rows(bench, course):
        trial.rows.append(row)
    replay = next(row for row in trial.rows if row.name == "state replay")
    trial.rows.append(masters_row(bench, trial.rows))
    if trial.kind != "contact":  # it has no motion of its own
        trial.rows.append(macro_step_row(bench, course, replay.verdict == "pass"))


def any_rows(bench: Bench) -> Iterator[Row]:
    """Yield what is to be said of an FMU without a contract: its means."""
    yield from means(pair(bench, held({}, 2 * bench.H)), motions(bench))


ROWS: dict[str, Callable[[Bench], Iterator[Row]]] = {
    "robot": robot.robot_rows,
    "cable": cable.cable_rows,
    "contact": contact.contact_rows,
    "any": any_rows,
}


def _course(kind: str, bench: Bench) -> Course:
    """Return inputs under which an FMU moves."""
    if kind == "robot":
        return held(robot.inputs_of(robot.shaking(None, wheels(bench))), STEPS * bench.H)
    if kind == "cable":
        return cable.cable_course(bench, STEPS)
    if kind == "contact":
        return contact.pressing(bench)
    return held({}, STEPS * bench.H)
