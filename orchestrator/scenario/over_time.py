"""Inputs over time in a scenario: a table of times and values, or a column of a CSV file."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, model_validator

from fmus.module.units import convert
from fmus.module.variables import Variable
from orchestrator.catalogue.documents import Document
from orchestrator.catalogue.quantities import ASSUMED, Complaint, Real, Scalar, complaints
from orchestrator.coupling.course import Course, read_columns
from orchestrator.coupling.errors import InputError, nearest


def _value(value: Any) -> float | bool:
    if not isinstance(value, bool | int | float):
        raise ValueError("must be a number, true or false")
    if not math.isfinite(value):
        raise ValueError("must be a finite number")
    return value


Value = Annotated[Any, AfterValidator(_value)]


class OverTime(BaseModel):
    """An input over time: `value` (n,) at `time` (n,), s, in the variable's own unit; straight between them, or in steps."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    time: list[Real]
    value: list[Value]
    interpolation: Literal["linear", "step"] = "linear"

    @model_validator(mode="after")
    def _is_a_course(self) -> Self:
        self.course()
        return self

    def course(self) -> Course:
        """Return it as the engine takes it."""
        return Course(self.time, [float(value) for value in self.value], self.interpolation)

    def converted(self, given: str, wanted: str) -> OverTime:
        """Return it with its values in another unit; `UnitError` if they do not convert."""
        return self.model_copy(update={"value": [convert(float(value), given, wanted) for value in self.value]})


class _Written(BaseModel):
    """What a scenario says of such an input."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time: list[Real] | None = None
    value: list[Value] | None = None
    file: str | None = None
    column: str | None = None
    interpolation: Literal["linear", "step"] = "linear"
    unit: str | None = None
    source: str | None = None
    reason: str | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        given = (self.time is not None, self.value is not None)
        if given != ((False, False) if self.file is not None else (True, True)):
            raise ValueError('give time = […] and value = […], or file = "FILE.csv"')
        if self.column is not None and self.file is None:
            raise ValueError("column is one of a file; give file, or leave it out")
        if self.source == ASSUMED and not self.reason:
            raise ValueError('what is assumed needs its reason; add reason = "…"')
        return self


@dataclass(frozen=True)
class Parsed:
    """An input over time as it was written; `sha256` of its file, if it has one."""

    value: OverTime | None
    problems: list[Complaint]
    written: str = ""
    sha256: str = ""


def parse(path: str, table: Document) -> Parsed:
    """Return the input over time that `table` at `path` stands for, or what is wrong with it."""
    try:
        written = _Written.model_validate(table)
        rows = _rows(path, written)
        value = OverTime(time=rows[0], value=rows[1], interpolation=written.interpolation)
    except ValidationError as error:
        return Parsed(None, list(complaints(error, _Written, path)))
    except InputError as error:
        return Parsed(None, [Complaint(path, problem) for problem in error.problems])
    if written.file is None:
        return Parsed(value, [])
    sha256 = hashlib.sha256(Path(written.file).read_bytes()).hexdigest()
    return Parsed(value, [], f"column {_column(path, written)} of {written.file}", sha256)


def _column(path: str, written: _Written) -> str:
    """Return the column of a file: the one that is named, else that of the variable's name."""
    return written.column or path.partition(".inputs.")[2] or path


def _rows(path: str, written: _Written) -> tuple[list[float], list[Any]]:
    if written.file is None:
        return written.time or [], written.value or []
    time, columns = read_columns(Path(written.file))
    name = _column(path, written)
    if name not in columns:
        hint = nearest(name, columns) or f"; it has {', '.join(columns)}"
        raise InputError(f"{written.file} has no column {name}{hint}")
    return time, columns[name]


def is_tunable(variable: Variable) -> bool:
    """Return whether it is a parameter that may change at communication points."""
    return variable.causality == "parameter" and variable.discrete


def problems_of(path: str, variable: Variable, value: OverTime) -> list[Complaint]:
    """Return what keeps a variable from following a table."""
    if variable.causality != "input" and not is_tunable(variable):
        return [Complaint(path, "has one value over the run; only inputs and tunable parameters follow a table")]
    if variable.kind == "string":
        return [Complaint(path, "is a string and cannot follow a table; give one value")]
    if variable.kind in ("integer", "boolean"):
        if value.interpolation != "step":
            return [Complaint(path, f'is of type {variable.kind} and can only go in steps; add interpolation = "step"')]
        wrong = [x for x in value.value if x != (bool(x) if variable.kind == "boolean" else round(float(x)))]
        return [Complaint(path, f"{x!r} is not of type {variable.kind}") for x in wrong[:1]]
    outside = [x for x in value.value if not variable.bounds.admit(float(x))]
    return [Complaint(path, f"{x!r} must be {variable.bounds}") for x in outside[:1]]


def as_input(value: Any) -> Scalar | OverTime:
    """Return the value of an input: a scalar, or a table over time."""
    if isinstance(value, dict):
        return OverTime.model_validate(value)
    if not isinstance(value, Scalar | OverTime):
        raise ValueError("must be a number, true, false, a string, or a table { time = […], value = […] }")
    return value


def held(inputs: Mapping[str, Scalar | OverTime]) -> dict[str, Scalar]:
    """Return the inputs that keep one value."""
    return {name: value for name, value in inputs.items() if not isinstance(value, OverTime)}


def courses(inputs: Mapping[str, Scalar | OverTime]) -> dict[str, Course]:
    """Return the courses of the inputs that follow one."""
    return {name: value.course() for name, value in inputs.items() if isinstance(value, OverTime)}
