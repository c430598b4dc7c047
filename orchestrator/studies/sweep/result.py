"""A sweep for Python: its table, its probabilities, its maps."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from orchestrator.runs.result import pandas_module
from orchestrator.studies.sweep import atlas, write
from orchestrator.studies.sweep.outcome import Chances
from orchestrator.studies.sweep.ranges import all_ranges
from orchestrator.studies.sweep.sensitivity import Sensitivity
from orchestrator.studies.sweep.solve import Swept, Told
from orchestrator.studies.sweep.solve import sweep as run_all
from orchestrator.studies.sweep.study import Study, load_study, path_of, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HASH_DIGITS = 8


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """What a sweep leaves, in memory as in its folder.

    Attributes
    ----------
    directory : with ``table.csv``, ``study.json`` and ``runs``
    swept : the study, and what became of each run
    """

    directory: Path
    swept: Swept

    @cached_property
    def table(self) -> write.Columns:
        """The columns of ``table.csv`` by name, (n,) each: numbers (NaN: not known; flags 1 and 0), or words."""
        return write.read_columns(self.directory / write.TABLE)

    @property
    def counts(self) -> Mapping[str, int]:
        """How many ``runs`` there are, and how many are ``safe``, ``not_safe``, ``not_judged``, ``failed``."""
        return self.swept.counts

    @property
    def probability(self) -> list[Chances]:
        """How probable it is that limits hold, for each combination of what varies (`where`): `of` ``all``, and of each."""
        return self.swept.chances

    @property
    def sensitivity(self) -> list[Sensitivity]:
        """What margins and extremes hang on, for each combination of what varies: `of` a column, of a parameter."""
        return self.swept.sensitivities

    @property
    def safe_ranges(self) -> list[str]:
        """Where it is safe along the first key that varies, in words; a line for each combination of the others."""
        return all_ranges(self.swept.study, self.swept.outcomes)

    @property
    def probable_ranges(self) -> list[str]:
        """Where it is safe with a probability of 95 % at least, in words, by the lower end of the interval."""
        from orchestrator.studies.sweep import odds

        return odds.words(self.swept.study, self.swept.chances)

    def frame(self) -> Any:
        """Return the table as a pandas ``DataFrame``, a row a run; `ImportError` without pandas."""
        return pandas_module().DataFrame(self.table)

    def map(self, x: str, y: str | None = None, of: Literal["margin", "probability"] = "margin") -> Figure:
        """Return a picture over the key `x`, or over `x` and `y`; `InputError` where one does not vary.

        `of`: the least margin of all runs, or how probably all limits hold.
        """
        from orchestrator.studies.sweep import maps, odds

        if of == "probability":
            return odds.draw(self.swept.study, self.swept.chances, x, y)
        return maps.draw(self.swept.study, self.swept.outcomes, x, y)

    def map_data(self) -> dict[str, Any]:
        """Return what ``map.json`` holds: axes and cells with margin, limit, verdict, probability and runs."""
        return atlas.content(self.swept)

    def __repr__(self) -> str:
        return f"Sweep({self.directory}: {write.said(self.swept)})"


def run(
    study: Path | str | Mapping[str, Any],
    out: Path | str | None = None,
    workers: int | None = None,
    timeout: float | None = None,
    progress: Told = lambda done, of, failed: None,
    dask: str | None = None,
) -> Sweep:
    """Return a sweep, run or found; parameters as for `orchestrator.sweep`."""
    read = _study(study)
    folder = write.place_of(Path(out) if out is not None else None, read)
    swept = run_all(
        read, folder / write.STORE, lambda found: write.save(folder, found), workers, timeout, progress, dask
    )
    if (missing := write.page(folder)) is not None:
        warnings.warn(missing, stacklevel=3)
    return Sweep(folder, swept)


def _study(given: Path | str | Mapping[str, Any]) -> Study:
    """Return the study of a file, or of what would stand there; the latter is named by its hash."""
    if not isinstance(given, Mapping):
        return load_study(path_of(str(given)))
    found = study_of(given, Path("study.toml"))
    found._path = Path(f"{found.hash[:HASH_DIGITS]}.toml")
    return found
