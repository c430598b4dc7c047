"""Units by their text, after the grammar of FMI and Modelica (``kg.m2/s``), with the exact factor between two of them.

Factors are fractions, so that 18 mm is 0.018 m to the last bit. Where they come from: SI Brochure (9th edition, 2019) for
SI units, prefixes and units beside them (min, h, deg, t, bar); the international yard and pound agreement of 1959 for
in, ft, lb; lbf with the standard gravity of 9.80665 m/s2 (3rd CGPM, 1901).
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

PI = Fraction("3.14159265358979323846264338327950288419716939937511")
"""To 50 digits: what is rounded to a float at the end is pi for that purpose."""

_N = {"kg": 1, "m": 1, "s": -2}
_J = {"kg": 1, "m": 2, "s": -2}

SI: dict[str, tuple[Fraction, dict[str, int]]] = {
    "m": (Fraction(1), {"m": 1}),
    "g": (Fraction(1, 1000), {"kg": 1}),
    "s": (Fraction(1), {"s": 1}),
    "A": (Fraction(1), {"A": 1}),
    "K": (Fraction(1), {"K": 1}),
    "rad": (Fraction(1), {"rad": 1}),
    "Hz": (Fraction(1), {"s": -1}),
    "N": (Fraction(1), _N),
    "Pa": (Fraction(1), {"kg": 1, "m": -1, "s": -2}),
    "J": (Fraction(1), _J),
    "W": (Fraction(1), {"kg": 1, "m": 2, "s": -3}),
}
"""Symbols that take a prefix: factor to coherent SI, exponents of the base units."""

PREFIXES = {"": 0, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "d": -1, "h": 2, "k": 3, "M": 6, "G": 9}
"""Power of ten of each prefix; micro as u, as the micro sign and as the Greek letter."""

OTHERS: dict[str, tuple[Fraction, dict[str, int]]] = {
    "1": (Fraction(1), {}),
    "%": (Fraction(1, 100), {}),
    "t": (Fraction(1000), {"kg": 1}),
    "lb": (Fraction("0.45359237"), {"kg": 1}),
    "in": (Fraction("0.0254"), {"m": 1}),
    "ft": (Fraction("0.3048"), {"m": 1}),
    "min": (Fraction(60), {"s": 1}),
    "h": (Fraction(3600), {"s": 1}),
    "deg": (PI / 180, {"rad": 1}),
    "°": (PI / 180, {"rad": 1}),
    "rpm": (PI / 30, {"rad": 1, "s": -1}),
    "bar": (Fraction(100_000), {"kg": 1, "m": -1, "s": -2}),
    "lbf": (Fraction("0.45359237") * Fraction("9.80665"), _N),
}
"""Symbols that take none; they are looked up first."""

COMMON = (
    *("m", "mm", "cm", "km", "in", "ft", "kg", "g", "t", "lb", "s", "ms", "min", "h", "rad", "deg"),
    *("N", "kN", "MN", "lbf", "Pa", "kPa", "MPa", "GPa", "bar", "J", "kJ", "W", "kW", "1", "%", "m/s", "km/h", "m/s2"),
    *("rad/s", "deg/s", "rpm", "N/m", "N/mm", "kN/m", "kg/m", "g/m", "t/km", "lb/ft", "N.m", "N.mm", "kN.m", "N.m2"),
    *("N.mm2", "kN.m2", "kg.m2", "g.mm2", "kg.cm2", "s/m", "N.s/m", "N.s/mm", "1/s", "1/min", "Hz", "1/m", "1/mm"),
)
"""What is named where a unit does not fit."""

LARGEST = Fraction(sys.float_info.max)
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
FACTOR = re.compile(r"(1(?!\d)|[A-Za-z\u00b5\u03bc°%]+)(?:\^?(-?\d+))?")


class UnitError(ValueError):
    """A unit is unknown or does not fit; the message says which are possible."""


@dataclass(frozen=True)
class Unit:
    """A factor times a product of powers of the base units.

    Attributes
    ----------
    factor : exact (pi to 50 digits), to the coherent SI unit
    exponents : base unit → exponent, without zeros
    """

    factor: Fraction = Fraction(1)
    exponents: dict[str, int] = field(default_factory=dict)

    def times(self, other: Unit, power: int = 1) -> Unit:
        """Return this unit times `other` to the `power`."""
        bases = {**self.exponents, **other.exponents}
        sums = {b: self.exponents.get(b, 0) + power * other.exponents.get(b, 0) for b in bases}
        return Unit(self.factor * other.factor**power, {b: n for b, n in sums.items() if n})


@lru_cache(maxsize=1024)
def unit(text: str) -> Unit | None:
    """Return the unit of `text`; None where it is unknown, or not fixed (``N/m^n``).

    Factors are joined by a dot, ``kg.m2``; what follows the only slash is one factor, or several in brackets,
    ``J/(kg.K)``. Also read: ``·`` and ``*`` for the dot, ``m^2`` and ``m²`` for ``m2``.
    """
    plain = re.sub("[·⋅*]", ".", text.strip().translate(SUPERSCRIPTS))
    above, slash, below = plain.partition("/")
    bracketed = re.fullmatch(r"\((.*)\)", below)
    factors = below.split(".") if not bracketed else bracketed[1].split(".")
    if slash and not bracketed and len(factors) > 1:
        return None
    powers = [(part, 1) for part in above.split(".")] + [(part, -1) for part in factors if slash]
    product = Unit()
    for part, sign in powers:
        match = FACTOR.fullmatch(part)
        symbol = _symbol(match[1]) if match else None
        if match is None or symbol is None:
            return None
        product = product.times(symbol, sign * int(match[2] or 1))
    return product


def _symbol(name: str) -> Unit | None:
    if name in OTHERS:
        return Unit(*OTHERS[name])
    for prefix, power in PREFIXES.items():
        if name.startswith(prefix) and name[len(prefix) :] in SI:
            factor, exponents = SI[name[len(prefix) :]]
            return Unit(factor * Fraction(10) ** power, exponents)
    return None


def convert(value: float, given: str, wanted: str) -> float:
    """Return `value` in the unit `wanted`: the float nearest to the exact product.

    A number is taken by its shortest decimal text, as it stands in a file; equal units leave it as it is. `UnitError`
    says what is possible where `given` is no measure of `wanted`.
    """
    given, wanted = given.strip() or "1", wanted or "1"
    if given == wanted:
        return value
    one, other = unit(given), unit(wanted)
    if one is None or other is None or one.exponents != other.exponents:
        raise UnitError(f"unit {given!r} does not fit; possible here: {', '.join(alternatives(wanted))}")
    ratio = one.factor / other.factor
    if ratio == 1 or not abs(value) <= LARGEST:  # nor is NaN
        return value
    exact = Fraction(repr(value)) * ratio
    return float(exact) if abs(exact) <= LARGEST else math.copysign(math.inf, value)


def alternatives(wanted: str) -> list[str]:
    """Return the unit `wanted` and common ones that convert to it."""
    aim = unit(wanted)
    fitting = [name for name in COMMON if aim is not None and (unit(name) or Unit()).exponents == aim.exponents]
    return list(dict.fromkeys([wanted, *fitting]))
