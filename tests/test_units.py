"""Units by their text: each factor against its definition, to the last bit."""

import math
from fractions import Fraction

import pytest

from fmus.module.units import COMMON, PI, UnitError, alternatives, convert, unit

SI = "SI Brochure, 9th edition, 2019"
FACTORS = [  # unit, coherent SI unit, exact factor, source
    ("mm", "m", "0.001", f"{SI}, table 7"),
    ("cm", "m", "0.01", f"{SI}, table 7"),
    ("km", "m", "1000", f"{SI}, table 7"),
    ("um", "m", "1e-6", f"{SI}, table 7"),
    ("µm", "m", "1e-6", f"{SI}, table 7"),
    ("in", "m", "0.0254", "yard and pound agreement, 1959"),
    ("ft", "m", "0.3048", "yard and pound agreement, 1959"),
    ("g", "kg", "0.001", f"{SI}, section 3"),
    ("t", "kg", "1000", f"{SI}, table 8"),
    ("lb", "kg", "0.45359237", "yard and pound agreement, 1959"),
    ("ms", "s", "0.001", f"{SI}, table 7"),
    ("min", "s", "60", f"{SI}, table 8"),
    ("h", "s", "3600", f"{SI}, table 8"),
    ("kN", "N", "1000", f"{SI}, table 7"),
    ("MN", "N", "1e6", f"{SI}, table 7"),
    ("lbf", "N", "4.4482216152605", "lb times 9.80665 m/s2, 3rd CGPM, 1901"),
    ("kPa", "Pa", "1000", f"{SI}, table 7"),
    ("MPa", "Pa", "1e6", f"{SI}, table 7"),
    ("GPa", "Pa", "1e9", f"{SI}, table 7"),
    ("N/mm2", "Pa", "1e6", "product of the above"),
    ("bar", "Pa", "1e5", f"{SI}, section 4"),
    ("kJ", "J", "1000", f"{SI}, table 7"),
    ("kW.h", "J", "3.6e6", "product of the above"),
    ("kW", "W", "1000", f"{SI}, table 7"),
    ("%", "1", "0.01", "a hundredth"),
    ("km/h", "m/s", "5/18", "product of the above"),
    ("N/mm", "N/m", "1000", "product of the above"),
    ("kN/m", "N/m", "1000", "product of the above"),
    ("g/m", "kg/m", "0.001", "product of the above"),
    ("t/km", "kg/m", "1", "product of the above"),
    ("N.mm", "N.m", "0.001", "product of the above"),
    ("N.mm2", "N.m2", "1e-6", "product of the above"),
    ("kN·m²", "N.m2", "1000", "product of the above, typeset"),
    ("g.mm2", "kg.m2", "1e-9", "product of the above"),
    ("kg.cm^2", "kg.m2", "0.0001", "product of the above"),
    ("N.s/mm", "N.s/m", "1000", "product of the above"),
    ("1/min", "1/s", "1/60", "product of the above"),
    ("min-1", "1/s", "1/60", "product of the above"),
    ("Hz", "1/s", "1", f"{SI}, table 4"),
    ("1/mm", "1/m", "1000", "product of the above"),
    ("J/(kg.m)", "m/s2", "1", "product of the above"),
]
ANGLES = [("deg", "rad", Fraction(1, 180)), ("°", "rad", Fraction(1, 180)), ("rpm", "rad/s", Fraction(1, 30))]
"""In pi; SI Brochure, table 8; rpm is a turn a minute. 1 mrad is no fraction of pi."""


@pytest.mark.parametrize(("given", "wanted", "factor", "source"), FACTORS, ids=[row[0] for row in FACTORS])
def test_factors_are_exact(given: str, wanted: str, factor: str, source: str):
    one, other = unit(given), unit(wanted)
    assert one is not None and other is not None and other.factor == 1
    assert one.factor == Fraction(factor) and one.exponents == other.exponents, source


@pytest.mark.parametrize(("given", "wanted", "turns"), ANGLES)
def test_angles_are_exact_but_for_pi(given: str, wanted: str, turns: Fraction):
    one, other = unit(given), unit(wanted)
    assert one is not None and other is not None and one.exponents == other.exponents
    assert one.factor == PI * turns and float(PI) == math.pi


@pytest.mark.parametrize("value", [0.1, 1.0, 2.0, 14.5, 30.0, 60.0, 90.0, 100.0, 180.0, -7.3])
def test_degrees_as_the_standard_library_has_them(value: float):
    """math.radians rounds twice, once to pi / 180: two units in the last place at most."""
    assert abs(convert(value, "deg", "rad") - math.radians(value)) <= 2.0 * math.ulp(math.radians(value))


@pytest.mark.parametrize(
    ("value", "given", "wanted", "text"),
    [
        (18, "mm", "m", "0.018"),
        (75.3, "mm", "m", "0.0753"),
        (910.0, "g/m", "kg/m", "0.91"),
        (81.2, "MN", "N", "81200000"),
        (1e5, "N/mm", "N/m", "1e8"),
        (0.1, "km", "mm", "100000"),
        (3, "ms", "s", "0.003"),
        (6580e6, "N.mm2", "N.m2", "6580"),
        (120, "rpm", "deg/s", "720"),
    ],
)
def test_the_result_is_the_number_one_would_write(value: float, given: str, wanted: str, text: str):
    assert convert(value, given, wanted) == float(text)


def test_equal_units_leave_the_number_alone():
    assert convert(3, "N/m^n", "N/m^n") == 3 and isinstance(convert(3, "kg", "kg"), int)
    assert convert(3, "", "1") == 3 and convert(3, "1", "") == 3


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, 1e308, -1e308])
def test_what_is_or_gets_infinite_stays_so(value: float):
    assert not math.isfinite(convert(value, "km", "m"))


@pytest.mark.parametrize("text", ["", "m/s/s", "N/m.s", "N/m^n", "10", "kq", "m m", "kmin", "m1.5", "/s", "m."])
def test_what_is_no_unit(text: str):
    assert unit(text) is None


@pytest.mark.parametrize(
    ("given", "wanted", "message"),
    [
        ("lb", "m/s", "unit 'lb' does not fit; possible here: m/s, km/h"),
        ("N.m", "kg.m2", "possible here: kg.m2, g.mm2, kg.cm2"),
        ("1/s", "rad/s", "possible here: rad/s, deg/s, rpm"),
        ("N/m", "N/m^n", "possible here: N/m^n"),
        ("parsec", "m", "possible here: m, mm, cm, km, in, ft"),
    ],
)
def test_what_does_not_fit_says_what_would(given: str, wanted: str, message: str):
    with pytest.raises(UnitError) as caught:
        convert(1.0, given, wanted)
    assert str(caught.value).endswith(message)


@pytest.mark.parametrize("text", COMMON)
def test_what_is_proposed_is_accepted(text: str):
    assert unit(text) is not None and text in alternatives(text)
