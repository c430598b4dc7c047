"""What a case of the pack is, and a reference solution with its error."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator import load_scenario
from orchestrator.coupling.run.results import Table, read_json, read_table, replacing, write_json
from orchestrator.scenario.types import Scenario

CASES = Path(__file__).parent / "cases"
REFERENCES = Path(__file__).parent / "references"
DIGITS = 14
"""Of the numbers in a reference file."""


@dataclass(frozen=True)
class Reference:
    """A solution that results are held against.

    Attributes
    ----------
    table : ``time`` (n,) s and the signals (n,), at the points of the case's grid
    error : signal → how wrong it may be, in its unit
    method : how it was made, and how its error was found
    """

    table: Table
    error: Mapping[str, float]
    method: str

    def until(self, stop: float) -> Reference:
        """Return it up to `stop` (s)."""
        kept = self.table["time"] <= stop * (1.0 + 1e-9)
        return Reference({name: values[kept] for name, values in self.table.items()}, self.error, self.method)

    def relative_error(self) -> dict[str, float]:
        """Return how wrong each signal may be, as a share of its range."""
        return {name: self.error[name] / float(np.ptp(values)) for name, values in self.table.items() if name != "time"}

    def write(self, folder: Path, name: str) -> None:
        """Write NAME.csv and NAME.json."""
        rows = np.array(list(self.table.values())).T
        with replacing(folder / f"{name}.csv") as path, path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(self.table)
            csv.writer(file, lineterminator="\n").writerows([f"{x:.{DIGITS}g}" for x in row] for row in rows)
        write_json(folder / f"{name}.json", {"method": self.method, "error": dict(self.error)})

    @classmethod
    def read(cls, folder: Path, name: str) -> Reference:
        """Return what `write` has written; `InputError` if it cannot be read."""
        about = read_json(folder / f"{name}.json")
        table = {key: np.asarray(values) for key, values in read_table(folder / f"{name}.csv").items()}
        return cls(table, about["error"], about["method"])


@dataclass(frozen=True)
class Case:
    """A case: the scenario ``cases/NAME.toml``, what of it is compared, and with what.

    Attributes
    ----------
    title, stresses : what it is, in a few words; what it asks of a co-simulation, a sentence
    signals : that are compared
    expensive : the component whose steps are counted
    stop, grid : s; end of the run, and distance of the points that are compared: a multiple of all macro steps
    implicit, explicit, others : macro steps (s) of our masters that iterate, of those that do not, and of other engines
    quick : s; end of a short run
    solution : returns the reference at (n,) times, s
    """

    name: str
    title: str
    stresses: str
    signals: tuple[str, ...]
    expensive: str
    stop: float
    grid: float
    implicit: tuple[float, ...]
    explicit: tuple[float, ...]
    others: tuple[float, ...]
    quick: float
    solution: Callable[[Case, np.ndarray], Reference]

    def scenario(
        self,
        *,
        master: str | None = None,
        macro_step: float | None = None,
        stop: float | None = None,
        exchange: str | None = None,
    ) -> Scenario:
        """Return the scenario with another master, macro step and end (s), and another exchange; it shows the signals alone."""
        stop = self.stop if stop is None else stop
        one = load_scenario(CASES / f"{self.name}.toml", master=master, macro_step=macro_step, stop=stop)
        return one.changed(record=list(self.signals), **({"exchange": exchange} if exchange else {}))

    @property
    def times(self) -> np.ndarray:
        """The points that are compared, (n,) s."""
        return self.grid * np.arange(round(self.stop / self.grid) + 1)

    def every(self, macro_step: float) -> int:
        """Return how many macro steps lie between two points that are compared."""
        return round(self.grid / macro_step)

    def reference(self) -> Reference:
        """Return the reference that is kept."""
        return Reference.read(REFERENCES, self.name)

    def solved(self) -> Reference:
        """Return the reference, made anew."""
        return self.solution(self, self.times)
