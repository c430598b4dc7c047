"""What any FMU must do: the same twice, the same from a saved state, and nearly the same in halved steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.coupling.exchange import is_companion, is_load, is_of_step, split
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.stepping.replay import REPLAY, check_replay
from orchestrator.landing.contract import CONTACT, INSIDE
from orchestrator.landing.trial.bench import Bench, Course
from orchestrator.landing.trial.means import pattern
from orchestrator.landing.trial.row import ACCURACY, Row, judged, untestable

STEPS = 8
"""Macro steps over which halved steps are held against whole ones."""
FLOOR = 1e-11
"""Share below which differences are round-off, and tell no order."""
NOT_BACK = "its state does not come back completely; masters that go back cannot take it"
OF_STEP = {name for point in CONTACT if point.use == INSIDE for name in point.names(1)}
"""Outputs of a contact that speak of a step."""
CONVERGES = 0.75
"""Of the error, what may be left with half the step: a half at order 1."""


def general_rows(bench: Bench, course: Course) -> Iterator[Row]:
    """Yield what any FMU must do, under a `course` of inputs."""
    yield _halved(bench, course)
    yield _once_more(bench, course)
    yield _replay(bench, course)


# -- steps ----------------------------------------------------------------------------------------------------


def step_error(bench: Bench, course: Course, n: int = STEPS) -> tuple[float, float, str]:
    """Return by how much outputs differ in steps of H and H/2, of H/2 and H/4, as shares of their range, and whose.

    The range is the largest among outputs of one kind (``wheel[k].velocity``). Outputs that speak of a step (means, rotations,
    loads with slopes) have other values in other steps, and are left out.
    """
    whole, half, quarter = (bench.follow(course, n * bench.H, n * m) for m in (1, 2, 4))
    names = [name for name in bench.outputs if not _of_step(bench, name)]
    ranges = np.array([np.ptp(np.concatenate([whole[name], quarter[name]])) for name in names])
    if not np.any(ranges):
        return 0.0, 0.0, ""
    scale = _ranges(names, ranges)
    first, second = (
        np.array([abs(a[x][-1] - b[x][-1]) for x in names]) / scale for a, b in ((whole, half), (half, quarter))
    )
    worst = int(np.argmax(first))
    return float(first[worst]), float(second[worst]), names[worst]


def _ranges(names: list[str], ranges: np.ndarray) -> np.ndarray:
    """Return for each output the largest range of its kind, 1 where nothing of it moves."""
    kinds = [pattern(split(name)[0] + split(name)[1]) for name in names]
    largest = {kind: max(r for k, r in zip(kinds, ranges, strict=True) if k == kind) for kind in kinds}
    return np.array([largest[kind] or 1.0 for kind in kinds])


def _of_step(bench: Bench, name: str) -> bool:
    known = bench.fmu.vocabulary
    return name in OF_STEP or is_of_step(name) or (is_companion(name) and name in known) or is_load(name, known)


def _halved(bench: Bench, course: Course) -> Row:
    """Return whether halved steps tell the same, and with which order they do better."""
    name = f"H = {bench.H:g} s against H/2"
    if not bench.divides:
        return untestable(name, "it makes no steps finer than its own")
    first, second, worst = step_error(bench, course)
    if not worst:
        return untestable(name, "it shows nothing that moves")
    order = f", order {np.log2(first / second):.1f}" if first > second > FLOOR else ""
    found = f"{worst} differs by {first:.1e} of its range{order}"
    good = first <= ACCURACY or second < CONVERGES * first
    expected = f"outputs after {STEPS} H differ by {ACCURACY:g} of their range at most, or less with H/2 and H/4"
    return judged(name, expected, "two of H/2, four of H/4", found, good, "smaller steps do not make it more exact")


# -- the same again -------------------------------------------------------------------------------------------


def _once_more(bench: Bench, course: Course) -> Row:
    """Return whether another instance tells the same."""
    first = bench.follow(course, 2 * bench.H, 2).values
    fmu = bench.fresh()
    try:
        second = bench.stepped(fmu, course, 2 * bench.H, 2).values
    finally:
        fmu.close()
    difference = np.abs(first - second) - REPLAY * np.maximum(np.abs(first), np.abs(second))
    worst = int(np.argmax(np.max(difference, axis=0))) if difference.size else 0
    good = not np.any(difference > 0.0)
    found = (
        "the same numbers"
        if good
        else f"{bench.outputs[worst]} differs by {np.max(np.abs(first - second)[:, worst]):.2g}"
    )
    why = "it uses chance, the clock, or what instances share"
    return judged("a fresh instance", "the same outputs from the same inputs", "determinism", found, good, why)


def _replay(bench: Bench, course: Course) -> Row:
    """Return whether a state that was saved and restored goes on as before: masters that iterate rely on it."""
    name, expected = "state replay", "steps from a restored state give the same outputs, bit for bit but for 1e-12"
    if not bench.fmu.capabilities.rollback:
        return untestable(name, "it cannot save its state (canGetAndSetFMUstate is false)", expected)
    try:
        found, good = _replayed(bench, course)
    except FmuError as error:
        found, good = str(error.message), False
    return judged(name, expected, "the masters' own test", found, good, NOT_BACK)


def _replayed(bench: Bench, course: Course) -> tuple[str, bool]:
    """Step into the middle, save, step on, restore, step on again; the masters' test beside it."""
    fmu = bench.fresh()
    try:
        bench.stepped(fmu, course, 2 * bench.H, 2)
        inputs = fmu.group(bench.driven)
        check_replay([_Component(fmu, inputs)], 2 * bench.H, bench.H)  # type: ignore[list-item]
        state, outcomes = fmu.save(), []
        for _ in range(2):
            outcomes.append(bench.stepped(fmu, course, 3 * bench.H, 3, start=2 * bench.H).values)
            fmu.restore(state)
        fmu.release(state)
    finally:
        fmu.close()
    difference = np.abs(outcomes[0] - outcomes[1])
    good = bool(np.all(difference <= REPLAY * (np.abs(outcomes[0]) + np.abs(outcomes[1]))))
    worst = int(np.argmax(np.max(difference, axis=0))) if difference.size else 0
    return ("the same numbers" if good else f"{bench.outputs[worst]} differs by {np.max(difference):.2g}"), good


class _Component:
    """What the masters' test needs of a component."""

    def __init__(self, fmu: Fmu, inputs: Group):
        self.fmu, self.inputs = fmu, inputs
