"""Units in texts: products of atoms however they are joined, and the numbers beside them."""

import math

import pytest

from alphacut.base.units import factor_of, mentions, unit_of

LENGTHS = {"m": 1, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048, "millimetres": 1e-3}
FORCES = {"N": 1, "kN": 1e3, "MN": 1e6, "daN": 10, "lbf": 4.4482216152605, "kilonewtons": 1e3}
TIMES = {"s": 1, "sec": 1, "ms": 1e-3, "min": 60, "seconds": 1}


def test_products_and_quotients_have_the_value_of_their_parts(rng):
    for _ in range(50):
        force, length, time = (str(rng.choice(list(x))) for x in (FORCES, LENGTHS, TIMES))
        per = str(rng.choice(["/", " / ", " per "]))
        times = str(rng.choice(["*", "·", "-", "."]))
        square = str(rng.choice(["^2", "**2", "²", " squared", "^{2}"]))
        newtons, metres, seconds = FORCES[force], LENGTHS[length], TIMES[time]
        expected = {
            f"{force}{per}{length}": (newtons / metres, "kg s-2"),
            f"[{length}{per}{time}{square}]": (metres / seconds**2, "m s-2"),
            f"({length}{per}{time}{per}{time})": (metres / seconds**2, "m s-2"),
            f"{force}{times}{length}": (newtons * metres, "kg m2 s-2"),
            f"{force}{times}{time}/{length}": (newtons * seconds / metres, "kg s-1"),
            f"{length} {time}^-2": (metres / seconds**2, "m s-2"),
            f"{force}/({length}{times}{time})": (newtons / metres / seconds, "kg s-3"),
        }
        for text, (value, dimension) in expected.items():
            unit = unit_of(text)
            assert unit is not None, text
            assert unit.dimension == dimension, text
            assert unit.factor == pytest.approx(value, rel=1e-12), text


@pytest.mark.parametrize("text", ["", "furlong", "acc", "2", "mn", "m/", "sand", "MHZ", "kg m x"])
def test_what_is_no_unit_or_two_is_none(text):
    assert unit_of(text) is None
    assert factor_of(text, "m") == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sampling 0.01 s, unit: gal", [("s", (0.01,), True), ("gal", (), True)]),
        ("Rate [samples/s]: 200", [("samples/s", (200,), True)]),
        ("size_um: 2.0, 2.0, 5.0", [("um", (2, 2, 5), True)]),
        ("0,005 s", [("s", (0.005,), True)]),
        ("12,700 dpi", [("dpi", (math.nan,), True)]),
        ("0.1-25 Hz", [("Hz", (math.nan,), True)]),
        ("step 1/200 sec", [("sec", (0.005,), True)]),
        ("peak acc. (g) 0.3", [("g", (0.3,), True)]),
        ("N-S component m", [("N-S", (), True), ("m", (), False)]),
        ('{"value": 100, "unit": "Hz"}', [("Hz", (100,), True)]),
        ("t (ms), a", [("ms", (), True)]),
        ("sensitivity 1.25 V/(m/s^2)", [("V/(m/s^2)", (1.25,), True)]),
        ("12 samples in a row", []),
        ("㎝/s², １００㎐", [("cm/s2", (), True), ("Hz", (100,), True)]),
        ("単位：ｇａｌ", [("gal", (), True)]),
    ],
)
def test_units_in_texts_are_found_with_their_numbers(text, expected):
    found = [(one.text, one.numbers, one.is_sure) for one in mentions(text)]
    assert [(x, s) for x, _, s in found] == [(x, s) for x, _, s in expected]
    for (_, numbers, _), (_, wanted, _) in zip(found, expected, strict=True):
        assert numbers == pytest.approx(wanted, nan_ok=True)
