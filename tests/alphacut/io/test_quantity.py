"""Quantities as engineers write them become SI."""

import math

import pytest

from alphacut.base.number_text import engineering
from alphacut.fuzzy import Crisp, Interval, Trapezoidal, Triangular
from alphacut.io.quantity import (
    QUANTITIES,
    parse_fuzzy,
    parse_fuzzy_in_any_unit,
    parse_number,
    registry,
)

RIGHT = [
    ("80 GPa", "Pa", Crisp(80e9)),
    ("[75, 85] GPa", "Pa", Interval(75e9, 85e9)),
    ("[75 GPa, 80000 MPa, 85 GPa]", "Pa", Triangular(75e9, 80e9, 85e9)),
    ("[1, 2, 3, 4] mm", "m", Trapezoidal(1e-3, 2e-3, 3e-3, 4e-3)),
    ("20 t ± 5 %", "kg", Interval(19e3, 21e3)),
    ("20 t ± 1 t", "kg", Interval(19e3, 21e3)),
    ("\u22120.5 m/s", "m/s", Crisp(-0.5)),
    ("5 %", "", Crisp(0.05)),
    (0.3, "", Crisp(0.3)),
    ([1, 2], "", Interval(1, 2)),
    ("0.25 g", "m/s^2", Crisp(0.25 * 9.80665)),
    ("3 cm4", "m^4", Crisp(3e-8)),
    ("1.5 Hz", "Hz", Crisp(1.5)),
    ("1.5e-3 kHz", "Hz", Crisp(1.5)),
    ("90 1/min", "Hz", Crisp(1.5)),
    ("1.5 turn/s", "Hz", Crisp(1.5)),
    ("90 rpm", "Hz", Crisp(1.5)),
    ("100 mg", "m/s^2", Crisp(0.1 * 9.80665)),
    ("10 %g", "m/s^2", Crisp(0.1 * 9.80665)),
    ("540 deg/s", "Hz", Crisp(1.5)),
    ("9.42477796076937971538793014983851 rad/s", "Hz", Crisp(1.5)),
    ("[90, 120] rpm", "Hz", Interval(1.5, 2.0)),
    ("180 deg/s", "rad/s", Crisp(math.pi)),
]


@pytest.mark.parametrize(("text", "unit", "value"), RIGHT)
def test_a_quantity_is_read(text, unit, value):
    assert parse_fuzzy(text, unit) == value


