"""Units of accelerations as files of records write them, against their definitions."""

import pytest

from alphacut.frame import read_record
from tests.refused import refuses


def read_in(unit, folder):
    """Samples 3 and −2 of a file without a unit, in m/s²."""
    path = folder / "record.txt"
    path.write_text("3\n-2\n")
    return read_record(path, step=0.02, unit=unit).samples


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
def test_accelerations_are_read_in_the_units_of_files(tmp_path, unit, factor):
    assert read_in(unit, tmp_path) == pytest.approx([3 * factor, -2 * factor], rel=1e-15)


@pytest.mark.parametrize("unit", ["m", "cm/s", "counts", "N", "m/s^3", "furlongs", "s^2", "2"])
def test_other_units_are_none_of_an_acceleration(tmp_path, unit):
    with refuses("unit"):
        read_in(unit, tmp_path)
