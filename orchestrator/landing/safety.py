"""Whether a landing was safe: its signals held against the limits, with the least margin of each, when, and at which wheel."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from orchestrator.coupling.errors import digits
from orchestrator.coupling.run.results import Table
from orchestrator.landing import workspace
from orchestrator.landing.flight import SLIPPING, left_the_groove, open_wheels, time_off
from orchestrator.landing.workspace import Formula

Standing = Literal["kept", "unclear", "exceeded"]
Series = dict[int | None, np.ndarray]
"""Wheel (None: the whole robot or line) → what is judged, (n,)."""
UNITS = {
    "roll": "rad", "yaw": "rad", "pitch": "rad", "z": "m", "slip": "m", "airborne": "s", "tension": "1", "wheel_force": "N",
}  # fmt: skip
"""Limit → its unit, in the order in which people read them."""
ERRORS = {
    "roll": "robot.roll", "yaw": "robot.yaw", "pitch": "robot.pitch", "z": "robot.body.position.z",
    "wheel_force": "contact{}.normal_force_max",
}  # fmt: skip
"""Limit → the signal whose estimated error is that of what is judged."""
TENSIONS = ("cable.tension_left", "cable.tension_mid", "cable.tension_right")


@dataclass(frozen=True)
class Limit:
    """The largest value that is safe.

    Attributes
    ----------
    value : in `unit`
    source : where it comes from
    formula : that it follows from; None where it is given
    reference : what the signal is counted by: the height of touching (z, m), the rated strength (tension, N)
    """

    name: str
    value: float
    unit: str
    source: str
    formula: Formula | None = None
    reference: float | None = None


@dataclass(frozen=True)
class Limits:
    """What a landing is judged by: limits by name, and why others are not judged."""

    known: Mapping[str, Limit]
    missing: Mapping[str, str]


class NotRecorded(Exception):
    """A signal is not there; the message is its name."""


@dataclass(frozen=True)
class Judged:
    """A limit, and how near a landing came to it.

    Attributes
    ----------
    limit, worst, margin : in `unit`; `margin` is the limit less the magnitude of `worst`, negative where it is exceeded
    time : of the worst, s
    wheel : at which it was; None where it belongs to no wheel
    share : the magnitude of `worst` by the limit
    estimated_error : of `worst`; None where it is not known
    verdict : ``unclear`` where the margin is smaller than the estimated error
    source, formula : where the limit comes from; with its numbers, where it was derived
    reference : what the signal is counted by, see `Limit`
    """

    limit: float
    worst: float
    margin: float
    time: float
    unit: str
    wheel: int | None
    share: float
    estimated_error: float | None
    verdict: Standing
    source: str
    formula: str = ""
    reference: float | None = None

    @classmethod
    def from_content(cls, content: Mapping[str, Any]) -> Judged:
        """Return what was written; JSON has no infinity, and says null."""
        beyond = {"worst": np.inf, "margin": -np.inf, "share": np.inf}
        return cls(**{**content, **{key: value for key, value in beyond.items() if content[key] is None}})


@dataclass(frozen=True)
class Safety:
    """What can be said of the safety of a landing.

    Attributes
    ----------
    until : s, up to where it was judged
    limits : by name
    not_judged : limit → why not
    faults : why it is not safe whatever the limits say: the robot fell off, the run did not come to its end
    touched, airborne : whether a wheel has touched the line; whether none does at the end
    apart : s between the points that were judged, where these are not all communication points; else 0
    """

    until: float
    limits: Mapping[str, Judged]
    not_judged: Mapping[str, str] = field(default_factory=dict)
    faults: Sequence[str] = ()
    touched: bool = True
    airborne: bool = False
    apart: float = 0.0

    @property
    def safe(self) -> bool | None:
        """Whether every limit that is judged is clearly kept and nothing else is at fault; None where nothing is judged."""
        if self.faults or self.named("exceeded") or self.named("unclear"):
            return False
        return True if self.limits and self.touched else None

    def named(self, verdict: Standing) -> list[str]:
        """Return the limits of a verdict."""
        return [name for name, judged in self.limits.items() if judged.verdict == verdict]

    @property
    def words(self) -> str:
        """The verdict in a line: what it covers, and up to when."""
        until = f"until {digits(self.until)} s" + (f", at points {digits(self.apart)} s apart" if self.apart else "")
        if self.safe:
            end = "; in the air at the end" if self.airborne else ""
            return f"SAFE {until}: {', '.join(self.limits)} kept{end}"
        if self.safe is None:
            return f"NOT JUDGED {until}: " + ("no limit is known" if self.touched else "no wheel has touched the line")
        exceeded, unclear = self.named("exceeded"), self.named("unclear")
        why = [f"{', '.join(exceeded)} exceeded"] if exceeded else []
        why += [f"margin of {', '.join(unclear)} smaller than the estimated error"] if unclear else []
        start = "NOT SAFE" if exceeded or self.faults else NOT_CLEAR
        return f"{start} {until}: {'; '.join([*why, *self.faults])}"

    def content(self) -> dict[str, Any]:
        """Return what ``summary.json`` says of it."""
        return {
            "safe": self.safe,
            "safety": self.words,
            "limits": {name: asdict(judged) for name, judged in self.limits.items()},
            "not_judged": dict(self.not_judged),
        }


def judge(
    limits: Limits,
    table: Table,
    tension: np.ndarray | None = None,
    errors: Mapping[str, float] | None = None,
    fault: str | None = None,
) -> Safety:
    """Hold the signals of a landing against its limits.

    Parameters
    ----------
    table : signals at the communication points
    tension : (n, m) N along the cable, or (n,) the largest, if it is known beside that at supports and midspan
    errors : estimated error of signals, in their units
    fault : why the run ended before its time
    """
    judged, missing = dict[str, Judged](), dict(limits.missing)
    for name, limit in limits.known.items():
        try:
            found = series(name, table, limit.reference, tension)
        except NotRecorded as signal:
            missing[name] = f"{signal} is not among the signals"
        else:
            judged[name] = _judged(limit, found, table["time"], errors or {})
    wheels = list(open_wheels(table).values())
    fallen = [f"the cable left the groove of {name}" for name in left_the_groove(table)]
    faults = [*fallen, *([f"the run ended before its time ({fault})"] if fault is not None else [])]
    touched = not wheels or any(not is_open.all() for is_open in wheels)
    airborne = bool(wheels) and all(is_open[-1] for is_open in wheels)
    return Safety(float(table["time"][-1]), judged, missing, faults, touched, airborne)


def _judged(limit: Limit, found: Series, time: np.ndarray, errors: Mapping[str, float]) -> Judged:
    """Return the worst of all wheels; what is not finite is beyond any limit."""
    sizes = {wheel: np.where(np.isfinite(values), np.abs(values), np.inf) for wheel, values in found.items()}
    wheel = max(sizes, key=lambda w: float(sizes[w].max()))
    row = int(np.argmax(sizes[wheel]))
    size, error = float(sizes[wheel][row]), _error(limit.name, wheel, found, time, errors)
    margin = limit.value - size
    standing = "exceeded" if margin < 0.0 else "unclear" if error is not None and margin < error else "kept"
    return Judged(
        limit=limit.value,
        worst=float(found[wheel][row]),
        margin=margin,
        time=float(time[row]),
        unit=limit.unit,
        wheel=wheel,
        share=size / limit.value if limit.value > 0.0 else float("inf"),
        estimated_error=error,
        verdict=standing,
        source=limit.source,
        formula=f"{limit.formula.text} = {limit.formula.filled}" if limit.formula is not None else "",
        reference=limit.reference,
    )


def _error(name: str, wheel: int | None, found: Series, time: np.ndarray, errors: Mapping[str, float]) -> float | None:
    """Return the estimated error of what is judged; a time in the air is known to a macro step."""
    if name == "airborne":
        return float(np.max(np.diff(time), initial=0.0)) if np.any(found[wheel]) else 0.0
    error = errors.get(ERRORS.get(name, "").format(wheel))
    return None if error is None or np.isnan(error) else float(error)


# -- what is judged -------------------------------------------------------------------------------------------


def series(name: str, table: Table, reference: float | None = None, tension: np.ndarray | None = None) -> Series:
    """Return what is judged by the limit `name` over time, in its unit; `NotRecorded` names a signal that is missing."""
    if name == "tension":
        return _tension(table, reference or 1.0, tension)
    if name == "z":
        return {None: (reference or 0.0) - _signal(table, "robot.body.position.z")}
    if name == "pitch":
        return {None: _signal(table, "robot.pitch")}
    wheels = [int(m[1]) for signal in table if (m := re.fullmatch(r"contact(\d+)\.status", signal))]
    if not wheels:
        raise NotRecorded("contact1.status")
    return {k: OF_WHEELS[name](table, k) for k in wheels}


def _signal(table: Table, name: str) -> np.ndarray:
    if name not in table:
        raise NotRecorded(name)
    return np.asarray(table[name], float)


def _tangent(table: Table, k: int) -> np.ndarray:
    """Return the cable's tangent (n, 3) at wheel k."""
    return np.stack([_signal(table, f"cable.port[{k}].tangent.{axis}") for axis in "xyz"], axis=1)


