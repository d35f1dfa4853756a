"""Units of accelerations as files of records write them, against their definitions."""

import pytest

from alphacut.frame.records.units import acceleration_factor, other_quantity


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *[(unit, 9.80665) for unit in ("g", "G", "(g)", "[g]", "g's", "g.")],
        *[(unit, 0.01) for unit in ("gal", "Gals", "cm/s^2", "CM/SEC**2", "cm/s/s", "cm s-2")],
        *[(unit, 1.0) for unit in ("m/s²", "m/sec/sec", "m/s2", "M/S**2")],
        ("mm/s^2", 1e-3), ("in/s^2", 0.0254), ("ft/s2", 0.3048), ("g/10", 0.980665),
        ("g*10", 98.0665), ("10*g", 98.0665), ("10g", 98.0665), ("mGal", 1e-5),
        ("mg", 9.80665e-3), ("%g", 0.0980665), ("% g", 0.0980665), ("‰g", 9.80665e-3),
    ],
)  # fmt: skip
def test_accelerations_are_read_in_the_units_of_files(unit, factor):
    assert acceleration_factor(unit) == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("unit", ["", "m", "cm/s", "counts", "N", "m/s^3", "furlongs", "s^2", "2"])
def test_other_units_are_none_of_an_acceleration(unit):
    assert acceleration_factor(unit) is None


@pytest.mark.parametrize(
    ("unit", "quantity"),
    [
        ("cm", "displacement"), ("cm/s", "velocity"), ("m s-1", "velocity"), ("kN", "force"),
        ("counts", "counts"), ("mV", "voltage"), ("kPa", "pressure"), ("deg", "angle"),
    ],
)  # fmt: skip
def test_units_of_other_quantities_are_named_by_them(unit, quantity):
    assert quantity in other_quantity(unit)
    assert acceleration_factor(unit) is None


def test_units_of_accelerations_and_times_are_of_no_other_quantity():
    for unit in ("g", "mg", "%g", "gal", "m/s^2", "cm s-2", "s", "ms", "min", "kg"):
        assert not other_quantity(unit)
