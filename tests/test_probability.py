"""The probability that limits hold: intervals that cover it as often as they say, however samples are drawn."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from orchestrator.runs.job import Done, Job
from orchestrator.studies.sweep import design, solve
from orchestrator.studies.sweep.probability import clopper_pearson, looks, probability
from orchestrator.studies.sweep.study import Sample, Study, study_of

STUDIES = 1000
LEAST, MOST = 0.94, 0.99
"""Of repeated studies whose interval has to cover the true probability."""
LEFT, RIGHT = (f"components.{side}.parameters.mass" for side in ("left", "right"))
BY_CHANCE = 3.0
"""Standard deviations of the count of studies that cover it."""


def sample(method: str, count: int = 160, **more: object) -> Sample:
    uniform = {"uniform": [0.0, 1.0]}
    return Sample.model_validate(
        {"method": method, "count": count, "distributions": {"a": uniform, "b": uniform}, **more}
    )


def below(shares: np.ndarray, truth: float) -> np.ndarray:
    """Return whether a + b keeps below a limit, which it does with a probability of `truth` > 1/2."""
    return shares.sum(axis=1) < 2.0 - np.sqrt(2.0 * (1.0 - truth))


def covered(method: str, truth: float, studies: int = STUDIES) -> float:
    """Return the share of studies whose interval covers `truth`."""
    hits, drawn = 0, sample(method)
    blocks = 160 if method == "random" else 10
    numbers = np.repeat(np.arange(blocks), 160 // blocks)
    for seed in range(studies):
        shares = np.concatenate(list(design.points(drawn.model_copy(update={"seed": seed}), 0, blocks)))
        low, high = probability(below(shares, truth).tolist(), numbers, method == "random").interval
        hits += low <= truth <= high
    return hits / studies


def band(share: float, studies: int = STUDIES) -> float:
    """Return by how much the share of studies may differ from `share` by chance."""
    return BY_CHANCE * float(np.sqrt(share * (1.0 - share) / studies))


@pytest.mark.parametrize("method", ["random", "latin_hypercube", "sobol"])
def test_intervals_cover_the_truth_as_often_as_they_say(method: str):
    assert LEAST - band(LEAST) <= covered(method, 0.85) <= MOST + band(MOST)


@pytest.mark.parametrize("method", ["latin_hypercube", "sobol"])
def test_intervals_are_valid_where_hardly_anything_fails(method: str):
    assert covered(method, 0.99, 300) >= LEAST - band(LEAST, 300), (
        "1.6 samples of 160: means of scrambles are far from normal"
    )


def test_scrambles_that_agree_do_not_know_it_exactly():
    found = probability([True] * 160, np.repeat(np.arange(10), 16).tolist(), independent=False)
    assert found.estimate == (1.0, 1.0) and found.interval[0] == pytest.approx(0.025 ** (1 / 160)), (
        "rule of three, two-sided"
    )
    half = np.tile(np.repeat([True, False], 8), 10)
    found = probability(half.tolist(), np.repeat(np.arange(10), 16).tolist(), independent=False)
    assert found.half_width == pytest.approx(np.log(40.0) / 160)


def test_clopper_pearson_by_its_definition():
    low, high = clopper_pearson(7, 20, 0.05)
    assert (low, high) == pytest.approx(tuple(stats.binomtest(7, 20).proportion_ci(0.95, "exact")))
    assert stats.binom.sf(6, 20, low) == pytest.approx(0.025) and stats.binom.cdf(7, 20, high) == pytest.approx(0.025)


def test_what_is_unknown_is_counted_both_ways():
    found = probability([True] * 80 + [False] * 10 + [None] * 10, range(100), independent=True)
    assert (found.safe, found.unknown, found.estimate) == (80, 10, (0.8, 0.9))
    assert found.interval == (clopper_pearson(80, 100, 0.05)[0], clopper_pearson(90, 100, 0.05)[1])


# -- stopping -------------------------------------------------------------------------------------------------------


def test_looks_double_and_end_with_all():
    assert looks(200, 25, stops=True) == [25, 50, 100, 200] and looks(200, 25, stops=False) == [200]
    assert looks(20, 25, stops=True) == [20]


@pytest.mark.parametrize("truth", [0.6, 0.9, 0.97])
def test_an_interval_is_valid_wherever_the_study_stops(truth: float):
    ends, hits, widths = looks(400, 25, stops=True), 0, []
    for seed in range(STUDIES):
        safe = np.random.default_rng([11, seed]).random(400) < truth
        for end in ends:
            found = probability(safe[:end].tolist(), range(end), True, len(ends))
            if found.half_width <= 0.1:
                break
        hits += found.interval[0] <= truth <= found.interval[1]
        widths.append(found.half_width)
    assert hits / STUDIES >= LEAST - band(LEAST) and max(widths) <= 0.1


class Stand:
    """In the place of `Batches`: a landing is safe, or fails, as a function says."""

    made: Callable[[Job], bool | None]

    def __init__(self, *_: object):
        self.count = 0

    def __enter__(self) -> "Stand":
        return self

    def __exit__(self, *_: object) -> None: ...

    def run(
        self, jobs: Sequence[Job], progress: Callable[[int, int], None], ended: Callable[[Done], None]
    ) -> list[Done]:
        done = [Done(job, None, None if type(self).made(job) is not None else "failed") for job in jobs]
        for one in done:
            safe = type(self).made(one.job)
            verdict = "kept" if safe else "exceeded"
            vars(one)["summary"] = {"safe": safe, "limits": {"roll": {"verdict": verdict, "share": 0.5, "worst": 0.1}}}
            ended(one)
        progress(len(done), len(jobs))
        return done


def stood_in(monkeypatch: pytest.MonkeyPatch, study: Study, made: Callable[[Job], bool | None]) -> solve.Swept:
    monkeypatch.setattr(solve, "Batches", type("Stand", (Stand,), {"made": staticmethod(made)}))
    return solve.sweep(study, Path("nowhere"), lambda found: None)


def of_mass(**more: object) -> Study:
    drawn = {"count": 400, "seed": 3, LEFT: {"uniform": [1.0, 2.0]}, **more}
    return study_of({"scenario": "oscillator", "sample": drawn}, Path("study.toml"))


def test_a_study_stops_by_itself(monkeypatch: pytest.MonkeyPatch):
    study = of_mass(stop_when={"half_width": 0.1})
    found = stood_in(monkeypatch, study, lambda job: job.set[LEFT] < 1.8)
    (chance,) = found.chances
    assert found.complete and found.stopped and len(found.outcomes) in (50, 100, 200), "before 400"
    assert chance.of["all"].half_width <= 0.1 and chance.of["all"].interval[0] <= 0.8 <= chance.of["all"].interval[1]
    assert "dealt out over 5 looks" in chance.of["all"].method
    again = stood_in(monkeypatch, of_mass(), lambda job: job.set[LEFT] < 1.8)
    assert len(again.outcomes) == 400 and not again.stopped and again.outcomes[:50] != found.outcomes
    assert [o.row for o in again.outcomes[:50]] == [o.row for o in found.outcomes[:50]], "the same samples"


def test_a_study_that_knows_too_little_makes_all(monkeypatch: pytest.MonkeyPatch):
    found = stood_in(monkeypatch, of_mass(count=100, stop_when={"half_width": 0.01}), lambda job: True)
    assert found.complete and not found.stopped and found.chances[0].of["roll"].safe == 100


def test_runs_that_fail_widen_the_interval(monkeypatch: pytest.MonkeyPatch):
    study = of_mass(count=100)
    found = stood_in(monkeypatch, study, lambda job: None if job.set[LEFT] > 1.9 else True)
    chance = found.chances[0].of["all"]
    assert chance.unknown == len(found.failed) > 0 and chance.interval[1] == 1.0
    assert chance.estimate == pytest.approx((1.0 - chance.unknown / 100, 1.0))


def test_a_probability_for_each_combination(monkeypatch: pytest.MonkeyPatch):
    drawn = {"method": "sobol", "count": 160, LEFT: {"uniform": [1.0, 2.0]}}
    document = {"scenario": "oscillator", "vary": {RIGHT: [1.3, 1.6]}, "sample": drawn}
    study = study_of(document, Path("study.toml"))
    found = stood_in(monkeypatch, study, lambda job: job.set[LEFT] < job.set[RIGHT])
    for chance, truth in zip(found.chances, (1.3, 1.6), strict=True):
        assert chance.where == {RIGHT: truth}
        assert chance.of["all"].interval[0] <= truth - 1.0 <= chance.of["all"].interval[1]
        assert chance.of["all"].method == "t interval over 10 scrambles"
