"""Energy audit: what is stored, dissipated and put in must balance; where it does not, which part is to blame.

By the first law the sum E of these is constant, each counted from the start of the run:

    kinetic + strain + gravitational + dissipated energy of cable, robot and contacts, less the work of the control.

Its drift is an error of the computation, whatever the motion. Where the components also book the work done on them
through their ports, the drift splits exactly: each component has its own books (energy less the work done on it: the
error of its time integration, or of sampling the contact law), and each interface the work that arrives on one side
but was not done on the other (the error of the coupling).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.module import registry
from orchestrator.coupling.run.columns import Columns
from orchestrator.coupling.run.results import Table

GROUPS = {
    "Kinetic": r"\.kinetic_energy$",
    "Elastic": r"\.strain_energy$",
    "Gravitational": r"\.gravitational_energy$",
    "Dissipated in the cable": r"^cable\.dissipated_energy$",
    "Dissipated in contacts": r"^contact\d+\.dissipated_energy$",
    "Work of the control": r"\.control_work$",
}
"""What a picture shows together."""
ROUND_OFF = 1e-10
"""Part of the energy at the start that arithmetic leaves in a sum: the energy of a strain ε has it to 2 eps/ε, 4e-11 at
ε = 1e-5, a line that hangs looser than any."""
OF_COMPONENT = {entry.contract: entry.energy for entry in registry.MODULES.values() if entry.contract}
"""The signals that the energy of a component is made of: those of our modules, which foreign FMUs name alike."""


@dataclass(frozen=True)
class Audit:
    """The energy of a run.

    Attributes
    ----------
    time : (n,) s
    terms : signal → its change since the start, J; the control's work with a minus
    sources : component or interface → its share of the drift, J; empty where no work is booked
    allowed : J, the largest drift that the accuracy wanted (or estimated) admits; infinite where none is known
    round_off : J, what arithmetic leaves in the sum; where no more is exchanged, nothing moves
    """

    time: np.ndarray
    terms: Mapping[str, np.ndarray]
    sources: dict[str, np.ndarray]
    allowed: float
    round_off: float = 0.0

    @property
    def residual(self) -> np.ndarray:
        """Sum of all terms over time, J: zero but for errors."""
        return total(self.terms.values())

    @property
    def drift(self) -> float:
        """Largest magnitude of the residual, J."""
        return float(np.max(np.abs(self.residual)))

    @property
    def exchanged(self) -> float:
        """Energy (J) that has gone from some terms to others: half the sum of all changes, at its largest."""
        return exchanged(self.terms)

    @property
    def within(self) -> bool:
        """Whether the drift is no larger than allowed."""
        return self.drift <= self.allowed

    @property
    def groups(self) -> dict[str, np.ndarray]:
        """The terms in the groups of `GROUPS`, (n,) each."""
        return {
            label: np.sum([values for name, values in self.terms.items() if re.search(pattern, name)], axis=0)
            for label, pattern in GROUPS.items()
            if any(re.search(pattern, name) for name in self.terms)
        }

    def content(self) -> dict[str, Any]:
        """Return what ``summary.json`` says of the energy."""
        scale = self.exchanged
        largest = {name: float(np.max(np.abs(values))) for name, values in self.sources.items()}
        return {
            "drift_J": self.drift,
            "drift_end_J": float(self.residual[-1]),
            "exchanged_J": scale,
            "relative_drift": self.drift / scale if scale > self.round_off else None,
            "allowed_J": self.allowed,
            "verdict": "pass" if self.within else "fail",
            "sources_J": dict(sorted(largest.items(), key=lambda item: -item[1])),
        }

    def warning(self) -> str | None:
        """Return what to tell the user where the drift is too large, else None."""
        if self.within:
            return None
        text = f"the energy drifts by {self.drift:.3g} J of {self.exchanged:.3g} J exchanged"
        text += f"; {self.allowed:.3g} J are allowed"
        if not self.sources:
            return text
        worst = max(self.sources, key=lambda name: float(np.max(np.abs(self.sources[name]))))
        cure = "take a smaller macro step" if "interface" in worst else "take smaller steps"
        return f"{text}. Most of it comes from {worst}: {cure}"


def exchanged(terms: Mapping[str, np.ndarray]) -> float:
    """Return the energy (J) exchanged between `terms`, each (n,) and counted from the start."""
    return float(np.max(0.5 * total(map(np.abs, terms.values()))))


def total(values: Iterable[np.ndarray]) -> np.ndarray:
    """Return the sum of several (n,), one after the other: of a long run they have no second place in memory."""
    left = iter(values)
    found = np.array(next(left))
    for one in left:
        found += one
    return found


def missing(table: Table) -> list[str]:
    """Return the signals that an audit needs and `table` has not."""
    names = [c for c in _components(table) if c.startswith("contact")]
    if not names or "cable" not in _components(table) or "robot" not in _components(table):
        return ["cable, robot and contact"]
    return [signal for component in ("cable", "robot", *names) for signal in _signals(component) if signal not in table]


def of_coupled(table: Table, tolerances: Iterable[float] = ()) -> Audit | None:
    """Return the audit of a coupled run; None where signals are missing.

    Energy is quadratic in the motion: a relative error e of the motion changes it by 2 e of the energy exchanged, to
    first order. So a drift beyond that, with the tightest of the `tolerances` asked of the signals, proves that they
    are not met. What is no larger than round-off proves nothing.
    """
    if missing(table):
        return None
    terms = _terms(table)
    tightest, least = min(tolerances, default=np.inf), _round_off(table, terms)
    allowed = max(2.0 * tightest * exchanged(terms), least)
    return Audit(np.asarray(table["time"]), terms, _sources(table, terms), allowed, least)


def of_monolithic(table: Table, estimated_error: Mapping[str, float]) -> Audit | None:
    """Return the audit of a monolithic solution; None where signals are missing.

    The residual is a sum of signals, so that its error is at most the sum of their estimated errors.
    """
    if missing(table):
        return None
    terms = _terms(table)
    known = all(name in estimated_error for name in terms)
    allowed = sum(estimated_error[name] for name in terms) if known else np.inf
    least = _round_off(table, terms)
    return Audit(np.asarray(table["time"]), terms, {}, max(float(allowed), least), least)


def _round_off(table: Table, terms: Iterable[str]) -> float:
    """Return what arithmetic leaves (J) in the sum of the terms."""
    return ROUND_OFF * sum(abs(float(table[name][0])) for name in terms)


def _components(table: Table) -> list[str]:
    return list(dict.fromkeys(name.partition(".")[0] for name in table if name != "time"))


def _signals(component: str) -> list[str]:
    return [f"{component}.{name}" for name in OF_COMPONENT[component.rstrip("0123456789")]]


def _since_start(values: np.ndarray) -> np.ndarray:
    return np.asarray(values) - values[0]


def _terms(table: Table) -> Mapping[str, np.ndarray]:
    components = [c for c in _components(table) if c.rstrip("0123456789") in OF_COMPONENT]
    signals = [signal for component in components for signal in _signals(component)]
    terms = _Changes(table, {signal: -1.0 if signal.endswith("_work") else 1.0 for signal in signals})
    return terms if isinstance(table, Columns) else dict(terms)


class _Changes(Mapping[str, np.ndarray]):
    """Changes of signals since the start, each with its sign; of a table on disk they are made when they are asked for."""

    def __init__(self, table: Table, signs: Mapping[str, float]):
        self.table, self.signs = table, signs

    def __getitem__(self, name: str) -> np.ndarray:
        return self.signs[name] * _since_start(self.table[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self.signs)

    def __len__(self) -> int:
        return len(self.signs)


def _sources(table: Table, terms: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Split the residual; empty unless every component books its work."""
    contacts = [c for c in _components(table) if c.startswith("contact")]
    numbers = [contact.removeprefix("contact") for contact in contacts]
    sides = {"cable": "cable.port[{}].work", "robot": "robot.wheel[{}].work"}
    booked = {"cable": "contact{}.work_cable", "robot": "contact{}.work_wheel"}
    names = [name.format(k) for k in numbers for name in (*sides.values(), *booked.values())]
    if not all(name in table for name in names):
        return {}
    work = _Changes(table, dict.fromkeys(names, 1.0))
    own = {c: np.sum([terms[signal] for signal in _signals(c)], axis=0) for c in ("cable", "robot", *contacts)}
    found = {c: own[c] - sum(work[sides[c].format(k)] for k in numbers) for c in ("cable", "robot")}
    for k, contact in zip(numbers, contacts, strict=True):
        found[contact] = own[contact] + sum(work[name.format(k)] for name in booked.values())
        gaps = [work[sides[s].format(k)] - work[booked[s].format(k)] for s in sides]
        found[f"interface {contact}"] = np.sum(gaps, axis=0)
    return found
