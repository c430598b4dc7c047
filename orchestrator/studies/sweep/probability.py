"""How probable it is that limits hold, with an interval that is valid for the way in which samples were drawn.

Independent samples: Clopper and Pearson's interval, which is exact. Sobol and Latin hypercube: samples of one scramble hang
together, but scrambles are independent of one another, so that a t interval over their means is taken. It has two supports:

* It is never narrower than ln(2 / alpha) / n to either side. Scrambles that agree to the last sample do not show how far they
  are from the truth: what has no sample of n may have a probability of that.
* Where less than one sample a scramble is on the rarer side, means are far from normal, and the interval of Clopper and
  Pearson is taken: a scramble spreads its samples no worse than chance does.

A study that stops by itself looks several times. The error allowed is dealt out over its looks (Bonferroni), so that the last
interval is valid wherever it stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Probability:
    """That limits hold.

    Attributes
    ----------
    count : samples
    safe, unknown : those that keep them; those of which nothing is known: the run failed, or nothing was judged
    estimate : least and most that it may be: what is unknown counted as not safe, and as safe
    interval : that covers the probability with `confidence`, whatever the unknown ones are
    method : in words
    """

    count: int
    safe: int
    unknown: int
    estimate: tuple[float, float]
    interval: tuple[float, float]
    confidence: float
    method: str

    @property
    def half_width(self) -> float:
        """Half of what the interval spans."""
        return 0.5 * (self.interval[1] - self.interval[0])


def probability(
    safe: Sequence[bool | None],
    blocks: Sequence[int],
    independent: bool,
    looks: int = 1,
    confidence: float = CONFIDENCE,
) -> Probability:
    """Return the probability that limits hold.

    Parameters
    ----------
    safe : (n,) of each sample; None where it is not known
    blocks : (n,) its scramble
    independent : whether every sample is independent of all others
    looks : how often a study that stops by itself may look
    """
    alpha = (1.0 - confidence) / looks
    least = np.array([one is True for one in safe], float)
    most = np.array([one is not False for one in safe], float)
    ends = [_interval(values, np.asarray(blocks), independent, alpha) for values in (least, most)]
    return Probability(
        len(safe),
        int(least.sum()),
        int(most.sum() - least.sum()),
        (float(least.mean()), float(most.mean())),
        (ends[0][0], ends[1][1]),
        confidence,
        _words(independent, len(set(blocks)), looks),
    )


def _words(independent: bool, scrambles: int, looks: int) -> str:
    name = "Clopper-Pearson" if independent else f"t interval over {scrambles} scrambles"
    return name + (f", its error dealt out over {looks} looks" if looks > 1 else "")


def _interval(values: np.ndarray, blocks: np.ndarray, independent: bool, alpha: float) -> tuple[float, float]:
    """Return the interval of the mean of `values` (n,), 0 or 1, that misses it with a probability of `alpha`."""
    scrambles, rarer = len(np.unique(blocks)), min(values.sum(), len(values) - values.sum())
    if independent or rarer < scrambles:
        return clopper_pearson(int(values.sum()), len(values), alpha)
    return _of_scrambles(values, blocks, alpha)


def clopper_pearson(hits: int, count: int, alpha: float) -> tuple[float, float]:
    """Return the exact interval of a probability: of `count` independent trials, `hits` came true."""
    low = special.betaincinv(hits, count - hits + 1, 0.5 * alpha) if hits else 0.0
    high = special.betaincinv(hits + 1, count - hits, 1.0 - 0.5 * alpha) if hits < count else 1.0
    return float(low), float(high)


def _of_scrambles(values: np.ndarray, blocks: np.ndarray, alpha: float) -> tuple[float, float]:
    """Return the t interval over the means of scrambles, not narrower than n samples can tell."""
    means = np.array([values[blocks == block].mean() for block in np.unique(blocks)])
    deviation = means.std(ddof=1) / np.sqrt(len(means))
    half = special.stdtrit(len(means) - 1, 1.0 - 0.5 * alpha) * deviation
    half = max(float(half), np.log(2.0 / alpha) / len(values))
    middle = float(values.mean())
    return max(0.0, middle - half), min(1.0, middle + half)


# -- when to look -----------------------------------------------------------------------------------------------


def looks(total: int, fewest: int, stops: bool) -> list[int]:
    """Return after how many scrambles (independent samples) a study looks: each time twice as many, `total` at last."""
    found = [total]
    while stops and found[0] // 2 >= fewest:
        found.insert(0, found[0] // 2)
    return found
