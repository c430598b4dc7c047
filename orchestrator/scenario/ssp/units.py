"""Values converted by the definitions of units that system structures and FMUs bring with them."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from fmus.module.units import UnitError, convert
from orchestrator.coupling.fmu.vocabulary import EXPONENTS
from orchestrator.scenario.ssp.values import Given
from orchestrator.scenario.ssp.xml import child

Scale = tuple[tuple[int, ...], float, float]
"""Exponents of the base units, factor and offset to them."""


def in_unit(given: Given, wanted: str, description: Any) -> float | int | bool | str:
    """Return a value in the unit of its variable; `UnitError` where the units do not fit or are not defined.

    Parameters
    ----------
    wanted : unit of the variable, empty if it has none
    description : FMPy's description of the FMU, with the definitions of its units
    """
    if isinstance(given.value, bool | str):
        return given.value
    value: float | int = given.value
    if given.unit and wanted and given.unit != wanted:
        value = _converted(float(value), given, wanted, description)
    return value if (given.factor, given.offset) == (1.0, 0.0) else given.factor * value + given.offset


def _converted(value: float, given: Given, wanted: str, description: Any) -> float:
    defined = child((given.units or {}).get(given.unit), "BaseUnit")
    known = next((unit.baseUnit for unit in description.unitDefinitions if unit.name == wanted), None)
    if defined is None or known is None:
        return convert(value, given.unit, wanted)  # by the names alone
    (these, factor, offset), (those, other, base) = _scale(defined), _scale(known)
    if these != those:
        raise UnitError(f"unit {given.unit!r} is no measure of {wanted!r}")
    return (value * factor + offset - base) / other


def _scale(unit: Element | Any) -> Scale:
    """Return what a unit is, of a structure (an element) or of an FMU (FMPy's)."""

    def said(name: str, default: float) -> float:
        text = unit.get(name) if isinstance(unit, Element) else getattr(unit, name)
        return float(text) if text not in (None, "") else default

    return tuple(int(said(e, 0)) for e in EXPONENTS), said("factor", 1.0), said("offset", 0.0)