def _roll(table: Table, k: int) -> np.ndarray:
    """Return the roll (n,) rad against the slope of the line at wheel k, of that moment."""
    return _signal(table, "robot.roll") - workspace.slope(_tangent(table, k))


def _yaw(table: Table, k: int) -> np.ndarray:
    """Return the yaw (n,) rad against the heading of the line at wheel k, of that moment."""
    return _signal(table, "robot.yaw") - workspace.heading(_tangent(table, k))


def _slip(table: Table, k: int) -> np.ndarray:
    """Return how far (n,) m wheel k has slid: a wheel that sticks, or rolls, does not."""
    sliding = _signal(table, f"contact{k}.status") == SLIPPING
    speed = np.where(sliding, np.abs(_signal(table, f"contact{k}.slip_velocity")), 0.0)
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(table["time"]) * (speed[1:] + speed[:-1]))])


def _airborne(table: Table, k: int) -> np.ndarray:
    """Return for how long (n,) s wheel k has been off the line again."""
    return time_off(table["time"], open_wheels(table)[f"contact{k}"])


def _wheel_force(table: Table, k: int) -> np.ndarray:
    """Return the load (n,) N on wheel k, from line to axle: the largest within each macro step, where that is known.

    What is known within the step is the sum of the wall forces; the load is the same share of it at all times, the sine of
    half the groove's angle, which radial and normal force tell wherever the wheel touches.
    """
    normal = _signal(table, f"contact{k}.normal_force")
    peak = table.get(f"contact{k}.normal_force_max", normal)
    radial = table.get(f"contact{k}.radial_force")
    if radial is None or not np.any(normal > 0.0):
        return np.maximum(normal, peak)
    touching = normal > 0.0
    shares = radial[touching] / normal[touching]
    return np.maximum(np.maximum(normal, peak) * float(np.max(shares)), radial)


