"""A bench for one FMU: experiments from one start, each with its inputs over time and its number of steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from orchestrator.coupling.exchange import RATE, suffixed
from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.fmu.description import Value
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.isolated import Limits
from orchestrator.coupling.stepping.replay import REPLAY

MACRO_STEP = 5e-3
"""s; that of the shipped landings."""
Loads = Mapping[str, float]
"""Input → its value, held over an experiment."""
Isolation = bool | Limits
Course = Callable[[float, float], Loads]
"""From start and length of a step (s) to the inputs of that step."""


@dataclass(frozen=True)
class Motion:
    """What an experiment has shown.

    Attributes
    ----------
    names : of the outputs
    time : (n + 1,), s
    values : (n + 1, len(names))
    """

    names: tuple[str, ...]
    time: np.ndarray
    values: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """Return an output over time (n + 1,), or of a vector all three components (n + 1, 3)."""
        if name in self.names:
            return self.values[:, self.names.index(name)]
        return self.values[:, [self.names.index(f"{name}.{axis}") for axis in "xyz"]]

    def every(self, k: int) -> Motion:
        """Return what was shown after each `k` steps."""
        return Motion(self.names, self.time[::k], self.values[::k])


class Bench:
    """One FMU, started again and again from the same point.

    Parameters
    ----------
    path : the FMU
    parameters : start values, parameters and inputs
    macro_step : s; without it that of the FMU's own step, where it is fixed, else `MACRO_STEP`
    driven : inputs that experiments set, those that it does not name to 0; the others keep their start values
    isolate : whether each instance lives in a process of its own, and within which limits

    Attributes
    ----------
    H : the macro step, s
    outputs : names of its real outputs
    restores : whether it takes a step twice alike from a saved state; else each experiment has an instance of its own
    """

    def __init__(
        self,
        path: Path,
        parameters: Mapping[str, Value] | None = None,
        macro_step: float | None = None,
        driven: Iterable[str] = (),
        isolate: Isolation = False,
    ) -> None:
        self.path, self.parameters, self.isolate = path, dict(parameters or {}), isolate
        self.fmu = Fmu(path, isolate=isolate)
        self.start: SavedState | None = None
        self.H = macro_step or own_step(self.fmu) or MACRO_STEP
        self.driven = [name for name in driven if name in self.fmu.ports]
        real = [p for p in self.fmu.ports.values() if p.kind == "real"]
        self.outputs = tuple(p.name for p in real if p.causality == "output")
        self.restores = False
        try:
            self._start(self.fmu)
            self.restores = self._restores()
        except BaseException:
            self.fmu.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance."""
        if self.start is not None and not self.fmu.closed:
            self.fmu.release(self.start)
        self.fmu.close()

    def has(self, *names: str) -> bool:
        """Return whether the FMU has all these variables; a vector counts by its components."""
        return all(name in self.fmu.ports or f"{name}.x" in self.fmu.ports for name in names)

    def shown(self, name: str) -> float | None:
        """Return the value of a parameter at the start; None if there is none."""
        return float(self.fmu.read(name)) if name in self.fmu.ports else None

    @property
    def divides(self) -> bool:
        """Whether the FMU takes smaller steps than the macro step."""
        can = self.fmu.capabilities
        return can.variable_step and not (can.internal_step and self.H / can.internal_step < 1.5)

    def fresh(self, parameters: Mapping[str, Value] | None = None) -> Fmu:
        """Return another instance, started."""
        interface: Any = self.fmu.description.coSimulation
        if interface.canBeInstantiatedOnlyOncePerProcess:
            self.close()
            self.restores = False
        fmu = Fmu(self.path, isolate=self.isolate)
        try:
            self._start(fmu, parameters)
        except BaseException:
            fmu.close()
            raise
        return fmu

    def _start(self, fmu: Fmu, parameters: Mapping[str, Value] | None = None) -> None:
        fmu.set_parameters(self.parameters | dict(parameters or {}))
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()

    def _restores(self) -> bool:
        """Save the start, and return whether a step from there and the same step once more are alike."""
        if not (self.fmu.capabilities.rollback and self.fmu.capabilities.variable_step):
            return False
        rest, found = held({}, self.H), []
        try:
            self.start = self.fmu.save()
            for _ in range(2):
                found.append(self.stepped(self.fmu, rest, self.H, 1).values)
                self.fmu.restore(self.start)
        except FmuError:
            return False
        return bool(np.all(np.abs(found[0] - found[1]) <= REPLAY * np.abs(found[0])))

    def run(self, loads: Loads, duration: float, n: int, rates: Loads | None = None) -> Motion:
        """Return what the FMU shows with inputs `loads` over `duration` (s) in `n` equal steps.

        Parameters
        ----------
        rates : slopes of the loads over the whole time, about its middle
        """
        return self.follow(held(loads, duration, rates or {}), duration, n)

    def follow(self, course: Course, duration: float, n: int) -> Motion:
        """Return what the FMU shows with inputs that follow a `course` over `duration` (s) in `n` equal steps."""
        if self.restores and self.start is not None:
            self.fmu.restore(self.start)
            return self.stepped(self.fmu, course, duration, n)
        fmu = self.fresh()
        try:
            return self.stepped(fmu, course, duration, n)
        finally:
            fmu.close()

    def stepped(self, fmu: Fmu, course: Course, duration: float, n: int, start: float = 0.0) -> Motion:
        """Return what an instance shows that is at `start` (s), as `follow` does."""
        h = duration / n
        group, shown = fmu.group(self.driven), fmu.group(self.outputs)
        shown.get_finite()
        rows = [shown.values.copy()]
        for i in range(n):
            now = course(i * h, h)
            group.values[:] = [now.get(name, 0.0) for name in self.driven]
            group.set()
            fmu.step(start + i * h, h)
            shown.get_finite()
            rows.append(shown.values.copy())
        return Motion(self.outputs, h * np.arange(n + 1), np.array(rows))


def held(loads: Loads, duration: float, rates: Loads | None = None) -> Course:
    """Return loads as a course: mean and slope of each step of what has the `rates` over the whole duration (s)."""
    slopes = {suffixed(name, RATE): rate for name, rate in (rates or {}).items()}

    def at(t: float, h: float) -> dict[str, float]:
        since_middle = t + h / 2 - duration / 2
        moved = {name: rate * since_middle for name, rate in (rates or {}).items()}
        return {name: loads.get(name, 0.0) + moved.get(name, 0.0) for name in {*loads, *moved}} | slopes

    return at


def own_step(fmu: Fmu) -> float | None:
    """Return the step (s) that an FMU is made for, where it cannot make others."""
    if fmu.capabilities.internal_step:
        whole = max(1, round(MACRO_STEP / fmu.capabilities.internal_step))
        return whole * fmu.capabilities.internal_step
    return fmu.own_step if not fmu.capabilities.variable_step else None


def named(motion: Motion, names: Iterable[str]) -> np.ndarray:
    """Return several vectors and scalars over time beside each other, (n + 1, m)."""
    return np.column_stack([motion[name] for name in names])