WRONG = [
    ("80", "Pa", "the unit is missing"),
    ("80 kg", "Pa", "no unit of"),
    ("80 qq", "Pa", "no unit of"),
    ("GPa", "Pa", "does not begin with a number"),
    ("1_0 GPa", "Pa", "does not begin with a number"),
    ("٣ GPa", "Pa", "does not begin with a number"),
    ("1,5 GPa", "Pa", "does not begin with a number"),
    ("1e400 Pa", "Pa", "magnitudes"),
    ("1e308 mm", "m", "magnitudes"),
    ("1e-300 mm", "m", "magnitudes"),
    ("nan GPa", "Pa", "does not begin with a number"),
    ("inf GPa", "Pa", "does not begin with a number"),
    ("[3, 2, 1] m", "m", "rise"),
    ("[1, 2, 3, 4, 5] m", "m", "one to four"),
    (["10 t"], "kg", "as if of a matrix"),
    ("[] m", "m", "does not begin with a number"),
    (True, "m", "no quantity"),
    ("5 %", "m", "no unit of length"),
    ("3 px", "m", "no unit of length"),
    ("9" * 2000, "", "too long"),
    ("2 s", "Hz", "no unit of frequency"),
    ("2 rad", "Hz", "no unit of frequency"),
    ("2 rad^2/s", "Hz", "no unit of frequency"),
    ("2 bit/s", "Hz", "no unit of frequency"),
    *[
        (text, si, f"did you mean {unit}\\?")
        for text, si, unit in (
            ("80 Gpa", "Pa", "GPa"),
            ("80 gpa", "Pa", "GPa"),
            ("200 MPA", "Pa", "MPa"),
            ("30 KN/m", "N/m", "kN/m"),
            ("30 kn/mm", "N/m", "kN/mm"),
            ("30 kNm", "N*m", "kN m"),
            ("30 kN-m", "N*m", "kN m"),
            ("50 kNs/m", "N*s/m", "kN s/m"),
            ("1.5 hz", "Hz", "Hz"),
            ("1.5 RPM", "Hz", "rpm"),
            ("1.5 rev/min", "Hz", "turn/min"),
            ("30 S", "s", "s"),
            ("30 Kg", "kg", "kg"),
            ("20 T", "kg", "t"),
            ("2 M", "m", "m"),
            ("1 G", "m/s^2", "g"),
            ("80 kg/cm2", "Pa", "kgf/cm2"),
            ("80 [GPa]", "Pa", "GPa"),
            ("45 Deg", "rad", "deg"),
            ("[0.8, 1, 1.2] kn", "N", "kN"),
            ("40 Millimetres", "m", "mm"),
            ("3 KiloNewtons", "N", "kN"),
            ("5 Sec", "s", "s"),
            ("20 Tonnes", "kg", "t"),
            ("24.7 GP", "Pa", "GPa"),
            ("30 MPascal", "Pa", "MPa"),
            ("1 herz", "Hz", "Hz"),
            ("12 Kips", "N", "kip"),
            ("9.81 m s-2", "m/s^2", r"m/s\^2"),
            ("90 mN/m ± 6 %", "N/m", "MN"),
            ("20 Giga Pascal", "Pa", "GPa"),
            ("60 kt", "kg", "t"),
            ("300 mPa", "Pa", "MPa"),
            ("5 Mm", "m", "mm"),
            ("20 Mt", "kg", "t"),
        )
    ],
    ("19, 20, 21 t", "kg", "several values of one quantity stand in brackets"),
    ("20 ton", "kg", "write t"),
    ("20 tons", "kg", "write t"),
    ("5 percent", "", "write %"),
    ("80 tons", "N", "write tf"),
    ("5 per cent", "", "write %"),
    ("20 kN", "kg", "a weight over 9.80665"),
    ("25,000 N/m", "N/m", "thousands without a separator"),
    ("25 000 N/m", "N/m", "thousands without a separator"),
    ("25'000 N/m", "N/m", "thousands without a separator"),
    ("1,5 GPa", "Pa", "a decimal point"),
    ("3x10^6 N", "N", "a power of ten"),
    ("3·10⁶ N", "N", "a power of ten"),
    ("10^6 N", "N", "a power of ten"),
    ("0:30", "s", "a time in one unit"),
    ("1/3 m", "m", "a fraction"),
    ("5 m +- 1 m", "m", "a spread as"),
    ("5-6 m", "m", "a range as"),
    ("5 to 6 m", "m", "a range as"),
    ("5...6 m", "m", "a range as"),
    ("[6, 5] m", "m", "write the smallest first"),
    ("5 m ± 1", "m", 'spread with % or a unit, as "5 m ± 10 %"'),
    ("5 ± 1 m", "m", "unit behind the first number"),
    ("[5 ± 1] m", "m", "spread without brackets"),
    ("[5, 6 m]", "m", "unit behind the bracket"),
    ("[5; 6] m", "m", r"\[5, 6\] m"),
    ("[5 6] m", "m", "units are m, cm"),
    ("80 Giga Pa", "Pa", r"did you mean GPa\?"),
    ("60 N/mm2", "N/m", r"did you mean N/mm\?"),
    ("[5, 6 m", "m", "close the bracket"),
    ("~5 m", "m", "a value, or a range"),
    ("GPa 80", "Pa", "the number first"),
    ("1e999999999 s", "s", "magnitudes"),
    ("1e-999999999 s", "s", "magnitudes"),
    ("1e99999999999999999999 s", "s", "magnitudes"),
    ("1 s ± 1e999999999 %", "s", "magnitudes"),
    ("2 Hz", "rad/s", "no unit of angular velocity"),
    ("2 kHz", "rad/s", "no unit of angular velocity"),
]


@pytest.mark.parametrize(("text", "unit", "words"), WRONG)
def test_what_is_no_quantity_is_refused(text, unit, words):
    with pytest.raises(ValueError, match=words):
        parse_fuzzy(text, unit)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("40 Millimetres", r"did you mean mm\?"),
        ("40 kn", r"did you mean kN\?"),
        ("60 tons", "write t"),
        ("3,5 m", "a decimal point"),
        ("12 parsec fuzz", "none of a quantity such as"),
    ],
)
def test_a_quantity_of_any_dimension_names_the_unit_that_was_meant(text, words):
    with pytest.raises(ValueError, match=words):
        parse_fuzzy_in_any_unit(text)


def test_one_number_is_one():
    assert parse_number("2.5 m", "m") == parse_number("250 cm", "m") == 2.5
    with pytest.raises(ValueError, match="2 values"):
        parse_number("[1, 2] m", "m")


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (-3.59e6, "N", "−3.590 MN"),
        (0.0155, "m", "15.50 mm"),
        (0.0, "m", "0 m"),
        (1e5, "", "100000"),
    ],
)
def test_numbers_for_people(value, unit, words):
    assert engineering(value, unit) == words


@pytest.mark.parametrize("si", QUANTITIES)
def test_common_units_are_what_pint_says(si):
    for unit, power in QUANTITIES[si].powers.items():
        assert registry().Quantity(10**-power if power < 0 else 1, unit) == registry().Quantity(
            1 if power < 0 else 10**power, si
        )


def test_pint_s_yarn_count_and_gallon_are_no_moment_and_no_acceleration():
    with pytest.raises(ValueError, match="no unit of moment"):
        parse_number("12 kNm", "N*m")
    assert parse_number("12 kN m", "N*m") == 12e3
    assert parse_number("98 gal", "m/s^2") == parse_number("0.98 m/s^2", "m/s^2")
    assert parse_number("1 g", "m/s^2") == 9.80665
