"""Sections of a scenario for the FMUs of a system structure, and what the structure leaves open."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.module.variables import Variable
from orchestrator.catalogue import modules as vocabulary
from orchestrator.catalogue.documents import Document
from orchestrator.coupling.errors import InputError, digits
from orchestrator.scenario.types import DEFAULT_MASTER

FORWARD_MASTER = "gauss_seidel"
"""The master where an FMU cannot save its state."""
STEPS = 1000
"""Of a run for which nobody says a step."""


@dataclass(frozen=True)
class Unit:
    """An FMU of a system structure: its file, FMPy's description, its variables by name."""

    file: Path
    description: Any
    variables: Mapping[str, Variable]

    @classmethod
    def of(cls, file: Path) -> Unit:
        """Read one; `InputError` where it is none."""
        return cls(file, vocabulary.description(file), vocabulary.of_fmu(file))

    @property
    def step(self) -> float | None:
        """The step size of its default experiment, s, if it names one."""
        default = self.description.defaultExperiment
        return float(default.stepSize) if default is not None and default.stepSize else None

    @property
    def goes_back(self) -> bool:
        """Whether it can save its state."""
        interface = self.description.coSimulation
        return interface is not None and bool(interface.canGetAndSetFMUstate)


def section(unit: Unit, values: Mapping[str, Any], sources: Mapping[str, str]) -> tuple[Document, list[str]]:
    """Return the section of a component, and the names among `values` that are none of its parameters or inputs."""
    found: Document = {"fmu": str(unit.file), "parameters": {}, "inputs": {}}
    lost: list[str] = []
    for name, value in values.items():
        variable = unit.variables.get(name)
        table = {"parameter": "parameters", "input": "inputs"}.get(variable.causality) if variable else None
        if variable is None or table is None:
            lost.append(name)
        else:
            found[table][name] = {"value": _typed(variable, value), "source": sources[name]}
    return found, lost


def _typed(variable: Variable, value: Any) -> Any:
    """Return a number as its variable has it, where nothing is lost: 1 of a real is 1.0."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and variable.kind == "real":
        return float(value)
    return int(value) if number and variable.kind == "integer" and value == int(value) else value


def simulation(
    units: Iterable[Unit], place: Path, span: tuple[float, float | None], step: float | None, master: str | None
) -> tuple[Document, list[str]]:
    """Return the times and the master of a structure, and what of it was chosen for want of anything said.

    Parameters
    ----------
    span : s, start and stop, as far as they are known
    step, master : of the structure, if it says them
    """
    units, (start, stop) = list(units), span
    found: Document = {"start_time": start, **({"stop_time": stop} if stop is not None else {})}
    notes: list[str] = []
    if master is None:
        master = DEFAULT_MASTER if all(unit.goes_back for unit in units) else FORWARD_MASTER
        notes.append(f"{place.name} names no master: {master}, unless another one is given")
    own = [unit.step for unit in units if unit.step is not None]
    if step is None:
        given, why = (min(own), "the smallest of its FMUs' own") if own else (None, f"1/{STEPS} of the run")
        step = _whole(start, stop, given)
        notes.append(f"{place.name} names no macro step: {digits(step)} s, {why}, unless another one is given")
    return found | {"macro_step": step, "master": master}, notes


def _whole(start: float, stop: float | None, step: float | None) -> float:
    """Return a step, or the next smaller one that divides the span."""
    length = (stop if stop is not None else start + 1.0) - start
    if step is None or not (0.0 < step < math.inf and math.isfinite(length)):
        return length / STEPS
    count = length / step
    return step if abs(count - round(count)) < 1e-9 * count else length / math.ceil(count)


def unique(names: Mapping[Any, str], place: Path) -> None:
    """Raise `InputError` where two components would have one name."""
    seen: dict[str, Any] = {}
    for key, name in names.items():
        if name in seen:
            raise InputError(f"{place}: {seen[name]} and {key} would both be called {name} here; rename one of them")
        seen[name] = key


def linear(source: str, target: str, factor: float, offset: float) -> str:
    """Return a connection as a scenario has it, ``2.0 * a.x + 1.0 -> b.u``."""
    scaled = source if factor == 1.0 else f"{factor!r} * {source}"
    sign = "-" if math.copysign(1.0, offset) < 0.0 else "+"
    shifted = scaled if offset == 0.0 else f"{scaled} {sign} {abs(offset)!r}"
    return f"{shifted} -> {target}"
