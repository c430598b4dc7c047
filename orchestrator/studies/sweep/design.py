"""The runs of a sweep: every combination of what varies, each with the same sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from orchestrator.runs.job import Job
from orchestrator.studies.sweep.study import EXTREMES, Sample, Study

A, B = "A", "B"
"""Parts of the points of sensitivities: two samples, then for each parameter A with that parameter as in B (its key)."""


@dataclass(frozen=True)
class Row:
    """A run of a sweep.

    Attributes
    ----------
    number : from 1
    varied, sampled : its values by their keys
    group : number of its combination, from 0
    block : number of its scramble, from 0; of an independent sample that of the sample
    part : of the points that sensitivities are taken from, see `A`; empty of all other runs
    """

    number: int
    varied: Mapping[str, Any]
    sampled: Mapping[str, Any]
    group: int
    block: int
    part: str = ""

    @property
    def inputs(self) -> dict[str, Any]:
        """All its values, bare."""
        return {key: bare(value) for key, value in {**self.varied, **self.sampled}.items()}


def bare(value: Any) -> Any:
    """Return the number of a quantity, or the value itself."""
    return value["value"] if isinstance(value, Mapping) and "value" in value else value


def groups(study: Study) -> list[dict[str, Any]]:
    """Return every combination of what varies; one without values where nothing does."""
    values = study.values
    return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]


def rows(study: Study, first: int = 0, end: int = 1) -> list[Row]:
    """Return the runs of the scrambles (independent samples) from `first` to before `end`; without a sample all runs."""
    combinations = groups(study)
    if study.sample is None:
        return [Row(i + 1, group, {}, i, 0) for i, group in enumerate(combinations)]
    found: list[Row] = []
    for i, (block, sampled) in enumerate(_samples(study.sample, first, end), start=first * study.sample.block):
        numbers = range(i * len(combinations) + 1, (i + 1) * len(combinations) + 1)
        found += [
            Row(n, group, sampled, g, block) for g, (n, group) in enumerate(zip(numbers, combinations, strict=True))
        ]
    return found


def sensitivity_rows(study: Study) -> list[Row]:
    """Return the runs that sensitivities are taken from; none where they are not asked for."""
    if study.sensitivity is None or study.sample is None:
        return []
    combinations, laws = groups(study), study.sample.distributions
    number, found = study.sample.count * len(combinations), list[Row]()
    for part, shares in saltelli(len(laws), study.sensitivity.count, study.sample.seed, list(laws)).items():
        drawn = {key: law.values(shares[:, i]) for i, (key, law) in enumerate(laws.items())}
        for j in range(len(shares)):
            sampled = {key: _value(values[j], laws[key].unit) for key, values in drawn.items()}
            for g, group in enumerate(combinations):
                found.append(Row(number + len(found) + 1, group, sampled, g, j, part))
    return found


def saltelli(dimension: int, count: int, seed: int, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the points (count, d) in the unit cube from which the indices of Sobol' are taken, by their part.

    Saltelli et al. 2010, Computer Physics Communications 181, 259-270: A and B are the halves of one Sobol sequence in 2 d
    dimensions, scrambled; d more parts are A with a column of B.
    """
    generator = np.random.default_rng([seed, count])
    drawn = qmc.Sobol(2 * dimension, seed=generator).random(count)  # type: ignore[call-arg]  # rng from SciPy 1.15 on
    found = {A: drawn[:, :dimension], B: drawn[:, dimension:]}
    for i, name in enumerate(names):
        found[name] = found[A].copy()
        found[name][:, i] = found[B][:, i]
    return found


def _samples(sample: Sample, first: int, end: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield block and values of each sample."""
    for block, shares in enumerate(points(sample, first, end), start=first):
        drawn = {key: law.values(shares[:, i]) for i, (key, law) in enumerate(sample.distributions.items())}
        for j in range(len(shares)):
            yield block, {key: _value(values[j], sample.distributions[key].unit) for key, values in drawn.items()}


def _value(number: float, unit: str) -> Any:
    return {"value": float(number), "unit": unit} if unit else float(number)


def points(sample: Sample, first: int, end: int) -> Iterator[np.ndarray]:
    """Yield the points (block, d) of each scramble in the unit cube: each independent of all others."""
    dimension = len(sample.distributions)
    if sample.method == "random":
        drawn = np.random.default_rng(sample.seed).random((end, dimension))
        yield from drawn[first:, None]
        return
    engine = qmc.Sobol if sample.method == "sobol" else qmc.LatinHypercube
    for i in range(first, end):
        generator = np.random.default_rng([sample.seed, i])
        yield engine(dimension, seed=generator).random(sample.block)  # type: ignore[call-arg]  # rng from SciPy 1.15 on


def job(study: Study, row: Row) -> Job:
    """Return what is run; files that the study names are looked for beside it."""
    values = {**study.set, **row.varied, **row.sampled}
    scenario, robot = values.pop("scenario", study.scenario), values.pop("robot", None)
    keep = study.record == "all" or (isinstance(study.record, list) and row.number in study.record)
    usual = study.extremes is None and study.solver == "monolithic"
    return Job(
        _near(bare(scenario), study.path.parent),
        values,
        None if robot is None else _near(bare(robot), study.path.parent),
        solver=study.solver,
        interval=study.interval,
        tolerance=study.tolerance,
        estimate=study.estimate,
        keep=keep,
        extremes=tuple(EXTREMES if usual else study.extremes or ()),
    )


def _near(name: str, folder: Path) -> str:
    """Return a name of the catalogue, or a path: files are looked for beside the study."""
    beside = folder / name
    return str(beside) if name.endswith((".toml", ".fmu")) and beside.is_file() else name
