"""Everyday units that are read without Pint mean what Pint says."""

from decimal import Decimal

import pytest

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
