"""The trial of a contact: open it does nothing; closed it pushes apart, both sides alike, and friction opposes sliding.

A straight cable lies along y, a wheel with its axle along x is above it, and is moved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.coupling.errors import RunError
from orchestrator.coupling.fmu.description import Value
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.contract import CONTACT
from orchestrator.landing.trial.bench import Bench, Course, Isolation
from orchestrator.landing.trial.row import ACCURACY, Row, deviation, judged, vector

HIGH = 0.5
"""m; a wheel so far above the cable touches nothing."""
GAP, DEPTH, SPEED = 5e-4, 1.5e-3, 0.05
"""m, m, m/s; from how far above, how deep and how fast the wheel is pressed on."""
SLIDING = 0.1
"""m/s along the cable."""
TOO_LITTLE = 1e-9
"""Share of the largest force that is none."""
Way = Callable[[float], tuple[float, float]]
"""From time (s) to height above the start, and place along the cable, m."""


def inputs_at(height: float, along: float, s: float, speed: tuple[float, float] = (0.0, 0.0)) -> dict[str, float]:
    """Return the motion of cable and wheel: the wheel at `height` and `along`, the cable's point at `s`, m."""
    vectors = {
        "cable.position": (0.0, s, 0.0), "cable.tangent": (0.0, 1.0, 0.0), "wheel.position": (0.0, along, height),
        "wheel.axle": (1.0, 0.0, 0.0), "wheel.velocity": (0.0, speed[1], speed[0]),
    }  # fmt: skip
    vectors |= {
        f"{name}_mean": vectors[name] for name in ("cable.position", "cable.tangent", "wheel.position", "wheel.axle")
    }
    return {
        f"{name}.{axis}": float(v) for name, values in vectors.items() for axis, v in zip("xyz", values, strict=True)
    }


def bench_of(path: Path, macro_step: float | None = None, isolate: Isolation = False) -> Bench:
    """Return a bench on which the wheel is a little above the cable."""
    height = touching(path, isolate)
    driven = [name for point in CONTACT if point.causality == "input" for name in point.names(1)]
    with Fmu(path, isolate=isolate) as fmu:
        known = set(fmu.ports)
    start: dict[str, Value] = {k: v for k, v in inputs_at(height + GAP, 0.0, 0.0).items() if k in known}
    return Bench(path, start, macro_step, driven, isolate)


def touching(path: Path, isolate: Isolation = False) -> float:
    """Return the height of the wheel (m) at which it begins to touch, by the gap that the contact shows."""
    h, gap = HIGH, _gap(path, HIGH, isolate)
    if gap <= 0.0:
        raise RunError(
            f"{path}: penetration is {-gap:g} m with wheel and cable {HIGH:g} m apart; negative ones are gaps"
        )
    lower = h - gap  # never too low: a wall is not steeper than the way to it
    slope = (gap - _gap(path, lower, isolate)) / (h - lower)
    return h - gap / slope if slope > 0.0 else lower


def _gap(path: Path, height: float, isolate: Isolation) -> float:
    with Fmu(path, isolate=isolate) as fmu:
        fmu.set_parameters({k: v for k, v in inputs_at(height, 0.0, 0.0).items() if k in fmu.ports})
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()
        return -float(fmu.read("penetration"))


# -- the wheel is moved ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Press:
    """What a contact shows while its wheel is moved; arrays have a row a step.

    Attributes
    ----------
    arm : (n, 3), m, from the cable's point to the wheel's centre
    velocity : (n, 3), m/s, of the wheel
    shown : outputs by name, (n,) or (n, 3)
    """

    arm: np.ndarray
    velocity: np.ndarray
    shown: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.shown[name]


