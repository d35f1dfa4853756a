"""Everyday units that are read without Pint mean what Pint says."""

import re
from decimal import Decimal

import pytest

from alphacut.io import units
from alphacut.io.units import EVERYDAY, QUANTITIES, factor, registry

PAIRS = [(unit, si) for si, sizes in EVERYDAY.items() for unit in sizes]


@pytest.mark.parametrize(("unit", "si"), PAIRS)
def test_an_everyday_unit_has_the_size_that_pint_gives_it(unit, si):
    assert si in QUANTITIES
    text = unit.replace("m^2", "m**2").replace("m^4", "m**4").replace("s^2", "s**2")
    one = registry().Quantity(Decimal(1), registry().parse_units(text))
    assert one.to(si).magnitude == Decimal(EVERYDAY[si][unit])


def test_an_acceleration_in_g_is_one_of_standard_gravity():
    one = registry().Quantity(Decimal(1), registry().parse_units("g_0"))
    assert factor("g", "m/s^2") == one.to("m/s^2").magnitude
    assert factor("g", "kg") == Decimal("0.001")


@pytest.mark.parametrize(
    ("unit", "si", "told"),
    [
        ("kN", "kg", "it is a force; what weighs 1 kN has a mass of 102 kg"),
        ("t", "N", "it is a mass, which weighs 9807 N"),
        ("GPa", "kg", '"GPa" is wrong$'),
        ("kN", "m", '"kN" is wrong$'),
    ],
)
def test_a_force_for_a_mass_is_told(unit, si, told):
    with pytest.raises(ValueError, match=told):
        factor(unit, si)


def test_a_gal_is_a_hundredth_of_a_metre_per_second_squared():
    assert factor("gal", "m/s^2") == factor("Gal", "m/s^2") == Decimal("0.01")


@pytest.mark.parametrize("unit", [name for names in units.ACCEPTED.values() for name in names])
def test_no_unit_that_is_listed_is_one_of_print(unit):
    assert not re.search(units.PRINTED, unit, re.IGNORECASE)