OF_WHEELS: Mapping[str, Callable[[Table, int], np.ndarray]] = {
    "roll": _roll, "yaw": _yaw, "slip": _slip, "airborne": _airborne, "wheel_force": _wheel_force,
}  # fmt: skip


def _tension(table: Table, strength: float, along: np.ndarray | None) -> Series:
    """Return the largest tension (n,) anywhere, as a share of the rated `strength` (N)."""
    known = [table[name] for name in TENSIONS if name in table]
    if not known:
        raise NotRecorded(TENSIONS[0])
    largest = np.max(known, axis=0)
    if along is not None and len(along) == len(largest):
        largest = np.maximum(largest, along if along.ndim == 1 else np.max(along, axis=1))
    return {None: largest / strength}


def readable(value: float, unit: str) -> tuple[float, str]:
    """Return a value as people read it, noise as 0, and its unit: degrees in the place of radians."""
    value = 0.0 if abs(value) < NOISE else value
    return (float(np.degrees(value)), "deg") if unit == "rad" else (value, unit)


def rows(safety: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each limit of a ``summary.json``: limit, worst, margin, when, at which wheel, verdict."""
    for name, judged in safety["limits"].items():
        unit = readable(0.0, judged["unit"])[1]
        values = (float("nan") if judged[key] is None else judged[key] for key in ("worst", "limit", "margin"))
        shown = (f"{readable(value, judged['unit'])[0] + 0.0:.4g}" for value in values)
        wheel = "" if judged["wheel"] is None else str(judged["wheel"])
        yield name, unit, *shown, f"{judged['time']:.4g}", wheel, VERDICTS[judged["verdict"]]


def is_exceeded(safety: Mapping[str, Any]) -> bool:
    """Whether the landing of a ``summary.json`` is known to be unsafe; else what is not safe has errors too large."""
    exceeded = any(judged["verdict"] == "exceeded" for judged in safety["limits"].values())
    return exceeded or not str(safety.get("safety", "")).startswith(NOT_CLEAR)


def why_not_judged(safety: Mapping[str, Any]) -> Iterator[str]:
    """Yield the limits that a ``summary.json`` does not judge, a line for each reason."""
    reasons = dict[str, list[str]]()
    for name, why in safety.get("not_judged", {}).items():
        reasons.setdefault(why, []).append(name)
    yield from (f"{', '.join(names)} ({why})" for why, names in reasons.items())


NOT_CLEAR = "NOT CLEARLY SAFE"
"""Begins the words on a landing whose margin is smaller than its estimated error."""
NOISE = 1e-9
"""Smaller values say nothing, in any unit."""
HEAD = ("limit", "unit", "worst", "allowed", "margin", "at [s]", "wheel", "verdict")
VERDICTS = {"kept": "kept", "unclear": "NOT CLEAR", "exceeded": "EXCEEDED"}