def _played(bench: Bench, way: Way, duration: float, steps: int) -> Press:
    """Move the wheel along `way`; the cable's point follows ``cable.s``, as a cable would have it."""
    fmu, h = bench.fresh(), duration / steps
    base, s0 = float(bench.parameters["wheel.position.z"]), None
    group, rows, arms, speeds = fmu.group(bench.driven), [], [], []
    try:
        for i in range(steps):
            s0 = float(fmu.read("cable.s")) if s0 is None else s0
            s = float(fmu.read("cable.s")) - s0
            (z0, y0), (z1, y1) = way(i * h), way((i + 1) * h)
            now = inputs_at(base + z1, y1, s, ((z1 - z0) / h, (y1 - y0) / h))
            now |= {"wheel.position_mean.z": base + (z0 + z1) / 2, "wheel.position_mean.y": (y0 + y1) / 2}
            group.values[:] = [now.get(name, 0.0) for name in bench.driven]
            group.set()
            fmu.step(i * h, h)
            shown = fmu.group(bench.outputs)
            shown.get_finite()
            rows.append(shown.values.copy())
            arms.append([0.0, y1 - s, base + z1])
            speeds.append([0.0, (y1 - y0) / h, (z1 - z0) / h])
    finally:
        fmu.close()
    table = np.array(rows)
    scalars = {name: table[:, i] for i, name in enumerate(bench.outputs)}
    stems = {name[:-2] for name in bench.outputs if name.endswith(".x")}
    vectors = {stem: np.column_stack([scalars[f"{stem}.{axis}"] for axis in "xyz"]) for stem in stems}
    return Press(np.array(arms), np.array(speeds), scalars | vectors)


def _down(t: float) -> float:
    """Return the height after `t` s: down to `DEPTH`, and no further."""
    return -min(SPEED * t, GAP + DEPTH)


PRESSED = (GAP + DEPTH) / SPEED
"""s, after which the wheel is down."""


def contact_rows(bench: Bench) -> Iterator[Row]:
    """Yield what a contact's answers say, row by row."""
    steps = max(8, round(PRESSED / bench.H))
    down = _played(bench, lambda t: (_down(t), 0.0), 2.0 * PRESSED, 2 * steps)
    yield _open(down)
    yield _pushes(down)
    yield _grows(down, steps)
    slides = [_played(bench, _sliding(sign), 2.0 * PRESSED, 2 * steps) for sign in (1.0, -1.0)]
    yield _balanced([down, *slides])
    yield from _friction(bench, slides)
    away = _played(
        bench, lambda t: (_down(t) if t < PRESSED else _down(2.0 * PRESSED - t), 0.0), 2.0 * PRESSED, 2 * steps
    )
    yield _passive(away)
    yield _degenerate(bench)


def pressing(bench: Bench) -> Course:
    """Return a wheel that is pressed on over eight macro steps."""
    base = float(bench.parameters["wheel.position.z"])
    speed = (GAP + DEPTH) / (8 * bench.H)

    def at(t: float, h: float) -> dict[str, float]:
        now = inputs_at(base - speed * (t + h), 0.0, 0.0, (-speed, 0.0))
        return now | {"wheel.position_mean.z": base - speed * (t + h / 2)}

    return at


def _sliding(sign: float) -> Way:
    return lambda t: (_down(t), sign * SLIDING * max(0.0, t - PRESSED))


def _size(forces: np.ndarray) -> np.ndarray:
    return np.linalg.norm(forces, axis=-1)


def _open(down: Press) -> Row:
    is_open = down["penetration"] < 0.0
    force = float(np.max(_size(down["wheel.force"])[is_open], initial=0.0))
    expected = "no force where penetration is negative"
    return judged(
        "open",
        expected,
        "the contract",
        f"up to {force:.3g} N in {is_open.sum()} steps",
        force == 0.0,
        "it acts from afar",
    )


def _pushes(down: Press) -> Row:
    force, arm = down["wheel.force"][-1], down.arm[-1]
    good = bool(force @ arm > 0.0)
    why = "there is none" if not np.any(force) else "it pulls"
    expected = "a force on the wheel away from the cable"
    return judged(
        "closed", expected, "no contact pulls", f"{vector(force)} N at {down['penetration'][-1]:.3g} m", good, why
    )


