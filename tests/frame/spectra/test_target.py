"""Target spectra of codes by their formulas at corner periods, tables, and what is refused."""

import numpy as np
import pytest

from alphacut.frame import (
    TargetSpectrum,
    asce7_multi_period,
    asce7_two_period,
    eurocode8_spectrum,
    read_spectrum,
)
from tests.refused import refuses

# Tables 3.2 and 3.3 of EN 1998-1: type, ground type, S, and T_B, T_C, T_D in s.
EN_1998 = """
1 A 1.0 0.15 0.4 2.0
1 B 1.2 0.15 0.5 2.0
1 C 1.15 0.2 0.6 2.0
1 D 1.35 0.2 0.8 2.0
1 E 1.4 0.15 0.5 2.0
2 A 1.0 0.05 0.25 1.2
2 B 1.35 0.05 0.25 1.2
2 C 1.5 0.10 0.25 1.2
2 D 1.8 0.10 0.30 1.2
2 E 1.6 0.05 0.25 1.2
"""


@pytest.mark.parametrize("row", EN_1998.strip().splitlines())
@pytest.mark.parametrize(("damping", "eta"), [(0.05, 1.0), (0.02, 1.1952286), (0.3, 0.55)])
def test_an_elastic_spectrum_holds_the_formulas_of_3_2_2_2(row, damping, eta):
    kind, ground_type, *numbers = row.split()
    soil, rise, constant, velocity = map(float, numbers)
    spectrum = eurocode8_spectrum(2.0, ground_type, spectrum_type=int(kind), damping=damping)
    flat = 5.0 * soil * eta
    # Formulas (3.2) to (3.5) at the ends of their branches, and within.
    assert spectrum([0, rise / 2]) == pytest.approx([2 * soil, soil + flat / 2], rel=1e-7)
    assert spectrum([rise, constant]) == pytest.approx([flat, flat], rel=1e-7)
    assert spectrum([1.0, velocity]) * [1.0, velocity] == pytest.approx(flat * constant, rel=1e-7)
    assert 16 * spectrum(4.0) == pytest.approx(flat * constant * velocity, rel=1e-7)


def test_a_design_spectrum_holds_the_formulas_of_3_2_2_5():
    spectrum = eurocode8_spectrum(3.0, "D", spectrum_type=2, q=3.0)
    # a_g S = 5.4 m/s², plateau 5.4 · 2.5/3 = 4.5, lower bound 0.2 a_g = 0.6 (without S).
    expected = {0.0: 3.6, 0.05: 4.05, 0.3: 4.5, 1.0: 1.35, 1.5: 4.5 * 0.36 / 2.25, 2.0: 0.6}
    assert spectrum(list(expected)) == pytest.approx(list(expected.values()), rel=1e-12)


def test_spectra_of_asce_7_22_hold_11_4_5():
    values = np.linspace(4.0, 6.1, 22)  # 0.1 m/s² more at each of the periods
    spectrum = asce7_multi_period(values)
    assert spectrum([0.0, 0.0625, 0.875, 10.0]) == pytest.approx([4.0, 4.45, 5.35, 6.1])
    # T_0 = 0.12 s, T_S = 0.6 s: S_DS (0.4 + 0.6 T/T_0), S_DS, S_D1/T, S_D1 T_L/T².
    two_period = asce7_two_period(10.0, 6.0, long_period=8.0)
    assert two_period([0.06, 0.3, 1.0, 8.0, 16.0]) == pytest.approx([7, 10, 6, 0.75, 0.1875])
    assert "equivalent lateral force procedure only" in str(two_period)


def test_a_table_of_ones_own_is_linear_and_in_the_unit_of_its_head(tmp_path):
    file = tmp_path / "site.csv"
    file.write_text("T [s];Sa [g]\n0.1;0.2\n0.3;0.6\n")
    spectrum = read_spectrum(file, damping=0.03)
    assert spectrum(0.2) == pytest.approx(0.4 * 9.80665)
    assert str(spectrum) == "site (of one's own), damping 3.0%, T = 0.1 … 0.3 s"
    for text, key in (
        ("T,Sa\n1,2\n", "site.csv, head"),
        ("T [s],Sa [g]\n1,x\n", "site.csv, row 2, column 2"),
        ("T [s],Sa [g]\n0,1,5\n1,1\n", "site.csv, row 2"),
        ("T [s],Sa [g]\n1,2\n0.5,1\n", "spectrum"),
    ):
        file.write_text(text)
        with refuses(key):
            read_spectrum(file)


@pytest.mark.parametrize(
    ("build", "key"),
    [
        (lambda: eurocode8_spectrum(2.0, "F"), "ground_type"),
        (lambda: eurocode8_spectrum(2.0, "A", spectrum_type=3), "spectrum_type"),
        (lambda: eurocode8_spectrum(0.0, "A"), "ag"),
        (lambda: eurocode8_spectrum(2.0, "A", q=5.0, beta=0.6), "beta"),
        (lambda: eurocode8_spectrum(2.0, "A")([1.0, 4.5]), "period"),
        (lambda: asce7_multi_period(np.ones(21)), "spectrum"),
        (lambda: asce7_two_period(10.0, 6.0, 0.5), "long_period"),
        (lambda: TargetSpectrum([0.0, 1.0], [1.0, 0.0]), "spectrum"),
        (lambda: TargetSpectrum([0, 50], [1, 5], falls_from=(0.2, 0.5, 0.9)), "falls_from"),
        (lambda: TargetSpectrum([0, 50], [1, 5], falls_from=(0.0,)), "falls_from"),
    ],
)
def test_what_makes_no_spectrum_is_one_line(build, key):
    with refuses(key):
        build()
