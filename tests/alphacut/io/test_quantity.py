"""Quantities as engineers write them become SI."""

import tomllib
from pathlib import Path

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

TABLE = tomllib.loads(Path(__file__).with_name("quantities.toml").read_text(encoding="utf-8"))
KINDS = (Crisp, Interval, Triangular, Trapezoidal)


@pytest.mark.parametrize(("text", "unit", "numbers"), TABLE["right"])
def test_a_quantity_is_read(text, unit, numbers):
    assert parse_fuzzy(text, unit) == KINDS[len(numbers) - 1](*numbers)


@pytest.mark.parametrize(("text", "unit", "words"), [*TABLE["wrong"], ("9" * 2000, "", "too long")])
def test_what_is_no_quantity_is_refused(text, unit, words):
    with pytest.raises(ValueError, match=words):
        parse_fuzzy(text, unit)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("40 Millimetres", r"did you mean mm\?"),
        ("40 kn", r"did you mean kN\?"),
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
