"""The result of a coupled run: just made or read back from its directory, it is the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np

from orchestrator.coupling.errors import DONE, FAILED, INTERRUPTED, MISSED
from orchestrator.coupling.run.results import Table
from orchestrator.landing import audit

Verdict = Literal["within", "missed", "failed", "interrupted"]
EXIT_STATUS: dict[Verdict, int] = {"within": DONE, "missed": MISSED, "failed": FAILED, "interrupted": INTERRUPTED}
"""What the command line ends with."""
CONSTANT = 1e-6
"""A signal that moves by less than this (m, rad …) counts as constant: errors are then held against this range, as for
the roll of a landing at midspan, which is zero by symmetry."""


@dataclass(frozen=True, eq=False, repr=False)
class Signal:
    """One variable over time; NumPy and Matplotlib take it as an array.

    Attributes
    ----------
    name : ``component.variable``
    unit : as the FMU declares it; ``1`` where it declares none
    time : (n,) s
    values : (n,), in `unit`
    """

    name: str
    unit: str
    time: np.ndarray
    values: np.ndarray

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return the values as an array; `copy` as NumPy 2 asks for it."""
        return np.array(self.values, dtype=dtype, copy=True) if copy else np.asarray(self.values, dtype=dtype)

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, index: Any) -> Any:
        return self.values[index]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    def __repr__(self) -> str:
        return f"Signal({self.name} [{self.unit}], {len(self)} values)"


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What a coupled run leaves, in memory as in its directory.

    Attributes
    ----------
    table : signals at the communication points by name, (n,) each, ``time`` first; those of ``results.csv``
    iterations : what the master needed in each macro step, (n - 1,) each; those of ``iterations.csv``
    fields : arrays over time, as in ``fields.h5``: shape and tension of a landing's cable; else empty
    summary : the content of ``summary.json``: cost, convergence, extremes, units …
    manifest : the content of ``manifest.json``: scenario, source of each value, FMUs, and why the run is not complete
    directory : where it was written; None if it was not
    """

    table: Table
    iterations: Table
    fields: dict[str, np.ndarray]
    summary: dict[str, Any]
    manifest: dict[str, Any]
    directory: Path | None = field(default=None)

    @property
    def time(self) -> np.ndarray:
        """The communication points, (n,) s."""
        return self.table["time"]

    @cached_property
    def signals(self) -> Mapping[str, Signal]:
        """Every recorded variable over time by its name, ``component.variable``."""
        units, time = self.summary["units"], self.time
        return {n: Signal(n, units.get(n, ""), time, values) for n, values in self.table.items() if n != "time"}

    def __getitem__(self, name: str) -> Signal:
        return self.signals[name]

    @property
    def master(self) -> str:
        """The master by its name."""
        return self.summary["master"]

    @property
    def macro_step(self) -> float:
        """The macro step, s."""
        return self.summary["macro_step"]

    @property
    def label(self) -> str:
        """Master and macro step, as folders are called."""
        return run_label(self.master, self.macro_step)

    @property
    def tolerances(self) -> dict[str, float]:
        """The largest error allowed, by signal, as a part of its range."""
        return self.summary["tolerances"]

    @property
    def estimated_error(self) -> dict[str, float]:
        """Estimated largest error by signal, in its unit; NaN where the estimate failed, empty where none was made."""
        return {n: float("nan") if error is None else error for n, error in self.summary["estimated_error"].items()}

    @property
    def estimate_failure(self) -> str:
        """Why there is no estimate of the error; empty where there is one, or none was asked for."""
        return self.summary["estimate_failure"]

    @property
    def error(self) -> str | None:
        """Why the run ended before its time; None if it did not."""
        return self.manifest.get("error")

    @property
    def fallen(self) -> list[str]:
        """The contacts that the cable has left."""
        return self.summary["left_the_groove"]

    @property
    def verdict(self) -> Verdict:
        """How the run ended, as the exit status of ``orchestrator run`` says it.

        ``within``: every macro step converged and the robot is on the cable; ``missed``: not so; ``failed``,
        ``interrupted``: the results end before the stop time.
        """
        return self.summary["verdict"]

    @property
    def exit_status(self) -> int:
        """The exit status of ``orchestrator run``: 0 within, 1 missed, 3 failed, 130 interrupted."""
        return EXIT_STATUS[self.verdict]

    @property
    def notes(self) -> list[str]:
        """What was decided in reading the scenario that its author may not expect, a line each."""
        return self.summary["notes"]

    @cached_property
    def energy(self) -> audit.Audit | None:
        """The energy audit; None where a component does not show its energy."""
        return audit.of_coupled(self.table, self.tolerances.values())

    @property
    def warnings(self) -> list[str]:
        """What went wrong, a line each: unconverged steps, a fall, impacts that the steps do not resolve, energy that drifts,
        the end before its time."""
        drift = self.energy.warning() if self.energy is not None else None
        lines = [self._unconverged()] if self.summary["unconverged_steps"] else []
        lines += [f"{contact}: the cable left the groove; the robot has fallen off" for contact in self.fallen]
        lines += [_unresolved(impact) for impact in self.summary.get("unresolved_impacts", [])]
        lines += [drift] if drift is not None else []
        lines += [f"{self.error}; the results up to there are kept"] if self.error else []
        return lines + ([f"no pictures: {self.manifest['pictures']}"] if self.manifest.get("pictures") else [])

    def _unconverged(self) -> str:
        """Say how many macro steps did not converge, where, and what helps."""
        steps = self.iterations
        first = int(np.argmin(steps["converged"]))
        return (
            f"{self.summary['unconverged_steps']} of {self.summary['steps']} macro steps did not converge, the first at "
            f"t = {steps['time'][first]:g} s (residual {steps['residual'][first]:.1e}); see iterations.csv, take a "
            "smaller macro step or another implicit master"
        )

    def frame(self) -> Any:
        """Return the signals as a pandas ``DataFrame``, a row a communication point; `ImportError` without pandas."""
        data = {name: values for name, values in self.table.items() if name != "time"}
        return pandas_module().DataFrame(data, index=pandas_module().Index(self.time, name="time"))

    def __repr__(self) -> str:
        place = f"; {self.directory}" if self.directory is not None else ""
        name, steps = self.summary["scenario"], self.summary["steps"]
        return f"Run({name}: {self.master}, {steps} steps of {self.macro_step:g} s, {self.verdict}{place})"


def _unresolved(impact: Mapping[str, Any]) -> str:
    """Say what a step too long for an impact means, and what helps."""
    rise, step = 0.25 * impact["period"], impact["step"]
    return (
        f"{impact['contact']} meets the cable with {impact['speed']:.2g} m/s after t = {impact['time']:g} s, and the force of "
        f"such an impact rises within {rise:.2g} s, a quarter of the contact's period: the step of {step:.2g} s does not "
        f"resolve it, the peak of its force is not known; take a macro step of at most {0.9 * rise:.2g} s"
    )


def run_label(master: str, macro_step: float) -> str:
    """Return master and macro step, as folders are called."""
    return f"{master}_{macro_step:g}s"


def pandas_module() -> Any:
    """Return pandas; `ImportError` says how to get it."""
    try:
        return import_module("pandas")
    except ImportError:
        raise ImportError("frame() needs pandas, which is not installed: pip install pandas") from None


def verdict_word(passed: bool, note: str = "") -> str:
    """Return ``pass`` or ``FAIL`` with its reason."""
    return "pass" if passed else f"FAIL: {note}" if note else "FAIL"
