"""A robot by itself: where it starts, how it falls, and whether it shows the end of its steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.coupling.fmu.description import Value
from orchestrator.landing.trial.answers import attitude, places
from orchestrator.landing.trial.bench import Bench, Motion
from orchestrator.landing.trial.row import ACCURACY, ROUND_OFF, Row, deviation, judged, untestable, vector

EARTH = (9.76, 9.84)
"""m/s²; gravity on the Earth's surface, from the equator to the poles."""
OTHER_START: dict[str, Value] = {
    "initial.position.x": -0.4, "initial.position.y": 31.0, "initial.position.z": 5.5,
    "initial.velocity.x": 0.3, "initial.velocity.y": -0.2, "initial.velocity.z": -0.5,
    "initial.roll": 0.1, "initial.pitch": 0.25, "initial.yaw": -0.3,
}  # fmt: skip
SHOWN_BY = {"position": "body.position", "velocity": "body.velocity"}
NEAR = 0.1
"""m; a turn counts that moves a point at this distance as fast as a fall may err."""
STEPS = 20
"""Macro steps of a free fall."""


# -- the start ------------------------------------------------------------------------------------------------


def starts(bench: Bench, n: int) -> Iterator[Row]:
    """Yield whether the robot starts as it was told, with its wheels where they are mounted."""
    wanted = {name: value for name, value in OTHER_START.items() if name in bench.fmu.ports}
    fmu = bench.fresh(wanted)
    try:
        group = fmu.group(bench.outputs)
        group.get_finite()
        shown = dict(zip(bench.outputs, group.values.tolist(), strict=True))
    finally:
        fmu.close()
    found = {name: shown[_output_of(name)] for name in wanted if _output_of(name) in shown}
    worst = max(found, key=lambda name: abs(found[name] - float(wanted[name])), default="")
    size = abs(found[worst] - float(wanted[worst])) if worst else 0.0
    said = (
        f"{worst} is {found[worst]:.6g}, set {float(wanted[worst]):.6g}"
        if size > ACCURACY**2
        else f"{len(found)} values as set"
    )
    yield judged("start", "outputs are the start values set", "the contract", said, size <= 1e-9, "it starts elsewhere")
    yield _unit_axles(shown, n)
    yield from _mounts(bench, shown, n)


def _output_of(name: str) -> str:
    """Return the output that shows a start value: ``body.position.x`` of ``initial.position.x``."""
    what = name.removeprefix("initial.")
    first, dot, axis = what.partition(".")
    return f"{SHOWN_BY[first]}{dot}{axis}" if first in SHOWN_BY else what


def _vector(shown: dict[str, float], name: str) -> np.ndarray:
    return np.array([shown[f"{name}.{axis}"] for axis in "xyz"])


def _unit_axles(shown: dict[str, float], n: int) -> Row:
    lengths = np.array([np.linalg.norm(_vector(shown, f"wheel[{k + 1}].axle")) for k in range(n)])
    worst = float(np.max(np.abs(lengths - 1.0)))
    return judged("axles", "unit vectors", "the contract", f"lengths {vector(lengths)}", worst <= 1e-9, "they are not")


def _mounts(bench: Bench, shown: dict[str, float], n: int) -> Iterator[Row]:
    """Yield whether the wheels sit where `mount` says, turned by roll, pitch and yaw."""
    if not all(bench.has(f"wheel[{k + 1}].mount") for k in range(n)):
        yield untestable("mounts", "it has no parameters wheel[k].mount.*")
        return
    R = attitude([shown[name] for name in ("roll", "pitch", "yaw")])
    mounts = np.array([[bench.shown(f"wheel[{k + 1}].mount.{a}") or 0.0 for a in "xyz"] for k in range(n)])
    arms = np.array([_vector(shown, f"{place}.position") for place in places(n)[:-1]]) - _vector(shown, "body.position")
    held = deviation(arms, mounts @ R.T, scale=float(np.max(np.abs(mounts))), at=100.0)
    expected = "wheels are at body + Rz(yaw) Ry(pitch) Rx(roll) mount"
    why = "another convention of roll, pitch and yaw, or another mount"
    yield judged("mounts", expected, "parameters wheel[k].mount", held.words(), held.good, why)


# -- free fall ------------------------------------------------------------------------------------------------


