"""Quantities, ``{ value, unit, source, reason }``, of scenarios and robots; and what is wrong with a file, in our words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Generic, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from fmus.module.units import convert
from orchestrator.coupling.errors import nearest

ASSUMED = "assumed"
Scalar = bool | int | float | str
T = TypeVar("T")


@dataclass(frozen=True)
class Complaint:
    """What is wrong with the value at `path`."""

    path: str
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}" if self.path else self.message


class Quantity(BaseModel, Generic[T]):
    """A value that says in which unit it stands and where it comes from; bare numbers are SI."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: T
    unit: str | None = None
    source: str | None = None
    reason: str | None = None

    @model_validator(mode="after")
    def _reason_if_assumed(self) -> Quantity[T]:
        if self.source == ASSUMED and not self.reason:
            raise ValueError('what is assumed needs its reason; add reason = "…"')
        return self


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Number = Quantity[Real]
Triple = Quantity[tuple[Real, Real, Real]]
Choice = Quantity[Annotated[bool, Field(strict=True)]]


def _sourced(quantity: Quantity[T]) -> Quantity[T]:
    if not quantity.source:
        raise ValueError('needs its source; add source = "…"')
    return quantity


SOURCED = AfterValidator(_sourced)
"""Of what has to say where it comes from."""


def in_unit(wanted: str) -> AfterValidator:
    """Return what gives a number, or three, in the unit `wanted`, with its source."""

    def converted(quantity: Quantity[Any]) -> Quantity[Any]:
        if quantity.unit is None:
            raise ValueError(f'needs its unit; add unit = "{wanted}", or one that converts to it')
        values, given = quantity.value, quantity.unit
        if isinstance(values, tuple):
            return quantity.model_copy(
                update={"value": tuple(convert(v, given, wanted) for v in values), "unit": wanted}
            )
        return quantity.model_copy(update={"value": convert(values, given, wanted), "unit": wanted})

    return AfterValidator(lambda quantity: converted(_sourced(quantity)))


def _positive(quantity: Number) -> Number:
    if not quantity.value > 0.0:
        raise ValueError(f"{quantity.value:g} {quantity.unit or ''} must be greater than 0".replace("  ", " "))
    return quantity


POSITIVE = AfterValidator(_positive)


def quantity_complaints(path: str, table: dict[str, Any]) -> Iterator[Complaint]:
    """Yield what is wrong with a quantity of which any value will do."""
    try:
        Quantity[Any].model_validate(table, strict=True)
    except ValidationError as error:
        yield from complaints(error, Quantity[Any], path)


# -- what pydantic finds, in our words ---------------------------------------------------------------------------


def complaints(error: ValidationError, model: Any, prefix: str = "") -> Iterator[Complaint]:
    """Yield what `error` says of a document that should be a `model`: path, cause and cure."""
    for found in error.errors():
        place = found["loc"]
        path = _path(place, prefix)
        match found["type"]:
            case "extra_forbidden":
                known = known_keys(model, place[:-1])
                hint = nearest(str(place[-1]), known) or f"; known here: {', '.join(known)}"
                yield Complaint(path, f"unknown key{hint}")
            case "missing":
                yield Complaint(path, "missing")
            case "model_type" | "model_attributes_type":
                yield Complaint(path, _no_table(_models_at(model, place), found["input"]))
            case _:
                message = found["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
                shown = f"{found['input']!r} " if isinstance(found["input"], Scalar) else ""
                yield Complaint(path, shown + message)


def _path(place: Sequence[str | int], prefix: str) -> str:
    path = prefix
    for part in place:
        path += f"[{part + 1}]" if isinstance(part, int) else f".{part}"
    return path.lstrip(".")


def _no_table(models: list[type[BaseModel]], given: Any) -> str:
    if any(issubclass(model, Quantity) for model in models):
        return f'{given!r} says not where it comes from; write {{ value = 1.5, unit = "m", source = "…" }}'
    return f"{given!r} must be a table"


def known_keys(model: Any, place: Sequence[str | int]) -> list[str]:
    """Return the keys known at `place` in a document that should be a `model`, or one of several."""
    return list(dict.fromkeys(name for found in _models_at(model, place) for name in found.model_fields))


def _models_at(model: Any, place: Sequence[str | int]) -> list[type[BaseModel]]:
    here = _models_in(model)
    for part in place:  # of an array or a table of tables, what is not a field chooses one of many that are alike
        fields = [one.model_fields[part] for one in here if isinstance(part, str) and part in one.model_fields]
        here = [found for field in fields for found in _models_in(field.annotation)] if fields else here
    return here


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models inside ``Model``, ``list[Model]``, ``dict[str, Model]`` or ``Model | Other | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _models_in(part)]