def _grows(down: Press, steps: int) -> Row:
    depth, force = down["penetration"][:steps], down["normal_force"][:steps]
    inside = depth > 0.0
    rises = bool(np.count_nonzero(inside) > 1 and np.all(np.diff(force[inside]) > 0.0))
    found = f"{force[inside][0]:.3g} to {force[inside][-1]:.3g} N" if np.any(inside) else "it never closes"
    return judged("stiffness", "the force grows with the penetration", "the contract", found, rises, "it does not grow")


def _balanced(presses: list[Press]) -> Row:
    """Return whether cable and wheel get the same wrench, opposite; where the wheel is still, so that a mean has one arm."""
    worst = []
    for press in presses[:1]:
        last = slice(-3, None)
        force, moment = press["wheel.force"][last], press["wheel.moment"][last]
        about = press["cable.moment"][last] + moment + np.cross(press.arm[last], force)
        scale = float(np.max(_size(force)))
        worst.append(deviation(press["cable.force"][last], -force, scale=scale))
        worst.append(deviation(about, 0.0 * about, scale=scale * float(np.max(_size(press.arm)))))
    for press in presses[1:]:
        worst.append(
            deviation(press["cable.force"], -press["wheel.force"], scale=float(np.max(_size(press["wheel.force"]))))
        )
    held = max(worst, key=lambda d: d.share)
    expected = "forces on cable and wheel are opposite, moments about the cable's point too"
    return judged("action is reaction", expected, "Newton's third law", held.words(), held.good, "momentum is made")


def _friction(bench: Bench, slides: list[Press]) -> Iterator[Row]:
    along = [float(press["wheel.force"][-1, 1]) for press in slides]
    normal = float(slides[0]["normal_force"][-1])
    found = f"{along[0]:.3g} and {along[1]:.3g} N at {SLIDING:g} m/s there and back"
    coefficient = bench.shown("friction_coefficient")
    if coefficient == 0.0 or not any(along):
        yield judged(
            "friction", "opposes sliding", "the second law", found, coefficient in (0.0, None), "there is none"
        )
        return
    good = along[0] < 0.0 < along[1]
    yield judged("friction", "opposes sliding", "dissipation", found, good, "it drives")
    if coefficient is not None:
        ratio = max(map(abs, along)) / normal if normal else 0.0
        limit = f"friction is no more than {coefficient:g} of the normal force"
        yield judged(
            "friction's limit",
            limit,
            "parameter friction_coefficient",
            f"{ratio:.4g}",
            ratio <= coefficient * (1 + ACCURACY),
            "more",
        )


def _passive(away: Press) -> Row:
    """Return whether pressing on and lifting off gives no energy back that was not put in."""
    moved = np.diff(away.arm, axis=0, prepend=away.arm[:1] + 0.0)
    work = np.cumsum(np.sum(away["wheel.force"] * moved, axis=1))
    put_in = -float(np.min(work))
    found = f"{-work[-1]:.3g} J lost of {put_in:.3g} J put in"
    return judged("no energy from nowhere", "pressing on and lifting off loses energy", "passivity", found,
                  bool(work[-1] <= ACCURACY * put_in), "it gives back more than it got")  # fmt: skip


def _degenerate(bench: Bench) -> Row:
    """Return whether a start with zeros for tangent and axle does no harm: other engines begin so."""
    zeros = {f"{name}.{axis}": 0.0 for name in ("cable.tangent", "wheel.axle") for axis in "xyz"}
    name, expected = "zero tangent", "a start with tangent and axle 0 is open, and no failure"
    try:
        fmu = bench.fresh(zeros)
    except FmuError as error:
        return judged(
            name, expected, "start-up of other engines", error.message, False, "it fails before it is connected"
        )
    try:
        group = fmu.group([f"wheel.force.{axis}" for axis in "xyz"])
        group.get()
        force = float(np.max(np.abs(group.values)))
    finally:
        fmu.close()
    found = f"force {force:g} N"
    return judged(
        name, expected, "start-up of other engines", found, force <= TOO_LITTLE, "it acts before it is connected"
    )
