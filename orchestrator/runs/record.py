"""A finished coupled run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.results import Table
from orchestrator.landing import audit
from orchestrator.runs.components import exchange_of
from orchestrator.scenario.types import LandingScenario, Scenario

LEFT_THE_GROOVE = 3
"""Value of a contact's `status` when the cable has left the groove."""

Progress = Callable[[float], None]
"""Told the time (s) that a run has come to."""


@dataclass
class Coupled:
    """A finished coupled run: the log, and what it was made from.

    Attributes
    ----------
    table : signals at the communication points, ``time`` first
    fields : arrays over time as in ``fields.h5``; empty for a general graph
    fmus : file and SHA-256 of every component
    estimated_error : of the signals with a tolerance, in their units; empty where none was asked for, NaN where it failed
    estimate_failure : why it failed
    """

    scenario: Scenario
    exchange: str
    log: Log
    table: Table
    fields: dict[str, np.ndarray]
    fmus: dict[str, dict[str, str]]
    estimated_error: dict[str, float] = field(default_factory=dict)
    estimate_failure: str = ""

    @property
    def steps_table(self) -> Table:
        """One row a macro step: what the master needed and reached."""
        steps = self.log.steps
        names = (
            "time",
            "iterations",
            "residual",
            "subdivisions",
            "rejected",
            "columns",
            "converged",
            "estimate",
            "power_residual",
        )
        table = {name: np.array([getattr(step, name) for step in steps]) for name in names}
        return table | {f"power_residual.{name}": values for name, values in self.log.power_residual.items()}

    @property
    def master(self) -> str:
        """The master by its name."""
        return self.scenario.simulation.master

    @property
    def exchange_asked(self) -> str:
        """The exchange that was asked for; cable and robot of a landing may not have what it needs."""
        return exchange_of(self.scenario) if isinstance(self.scenario, LandingScenario) else self.exchange

    @property
    def label(self) -> str:
        """Master and macro step, as folders are called."""
        return run_label(self.master, self.log.macro_step)

    @property
    def record(self) -> Record:
        """What the pictures are drawn from."""
        return Record(self.master, self.log.macro_step, self.table, self.steps_table, self.fields)

    @property
    def energy(self) -> audit.Audit | None:
        """The energy audit; None where a component does not show its energy."""
        return audit.of_coupled(self.table, self.scenario.simulation.tolerances.values())

    @property
    def fallen(self) -> list[str]:
        """The contacts that the cable has left."""
        return [
            name.removesuffix(".status")
            for name, values in self.table.items()
            if name.startswith("contact") and name.endswith(".status") and np.any(values == LEFT_THE_GROOVE)
        ]


@dataclass(frozen=True)
class Record:
    """What one run leaves to be drawn: its signals, its macro steps, its fields."""

    master: str
    macro_step: float
    table: Table
    steps: Table
    fields: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def legend(self) -> str:
        """Master and macro step, for people."""
        return f"{self.master}, {1e3 * self.macro_step:g} ms"


def run_label(master: str, macro_step: float) -> str:
    """Return master and macro step, as folders are called."""
    return f"{master}_{macro_step:g}s"


def verdict_word(passed: bool, note: str = "") -> str:
    """Return ``pass`` or ``FAIL`` with its reason."""
    return "pass" if passed else f"FAIL: {note}" if note else "FAIL"
