"""Known loads at every wheel along every axis, held against Newton and Euler."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.exchange import RATE
from orchestrator.landing.trial.answers import (
    NOTHING,
    SIZES,
    Answer,
    Asked,
    LoadName,
    Stance,
    input_of,
    load_names,
    places,
    velocities,
    wrench_of,
)
from orchestrator.landing.trial.bench import Motion, named
from orchestrator.landing.trial.body import Body, Wrench
from orchestrator.landing.trial.row import Deviation, Row, deviation, judged, untestable, vector

UNITS = {"force": "N", "moment": "N.m"}
LATE = "it acts a step late: the robot takes the inputs of the step before"
BRISK = 10.0
"""m/s²; what a load with a slope does to the robot at the ends of a step."""


@dataclass(frozen=True)
class Judge:
    """Holds answers against a body.

    Attributes
    ----------
    body : None where nothing is known of it
    source : where the body is known from
    usual : size of a robot's answers, scaled as `scaled` does
    """

    asked: Asked
    stands: Stance
    body: Body | None
    source: str

    @property
    def lever(self) -> float:
        """Length (m) by which turning is weighed against moving: the radius of gyration."""
        return self.body.gyration if self.body is not None else 1.0

    def scaled(self, rates: np.ndarray) -> np.ndarray:
        """Return accelerations (2 n + 2, 3) with those of turning times the lever."""
        n = self.asked.n_wheels
        return np.vstack([rates[: n + 1], self.lever * rates[n + 1 :]])

    def held(self, answer: Answer, expected: np.ndarray) -> Deviation:
        """Hold an answer against what is expected, (2 n + 2, 3)."""
        estimate = float(np.max(np.abs(self.scaled(answer.estimate))))
        return deviation(self.scaled(answer.rate), self.scaled(expected), estimate)


def single_loads(judge: Judge) -> Iterator[Row]:
    """Yield a row for each force and moment at each wheel along each axis."""
    for load in load_names(judge.asked.n_wheels):
        yield _single(judge, load, judge.asked.answers[load])


def _single(judge: Judge, load: LoadName, answer: Answer) -> Row:
    name, found = f"{input_of(load)} acts", _said(judge, load, answer.rate)
    if _is_nothing(judge, load, answer):
        why = LATE if np.any(answer.estimate > np.abs(answer.rate) + NOTHING) else "it has no effect: it is ignored"
        return judged(name, "the robot moves", "Newton–Euler", "nothing moves in the first step", False, why)
    if judge.body is None:
        good = float(_at_place(judge, load, answer.rate)[load[2]]) > 0.0
        return judged(
            name, "its place goes along with it", "power is positive", found, good, "acts the wrong way round"
        )
    expected = judge.body.response(wrench_of(load, judge.asked.n_wheels))
    held = judge.held(answer, expected)
    why = "" if held.good else f"{_diagnosis(judge, load, answer)}: {held.words()}"
    return judged(name, _said(judge, load, expected), judge.source, found, held.good, why)


def _at_place(judge: Judge, load: LoadName, rates: np.ndarray) -> np.ndarray:
    """Return the acceleration (3,) that a single load does work on."""
    k, what, _ = load
    return rates[k if what == "force" else judge.asked.n_wheels + 1 + k]


def _said(judge: Judge, load: LoadName, rates: np.ndarray) -> str:
    unit = UNITS[load[1]]
    return f"per {unit}: wheel {vector(rates[load[0]])} m/s2, body {vector(rates[-1])} rad/s2"


def _is_nothing(judge: Judge, load: LoadName, answer: Answer) -> bool:
    """Whether a load moves nothing, against what loads of its kind do; against one N and N m on 1 t if none does anything."""
    alike = [a.rate for name, a in judge.asked.answers.items() if name[1] == load[1]]
    usual = max(1e-6, max(float(np.max(np.abs(rate))) for rate in alike))
    return float(np.max(np.abs(answer.rate))) <= NOTHING * usual


def _diagnosis(judge: Judge, load: LoadName, answer: Answer) -> str:
    """Return what a wrong answer would be the right one to."""
    if judge.body is None:
        return "another size or direction"
    for words, expected in _mistakes(judge, judge.body, load):
        if judge.held(answer, expected).good:
            return words
    return "another size or direction than its mass, inertia and lever give"


def _mistakes(judge: Judge, body: Body, load: LoadName) -> Iterator[tuple[str, np.ndarray]]:
    """Yield usual mistakes, and what a robot that makes them answers (2 n + 2, 3)."""
    n = judge.asked.n_wheels
    right = body.response(wrench_of(load, n))
    yield "acts the wrong way round (sign)", -right
    k, what, axis = load
    if what == "force":
        unit = np.eye(3)[axis]
        at_G = np.vstack([np.tile(unit / body.mass, (n + 1, 1)), np.zeros((n + 1, 3))])
        yield "moves the body without turning it: its lever about the centre of mass is missing", at_G
        yield "acts at b instead of at the wheel", body.response(_none(n, thrust=unit))
    wrench = _none(n)
    getattr(wrench, what)[k] = judge.stands.R[:, axis]
    yield "is taken in the body's frame, not in the inertial one", body.response(wrench)
    for other in range(3):
        for sign, word in ((1.0, ""), (-1.0, "minus ")):
            if other != axis:
                yield f"acts along {word}{'xyz'[other]}", sign * body.response(wrench_of((k, what, other), n))
    for other in range(n):
        if other != k:
            yield f"acts at wheel {other + 1}", body.response(wrench_of((other, what, axis), n))


def _none(n_wheels: int, thrust: np.ndarray | None = None, torque: np.ndarray | None = None) -> Wrench:
    zero = np.zeros(3)
    return Wrench(
        np.zeros((n_wheels, 3)),
        np.zeros((n_wheels, 3)),
        zero if thrust is None else thrust,
        zero if torque is None else torque,
    )


# -- several loads, and loads on the body ---------------------------------------------------------------------


def together(judge: Judge) -> Row:
    """Return whether all loads at once do what they do one by one."""
    asked = judge.asked
    loads = {
        input_of(load): SIZES[load[1]] * (1.0 if i % 2 else -0.7) for i, load in enumerate(load_names(asked.n_wheels))
    }
    size = next(iter(loads.values()))
    parts = zip(asked.answers.values(), loads.values(), strict=True)
    total = sum(answer.rate * load / size for answer, load in parts)
    held = judge.held(asked.ask(loads), np.asarray(total))
    expected = "all loads at once move it as the sum of their parts"
    return judged(
        "superposition", expected, "linear in the loads, at rest", held.words(), held.good, "loads disturb each other"
    )


def reciprocity(judge: Judge) -> Row:
    """Return whether the matrix of all answers is symmetric and has no negative eigenvalue."""
    n = judge.asked.n_wheels
    weights = np.tile(np.repeat([1.0, judge.lever], 3), n)
    Y = judge.asked.mobility * np.outer(weights, weights)
    estimate = max(float(np.max(np.abs(judge.scaled(a.estimate)))) for a in judge.asked.answers.values())
    held = deviation(Y, Y.T, estimate * max(1.0, judge.lever))
    lowest = float(np.linalg.eigvalsh((Y + Y.T) / 2)[0])
    good = held.good and lowest >= -held.allowed * len(Y)
    worst = np.unravel_index(int(np.argmax(np.abs(Y - Y.T))), Y.shape)
    names = [input_of(load) for load in load_names(n)]
    why = (
        f"{names[worst[0]]} and {names[worst[1]]} do not answer each other"
        if not held.good
        else "a load gives energy back"
    )
    found = f"asymmetry {held.share:.1e}, lowest eigenvalue {lowest / max(held.scale, 1e-300):.1e} of the largest entry"
    expected = "dv/dF of all wheels is symmetric, without negative eigenvalues"
    return judged("reciprocity", expected, "Maxwell–Betti; work on a body at rest is never negative", found, good, why)


def control(judge: Judge) -> Iterator[Row]:
    """Yield rows for thrust and control torque, where the robot has them."""
    bench, R = judge.asked.bench, judge.stands.R
    units = {"thrust": ("thrust", 2)} | {f"torque.{axis}": ("torque", i) for i, axis in enumerate("xyz")}
    for name, (what, axis) in units.items():
        if not bench.has(name):
            continue
        if judge.body is None:
            yield untestable(f"{name} acts", "the body behind its answers is not known")
            continue
        direction = R[:, axis]
        expected = judge.body.response(_none(judge.asked.n_wheels, **{what: direction}))
        answer = judge.asked.ask({name: SIZES["force" if what == "thrust" else "moment"]})
        held = judge.held(answer, expected)
        where = "along z_B at b" if what == "thrust" else f"about {'xyz'[axis]}_B"
        found = f"b {vector(answer.rate[judge.asked.n_wheels])} m/s2, body {vector(answer.rate[-1])} rad/s2"
        yield judged(f"{name} acts", where, judge.source, found, held.good, f"does not act {where}: {held.words()}")


# -- slopes ---------------------------------------------------------------------------------------------------


def slopes(judge: Judge) -> Iterator[Row]:
    """Yield a row for the slope of the force and of the moment at each wheel."""
    for k in range(judge.asked.n_wheels):
        for what in SIZES:
            name = f"wheel[{k + 1}].{what}{RATE}"
            if judge.asked.bench.has(name):
                yield _slope(judge, k, what, name)
            else:
                yield untestable(
                    f"{name} acts", f"the robot has no such input; exchange point, of order 2 ({what} held)"
                )


def _slope(judge: Judge, k: int, what: str, name: str) -> Row:
    """Hold the shift by a slope about the middle of a step against -H³/12 times the answer to a load of that size."""
    expected = "no change of velocity at the step's end, and a shift by -1/12 H³ dv/dF"
    worst: list[Deviation] = []
    early: list[float] = []
    loads: list[LoadName] = [(k, what, axis) for axis in range(3)]
    acting = [load for load in loads if not _is_nothing(judge, load, judge.asked.answers[load])]
    if not acting:
        return untestable(f"{name} acts", f"the {what} itself has no effect")
    for load in acting:
        speed, shift, ratio = _slope_along(judge, load)
        worst += [speed, shift]
        early.append(ratio)
    bad = max(worst, key=lambda d: d.size / d.allowed if d.allowed else 0.0)
    why = "the slope counts from the start of the step, not from its middle" if min(early) > 0.9 else (
        "it is ignored" if all(d.share > 0.999 for d in worst[1::2]) else "another size or sign"
    )  # fmt: skip
    return judged(
        f"{name} acts", expected, "load + rate (tau - t - H/2), docs/concepts/exchange.md", bad.words(), bad.good, why
    )


def _slope_along(judge: Judge, load: LoadName) -> tuple[Deviation, Deviation, float]:
    """Return the deviations of velocity and shift, and the velocity by that of a slope that counts from the start."""
    asked, H = judge.asked, judge.asked.bench.H
    answer = asked.answers[load]
    largest = float(np.max(np.abs(judge.scaled(answer.rate)))) or 1.0
    rate = BRISK / largest * 2.0 / H
    speeds, shifts, at = zip(
        *(_moved(judge, load, rate, n) for n in ((1, 2) if asked.bench.divides else (1, 1))), strict=True
    )
    speed, shift = judge.scaled(answer.rate) * rate * H**2 / 8, _shift(judge, answer.rate) * (-rate * H**3 / 12)
    estimates = [float(np.max(np.abs(x[1] - x[0]))) for x in (speeds, shifts)]
    noise = float(np.max(np.abs(judge.scaled(answer.estimate))))
    of_speed = deviation(
        speeds[0], 0.0 * speed, estimates[0] + noise * rate * H**2 / 8, scale=float(np.max(np.abs(speed)))
    )
    of_shift = deviation(shifts[0], shift, estimates[1] + noise * rate * H**3 / 12, at=at[0])
    early = float(np.sum(speeds[0] * speed) / (4.0 * np.sum(speed**2)))
    return of_speed, of_shift, early


def _moved(judge: Judge, load: LoadName, rate: float, n: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return what a slope changes within a macro step: velocities, and the points' places with the axles."""
    bench, wheels = judge.asked.bench, judge.asked.n_wheels
    motions = [bench.run({}, bench.H, n, {input_of(load): slope}) for slope in (rate, 0.0)]
    speeds = [judge.scaled(velocities(m, wheels)[-1]) for m in motions]
    shown = [_shown(judge, m) for m in motions]
    return speeds[0] - speeds[1], shown[0] - shown[1], float(np.max(np.abs(shown[0])))


def _shown(judge: Judge, motion: Motion) -> np.ndarray:
    n = judge.asked.n_wheels
    points = named(motion, [f"{place}.position" for place in places(n)])[-1].reshape(-1, 3)
    axles = named(motion, [f"wheel[{k + 1}].axle" for k in range(n)])[-1].reshape(-1, 3)
    return np.vstack([points, judge.lever * axles])


def _shift(judge: Judge, rates: np.ndarray) -> np.ndarray:
    """Return how places and axles move with accelerations `rates`."""
    n = judge.asked.n_wheels
    return np.vstack([rates[: n + 1], judge.lever * np.cross(rates[-1], judge.stands.axles)])
