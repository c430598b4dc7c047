"""The variable table: what a module shows to the outside, written once.

Every face of a module (FMU, monolithic solver, documentation) is generated from its table. A variable's
index in the table is its FMI value reference and its place in the module's flat array of values.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["real", "integer", "boolean", "string"]
Causality = Literal["parameter", "input", "output"]
Value = float | int | bool | str


class ModuleError(Exception):
    """A module cannot go on: the message names the place, the cause and the cure."""


@dataclass(frozen=True)
class Bounds:
    """Where a number may lie: ``ge <= value <= le``, ``gt < value < lt``; None is no bound.

    Written once, in the variable table: model description, scenario and module read them there. `hint` is what to
    tell someone whose value lies elsewhere.
    """

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None
    hint: str = ""

    @property
    def lowest(self) -> float | None:
        """Return the lower bound, whether it is allowed itself or not; None if there is none."""
        return self.ge if self.gt is None else self.gt

    @property
    def highest(self) -> float | None:
        """Return the upper bound, whether it is allowed itself or not; None if there is none."""
        return self.le if self.lt is None else self.lt

    def admit(self, value: float) -> bool:
        """Return whether `value` is within the bounds; NaN never is, infinity only without a bound."""
        pairs = ((self.ge, operator.ge), (self.gt, operator.gt), (self.le, operator.le), (self.lt, operator.lt))
        return value == value and all(bound is None or holds(value, bound) for bound, holds in pairs)

    def __str__(self) -> str:
        """Say what is wanted: ``greater than 0``, ``at least 0 and at most 1``."""
        words = ((self.gt, "greater than"), (self.ge, "at least"), (self.lt, "less than"), (self.le, "at most"))
        return " and ".join(f"{word} {bound:g}" for bound, word in words if bound is not None)


UNBOUNDED = Bounds()
POSITIVE = Bounds(gt=0.0)
NON_NEGATIVE = Bounds(ge=0.0)


@dataclass(frozen=True)
class Variable:
    """One scalar variable.

    Attributes
    ----------
    name : structured name, ``port[1].force.x``
    causality : ``parameter`` (fixed before initialisation), ``input`` or ``output``
    unit : FMI unit; ``1`` where there is none
    start : start value (parameters, inputs); outputs are calculated
    description : one line
    kind : FMI type; strings are choices, stored as the index into `choices`
    choices : the words a string may take
    discrete : changes at communication points only (an input is held, an output moves, between them); a parameter that
        does is a tunable one
    feedthrough : names of the inputs an output depends on without a step (outputs only)
    bounds : of parameters and inputs
    """

    name: str
    causality: Causality
    unit: str
    start: Value
    description: str
    kind: Kind = "real"
    choices: tuple[str, ...] = ()
    discrete: bool = False
    feedthrough: tuple[str, ...] = ()
    bounds: Bounds = UNBOUNDED

    def encode(self, value: Value) -> float:
        """Return `value` as the number kept in the flat array; raise `ModuleError` if it has no place
        there."""
        if self.kind != "string":
            return float(value)
        if value not in self.choices:
            raise ModuleError(f"{self.name}: {value!r} is not one of {', '.join(self.choices)}")
        return float(self.choices.index(str(value)))

    def decode(self, number: float) -> Value:
        """Return the value that `number` of the flat array stands for."""
        match self.kind:
            case "string":
                return self.choices[int(number)]
            case "integer":
                return int(number)
            case "boolean":
                return bool(number)
        return float(number)


class VariableTable:
    """An ordered table of variables with their places in a flat array.

    Parameters
    ----------
    variables : the rows; names must be unique
    """

    def __init__(self, variables: Iterable[Variable]):
        self.variables = tuple(variables)
        self.index: dict[str, int] = {v.name: i for i, v in enumerate(self.variables)}
        if len(self.index) != len(self.variables):
            raise ValueError("two variables of one table have the same name")

    def __len__(self) -> int:
        return len(self.variables)

    def __getitem__(self, name: str) -> Variable:
        return self.variables[self.index[name]]

    def names(self, causality: Causality) -> list[str]:
        """Return the names of the variables of one causality, in table order."""
        return [v.name for v in self.variables if v.causality == causality]

    def indices(self, names: Iterable[str]) -> np.ndarray:
        """Return the places of `names`: (len(names),) int64."""
        return np.array([self.index[name] for name in names], dtype=np.int64)

    def defaults(self) -> np.ndarray:
        """Return a new flat array of start values: (len(self),) float64."""
        return np.array([v.encode(v.start) for v in self.variables], dtype=np.float64)

    def assign(self, values: np.ndarray, settings: Mapping[str, Value]) -> None:
        """Write `settings` (name → value) into the flat array `values`; unknown names raise `ModuleError`."""
        for name, value in settings.items():
            if name not in self.index:
                raise ModuleError(f"{name}: no such variable")
            values[self.index[name]] = self[name].encode(value)


def check_bounds(table: VariableTable, values: np.ndarray, place: str) -> None:
    """Raise `ModuleError` naming the first parameter of `place` that is not finite or out of its bounds.

    Parameters
    ----------
    values : (len(table),) float64, the module's flat array
    """
    for name in table.names("parameter"):
        value, variable = float(values[table.index[name]]), table[name]
        unit = "" if variable.unit == "1" else f" {variable.unit}"
        if not math.isfinite(value):
            raise ModuleError(f"{place}: {name} = {value:g}{unit} is not a finite number; set it to one")
        if not variable.bounds.admit(value):
            hint = variable.bounds.hint and f"; {variable.bounds.hint}"
            raise ModuleError(f"{place}: {name} = {value:g}{unit} must be {variable.bounds}{hint}")


def parameter(name: str, unit: str, start: Value, description: str, bounds: Bounds = UNBOUNDED) -> Variable:
    """Return a real parameter."""
    return Variable(name, "parameter", unit, start, description, bounds=bounds)


def vector(
    name: str,
    causality: Causality,
    unit: str,
    description: str,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    feedthrough: tuple[str, ...] = (),
) -> list[Variable]:
    """Return the three components ``name.x, name.y, name.z``."""
    return [
        Variable(f"{name}.{axis}", causality, unit, value, f"{description}, {axis}", feedthrough=feedthrough)
        for axis, value in zip("xyz", start, strict=True)
    ]
