"""The result of a coupled run: just made or read back from its directory, it is the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np

from orchestrator.coupling.errors import DONE, FAILED, FORWARD, INTERRUPTED, MISSED, SIGNALLED
from orchestrator.coupling.run.results import Table
from orchestrator.landing import audit
from orchestrator.landing.safety import Judged
from orchestrator.runs.errors import CURES, NAMES, Parts, missed

Verdict = Literal["within", "missed", "failed", "interrupted"]
EXIT_STATUS: dict[Verdict, int] = {"within": DONE, "missed": MISSED, "failed": FAILED, "interrupted": INTERRUPTED}
"""What the command line ends with."""
SLOW, HELD, CHATTER = (
    ("fixed_point", "aitken", "anderson", "semi_implicit"), ("jacobi", "gauss_seidel"), ("nepce", "reduced_interface")
)  # fmt: skip
"""Masters that another one is advised for (docs/notebook/masters.md): `iqn_ils` converges where those of the first group do
not; those of the last chatter where those of the second do not."""


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
    messages : what the FMUs have said, a line each; those of ``fmu.log``
    """

    table: Table
    iterations: Table
    fields: dict[str, np.ndarray]
    summary: dict[str, Any]
    manifest: dict[str, Any]
    directory: Path | None = field(default=None)
    messages: list[str] = field(default_factory=list)

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
        return {name: parts.total for name, parts in self.error_parts.items()}

    @cached_property
    def error_parts(self) -> dict[str, Parts]:
        """The parts of the estimated error by signal: coupling, inner steps, mesh, and their sum."""
        return {name: Parts.from_content(content) for name, content in self.summary["estimated_error"].items()}

    @property
    def estimate_failure(self) -> str:
        """Which parts of the estimate failed, and why; empty where it is whole, or none was asked for."""
        return self.summary["estimate_failure"]

    @property
    def estimate_doubts(self) -> list[str]:
        """Why no calibration speaks for the estimated errors, a line each; empty where one does."""
        return self.summary.get("estimate_doubts", [])

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
        """How the run ended, and whether its numbers are good.

        ``within``: every macro step converged, the robot is on the cable, and no estimated error is larger than its
        tolerance; ``missed``: not so; ``failed``, ``interrupted``: the results end before the stop time. A run without an
        estimate (`estimated_error` empty or NaN) is judged by the rest alone. Whether the landing was safe is another
        question: `safe`.
        """
        return self.summary["verdict"]

    @property
    def exit_status(self) -> int:
        """The exit status of ``orchestrator run``: 0 within and not unsafe, 1 missed or not safe, 3 failed.

        Of one that a signal has ended it is 128 + the signal's number: 130 after Ctrl-C.
        """
        if (number := self.summary.get("signal")) is not None:
            return SIGNALLED + number
        return MISSED if self.verdict == "within" and self.safe is False else EXIT_STATUS[self.verdict]

    @property
    def safe(self) -> bool | None:
        """Whether the landing clearly keeps every limit that was judged, on the line, up to the end of the run.

        None where nothing is judged: a general graph, no limit known, no wheel that has touched. `safety` says it in words.
        """
        return self.summary.get("safe")

    @property
    def safety(self) -> str:
        """The verdict on safety in a line: what it covers, up to when; empty of a general graph."""
        return self.summary.get("safety", "")

    @cached_property
    def limits(self) -> Mapping[str, Judged]:
        """The limits that were judged, by name: each with the worst value, the margin, when, and at which wheel."""
        return {name: Judged.from_content(content) for name, content in self.summary.get("limits", {}).items()}

    @property
    def notes(self) -> list[str]:
        """What was decided in reading the scenario that its author may not expect, a line each."""
        return self.summary["notes"]

    @property
    def wiring(self) -> list[str]:
        """What of the wiring its author may not expect: another exchange than that asked for, inputs that nothing feeds."""
        return self.summary.get("wiring", [])

    @cached_property
    def energy(self) -> audit.Audit | None:
        """The energy audit; None where a component does not show its energy."""
        return audit.of_coupled(self.table, self.tolerances.values())

    @property
    def warnings(self) -> list[str]:
        """What went wrong, a line each: unconverged steps, a fall, impacts not resolved, a tolerance missed …"""
        drift = self.energy.warning() if self.energy is not None else None
        lines = [self._unconverged()] if self.summary["unconverged_steps"] else []
        lines += [f"{contact}: the cable left the groove; the robot has fallen off" for contact in self.fallen]
        lines += [_unresolved(impact) for impact in self.summary.get("unresolved_impacts", [])]
        lines += [f"{drift}{self._other_master()}"] if drift is not None else []
        lines += self.summary["warnings"]
        lines += [f"estimated error: not calibrated for this run, {why}" for why in self.estimate_doubts]
        lines += [self._missed(name) for name in missed(self.error_parts, self.tolerances, self.table)]
        lines += [f"{self.error}; the results up to there are kept"] if self.error else []
        lines += [self.safety] if self.safe is False else []
        missing = {name: self.manifest.get(name) for name in ("pictures", "page")}
        return lines + [f"no {name}: {why}" for name, why in missing.items() if why]

    def _missed(self, name: str) -> str:
        """Say which part of an error makes it miss its tolerance, and what helps."""
        parts = self.error_parts[name]
        cure = CURES[parts.largest].format(macro_step=0.5 * self.macro_step)
        return f"{name}: the estimated error misses its tolerance, most of it is {NAMES[parts.largest]}: {cure}"

    def _unconverged(self) -> str:
        """Say how many macro steps did not converge, where, and what helps."""
        steps = self.iterations
        first = int(np.argmin(steps["converged"]))
        return (
            f"{self.summary['unconverged_steps']} of {self.summary['steps']} macro steps did not converge, the first at "
            f"t = {steps['time'][first]:g} s (residual {steps['residual'][first]:.1e}); see iterations.csv, take a "
            f"smaller macro step{self._other_master()}"
        )

    def _other_master(self) -> str:
        """Return which master may do better at the same step; empty where there is none known."""
        if self.master in SLOW:
            return ", or iqn_ils"
        if self.master in HELD:
            return ", or iqn_ils if every FMU can save its state"
        return f", or {FORWARD}" if self.master in CHATTER else ""

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
