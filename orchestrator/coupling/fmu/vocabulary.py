"""Which names of an FMU mean what they say: a slope is known by its unit or by being declared, not by its name alone."""

from __future__ import annotations

from collections.abc import Mapping

from fmpy.model_description import ModelDescription, Unit

from orchestrator.coupling.exchange import MEAN, RATE, base_of
from orchestrator.coupling.fmu.description import Port

EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Base units of FMI."""
DIGITS = 1e-12  # relative, to which two factors of units are the same


def vocabulary_of(description: ModelDescription, ports: Mapping[str, Port]) -> frozenset[str]:
    """Return the names of all variables, without those that look like a slope or a mean and are none.

    ``X_rate`` is the slope of X if its unit is that of X per second, or if the FMU declares it as the derivative of X.
    ``X_mean`` is the mean of X unless both have units that differ.
    """
    units = {str(unit.name): unit for unit in description.unitDefinitions}
    declared = {v.name: v.derivative.name for v in description.modelVariables if v.derivative is not None}
    return frozenset(name for name, port in ports.items() if _is_meant(port, ports, units, declared))


def _is_meant(port: Port, ports: Mapping[str, Port], units: Mapping[str, Unit], declared: Mapping[str, str]) -> bool:
    base = ports.get(base_of(port.name, RATE) or "")
    if base is not None:
        return declared.get(port.variable) == base.variable or _is_per_second(port.unit, base.unit, units)
    base = ports.get(base_of(port.name, MEAN) or "")
    return base is None or not port.unit or not base.unit or port.unit == base.unit


def _is_per_second(rate: str, unit: str, units: Mapping[str, Unit]) -> bool:
    """Return whether `rate` is `unit` per second: by their base units, or as they are written where those are not given."""
    if not rate:
        return False
    a, b = units.get(rate), units.get(unit)
    if a is None or b is None or a.baseUnit is None or b.baseUnit is None:
        return rate in (f"{unit}/s", f"({unit})/s", f"{unit}.s-1", f"{unit}*s^-1", "1/s" if unit in ("", "1") else "")
    seconds = {e: int(getattr(a.baseUnit, e) or 0) - int(getattr(b.baseUnit, e) or 0) for e in EXPONENTS}
    same = abs(float(a.baseUnit.factor) - float(b.baseUnit.factor)) <= DIGITS * abs(float(b.baseUnit.factor))
    return same and seconds == dict.fromkeys(EXPONENTS, 0) | {"s": -1}
