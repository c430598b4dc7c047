"""What the exchange rests on: means and rotations are integrals over the step, and velocities are rates of positions.

Two macro steps are made, once whole and once in `FINE` parts each; the parts of the second one are summed by Simpson's rule.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.exchange import MEAN, is_from_start, is_motion, suffixed
from orchestrator.landing.trial.bench import Bench, Course, Motion, named
from orchestrator.landing.trial.row import Deviation, Row, deviation, judged, untestable

FINE = 8
"""Parts of a macro step."""
INTEGRAL = "integral over fine steps"


@dataclass(frozen=True)
class Pair:
    """Two macro steps under the same inputs.

    Attributes
    ----------
    whole : in two steps
    fine : in `FINE` parts each
    H : the macro step, s
    """

    whole: Motion
    fine: Motion
    H: float

    def apart(self, names: Sequence[str]) -> float:
        """Return by how much whole and fine steps differ at the end of the second macro step: the error of its own steps."""
        return float(np.max(np.abs(named(self.whole, names)[-1] - named(self.fine, names)[-1]), initial=0.0))

    def samples(self, values: np.ndarray) -> np.ndarray:
        """Return the fine values (2 FINE + 1, …) within the second macro step."""
        return values[FINE:]

    def integral(self, values: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the integral of fine values over the second macro step, and the error of that integral."""
        inside = self.samples(values)
        best, rough = _simpson(inside, self.H), _simpson(inside[::2], self.H)
        return best, float(np.max(np.abs(best - rough), initial=0.0))


def pair(bench: Bench, course: Course) -> Pair | None:
    """Return two macro steps under a course of inputs; None where the FMU takes no finer ones."""
    if not bench.divides:
        return None
    H = bench.H
    return Pair(bench.follow(course, 2 * H, 2), bench.follow(course, 2 * H, 2 * FINE), H)


def _simpson(values: np.ndarray, length: float) -> np.ndarray:
    """Return the integral over `length` of equally spaced values (2 n + 1, …)."""
    h = length / (len(values) - 1)
    return h / 3 * (values[0] + 4 * values[1:-1:2].sum(axis=0) + 2 * values[2:-1:2].sum(axis=0) + values[-1])


def means(found: Pair | None, names: Sequence[str]) -> Iterator[Row]:
    """Yield a row for each mean of the motions `names`, that of all places in one: ``wheel[k].position_mean``."""
    for stem in dict.fromkeys(pattern(name) for name in names):
        alike = [name for name in names if pattern(name) == stem]
        name = suffixed(stem, MEAN)
        if found is None:
            yield untestable(name, "it makes no steps finer than its own")
        elif not np.any(np.ptp(found.samples(named(found.fine, alike)), axis=0)):
            yield untestable(name, "nothing of it moves")
        elif all(is_from_start(n) for n in alike):
            yield from _turned(found, alike, stem)
        else:
            yield _mean(found, alike, name)


def pattern(name: str) -> str:
    """Return a name with ``k`` in the place of its number."""
    before, bracket, after = name.partition("[")
    return before + ("[k]" + after.partition("]")[2] if bracket else "")


def _mean(found: Pair, names: Sequence[str], name: str) -> Row:
    shown = named(found.whole, [suffixed(n, MEAN) for n in names])[2]
    integral, error = found.integral(named(found.fine, names))
    error += found.H * found.apart(names)
    inside = found.samples(named(found.fine, names))
    scale = float(np.max(np.ptp(inside, axis=0)))
    held = deviation(shown, integral / found.H, error / found.H, scale=scale, at=float(np.max(np.abs(inside))))
    return _row(name, "the time mean over the macro step", held, _guess(shown, inside, held.allowed))


def _guess(shown: np.ndarray, inside: np.ndarray, allowed: float) -> str:
    """Return what a wrong mean is instead."""
    guesses = {
        "the value at the end of the step": inside[-1],
        "the value at its start": inside[0],
        "the mean of its two ends": (inside[0] + inside[-1]) / 2,
        "the value in its middle": inside[len(inside) // 2],
    }
    return next(
        (words for words, value in guesses.items() if np.max(np.abs(shown - value)) <= allowed), "something else"
    )


def _row(name: str, expected: str, held: Deviation, instead: str) -> Row:
    return judged(name, expected, INTEGRAL, held.words(), held.good, f"it is {instead}")


def _turned(found: Pair, names: Sequence[str], stem: str) -> Iterator[Row]:
    """Yield rows for a motion counted from the start of the step, and for its mean."""
    sources = [name.replace("rotation", "angular_velocity") for name in names]
    if not all(f"{source}.x" in found.fine.names for source in sources):
        yield untestable(stem, "it shows no angular velocity beside it")
        return
    rates = named(found.fine, sources)
    left = np.zeros_like(rates)  # the mean of a running integral: each part counts for the rest of the step
    left[FINE:] = rates[FINE:] * np.linspace(1.0, 0.0, FINE + 1)[:, None]
    (total, error), (mean, error_of_mean) = found.integral(rates), found.integral(left)
    error, error_of_mean = (e + found.H * found.apart(sources) for e in (error, error_of_mean))
    shown, shown_mean = (named(found.whole, [suffixed(n, s) for n in names])[2] for s in ("", MEAN))
    scale = float(np.max(np.abs(total)))
    held = deviation(shown, total, error, scale=scale)
    per_second = np.max(np.abs(shown - total / found.H)) <= held.allowed / found.H
    instead = "the mean angular velocity" if per_second else "something else"
    yield _row(stem, "the integral of the angular velocity over the macro step", held, instead)
    held = deviation(shown_mean, mean, error_of_mean, scale=scale)
    ends = {"half of the rotation": total / 2, "the whole rotation": total}
    instead = next((w for w, v in ends.items() if np.max(np.abs(shown_mean - v)) <= held.allowed), "something else")
    yield _row(suffixed(stem, MEAN), "the time mean of that running integral", held, instead)


def rate_of(found: Pair | None, names: Sequence[str], rates: Sequence[str], name: str) -> Row:
    """Return whether `rates` are the rates of the vectors `names`."""
    if found is None:
        return untestable(name, "it makes no steps finer than its own")
    integral, error = found.integral(named(found.fine, rates))
    change = named(found.fine, names)
    shown = change[-1] - change[FINE]
    held = deviation(shown, integral, error, scale=float(np.max(np.abs(integral))), at=float(np.max(np.abs(change))))
    backwards = np.max(np.abs(shown + integral)) <= held.allowed
    why = "the sign is the other one" if backwards else "the one is not the rate of the other"
    return judged(name, "the change over a step is the integral of the rate", INTEGRAL, held.words(), held.good, why)


def motions(bench: Bench) -> list[str]:
    """Return the outputs, vectors and scalars, whose means an FMU shows as well."""
    known = bench.fmu.vocabulary.intersection(bench.outputs)
    stems = dict.fromkeys(name[:-2] if name[-2:] in (".x", ".y", ".z") else name for name in bench.outputs)
    return [s for s in stems if is_motion(s, known) or all(is_motion(f"{s}.{axis}", known) for axis in "xyz")]