def gravity_shown(bench: Bench) -> np.ndarray:
    """Return the acceleration (3,) of the body with nothing applied, over the first macro step."""
    motion = bench.run({}, bench.H, 1)
    return (motion["body.velocity"][-1] - motion["body.velocity"][0]) / motion.time[-1]


def holds_itself(bench: Bench) -> bool:
    """Whether a robot stays in the air with nothing applied."""
    return bool(np.linalg.norm(gravity_shown(bench)) < ACCURACY * EARTH[0])


def falling(bench: Bench, n: int) -> Iterator[Row]:
    """Yield whether the robot falls as a body without loads does, or holds itself in the air."""
    duration = STEPS * bench.H
    motion = bench.run({}, duration, STEPS)
    fell = (motion["body.velocity"][-1] - motion["body.velocity"][0]) / duration
    g, source = _gravity(bench, fell)
    estimate = _estimate(bench, motion, duration)
    path = motion["body.position"] - motion["body.position"][0]
    far = duration**2 / 2
    velocity = deviation(fell, np.array([0.0, 0.0, -g]), estimate / duration, scale=g or EARTH[0])
    place = deviation(path[-1], np.array([0.0, 0.0, -g * far]), estimate, scale=(g or EARTH[0]) * far, at=20.0)
    said = f"acceleration {vector(fell)} m/s2; path {vector(path[-1])} m in {duration:g} s"
    expected = f"(0, 0, {-g:.5g}) m/s2" if g else "it stays where it is"
    yield judged("free fall", expected, source, said, velocity.good and place.good, _why_fall(fell, g, velocity.good))
    turned = max(float(np.max(np.abs(motion[f"{p}.angular_velocity"]))) for p in places(n))
    limit = ACCURACY * (g or EARTH[0]) * duration / NEAR
    expected, found = "a body without loads does not turn", f"up to {turned:.1e} rad/s"
    yield judged(
        "no turning", expected, "closed form", found, turned <= limit, "something turns it with no load applied"
    )


def _gravity(bench: Bench, fell: np.ndarray) -> tuple[float, str]:
    """Return the gravity (m/s²) that a fall is held against, and its source; 0 where the robot holds itself."""
    if abs(float(fell[2])) < ACCURACY * EARTH[0]:
        return 0.0, "it holds itself in the air"
    shown = bench.shown("gravity")
    if shown is not None:
        return shown, "closed form with its parameter gravity"
    return float(np.clip(-fell[2], *EARTH)), f"closed form; gravity on Earth, {EARTH[0]} to {EARTH[1]}"


def _why_fall(fell: np.ndarray, g: float, velocity: bool) -> str:
    if velocity:
        return "its position does not follow from its velocity: a coarse integration, or old positions"
    if g and abs(fell[2] - g) <= ACCURACY * g:
        return "it falls upwards: z points up in the contract"
    return "something else than gravity acts on it, or gravity along another axis"


def _estimate(bench: Bench, motion: Motion, duration: float) -> float:
    """Return by how much positions after `duration` differ with half the step."""
    if not bench.divides:
        return 0.0
    finer = bench.run({}, duration, 2 * STEPS)
    return float(np.max(np.abs(finer["body.position"][-1] - motion["body.position"][-1])))


# -- of which step the outputs are ----------------------------------------------------------------------------


def up_to_date(bench: Bench, n: int) -> Row:
    """Return whether the outputs after a step are those of its end: under steady loads each step adds as much velocity."""
    loads = {f"wheel[{k + 1}].force.{axis}": 10.0 for k in range(n) for axis in "xyz"}
    name, expected = "outputs of the step", "the first step changes velocities as much as the second"
    falls = not holds_itself_after(bench)
    motion = bench.run({} if falls else loads, 2 * bench.H, 2)
    first, second = (np.linalg.norm(change) for change in np.diff(motion["body.velocity"], axis=0))
    if second <= ROUND_OFF:
        return untestable(name, "nothing moves it")
    found = f"{first:.3g}, then {second:.3g} m/s"
    return judged(
        name,
        expected,
        "a steady acceleration",
        found,
        bool(first > 0.5 * second),
        "it shows the outputs of the step before",
    )


def holds_itself_after(bench: Bench) -> bool:
    """Whether a robot stays in the air, seen after its second step: the first may show old outputs."""
    motion = bench.run({}, 2 * bench.H, 2)
    return bool(
        np.linalg.norm(motion["body.velocity"][-1] - motion["body.velocity"][0]) < ACCURACY * EARTH[0] * bench.H
    )
