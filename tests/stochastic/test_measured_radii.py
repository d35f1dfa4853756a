"""Radii known from a list: sampled by its distribution function, read with their units, refused
with row and reason.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.stages.material.microstructure import given_sizes, source
from alphacut.stochastic.particles.packing import Packing, _law_test
from alphacut.stochastic.particles.radius_laws import MeasuredRadii

CONCRETE = Path(__file__).parents[2] / "cases" / "concrete.toml"
LIST = "\n".join(
    ["d [mm]", *(f"{x:.4f}" for x in 2 + 6 * np.random.default_rng(4).random(300) ** 2)]
)


@pytest.fixture
def case(tmp_path):
    """The concrete's case with its radii in a file."""
    (tmp_path / "diameters.csv").write_text(LIST, encoding="utf-8")
    lines = [
        line
        for line in CONCRETE.read_text(encoding="utf-8").splitlines()
        if not line.startswith(("smallest_radius", "largest_radius"))
    ]
    at = lines.index("[microstructure.packing]") + 1
    path = tmp_path / "own.toml"
    path.write_text(
        "\n".join([*lines[:at], 'file = "diameters.csv"', *lines[at:]]), encoding="utf-8"
    )
    return path


def test_slopes_of_given_sizes_say_that_their_chance_is_not_in_them(case):
    (line,) = given_sizes(load(str(case), ["microstructure.sampling=false"]))
    assert "only 300 sizes were measured is not in them" in line
    assert "microstructure.sampling = true" in line
    (set_before,) = given_sizes(load(str(case), ["microstructure.sampling=true"]))
    assert "is not in them; to see it" in set_before
    assert list(given_sizes(load(str(CONCRETE)))) == []


def test_samples_follow_the_distribution_function_and_that_follows_the_list():
    listed = np.sort(np.random.default_rng(1).lognormal(0, 0.5, 800))
    law = MeasuredRadii(tuple(listed))
    drawn = law.sample(20000, np.random.default_rng(2))
    assert kstest(drawn, law.cdf).pvalue > 1e-3
    assert kstest(drawn, listed).pvalue > 1e-3
    assert (law.smallest, law.largest) == (listed[0], listed[-1])
    assert law.cdf([0, listed[0], listed[400], listed[-1], 99]) == pytest.approx(
        [0, 0, 400 / 799, 1, 1]
    )


def test_repeated_values_are_as_frequent_as_in_the_list():
    law = MeasuredRadii((1.0, 1.0, 1.0, 2.0, 4.0))
    drawn = law.sample(40000, np.random.default_rng(3))
    assert (drawn == 1.0).mean() == pytest.approx(0.5, abs=0.02)
    for radius in (1.0, 1.5, 2.0, 3.0):
        assert (drawn <= radius).mean() == pytest.approx(float(law.cdf(radius)), abs=0.02)
    assert float(law.cdf(1 - 1e-9)) == 0


def test_a_packing_has_the_listed_radii():
    law = MeasuredRadii((1e-3, 1.5e-3, 2e-3, 4e-3))
    packing = Packing(400, 0.4, law).make(np.random.default_rng(5))
    assert packing.radii.min() >= 1e-3
    assert packing.radii.max() <= 4e-3
    one = Packing(50, 0.4, MeasuredRadii((2e-3,))).make(np.random.default_rng(5))
    assert (one.radii == 2e-3).all()


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("d [mm]", 0.5e-3),
        ("r [mm]", 1e-3),
        ("name, D [cm]", 0.5e-2),
        ("Radius [mm]", 1e-3),
        ("Diameter (um)", 0.5e-6),
    ],
)
def test_diameters_and_radii_are_read_with_their_unit(header, factor, tmp_path):
    path = tmp_path / "sizes.csv"
    path.write_text(
        "\n".join(
            [header, *("a, 3" if "name" in header else "3", "b, 5" if "name" in header else "5")]
        ),
        encoding="utf-8",
    )
    assert MeasuredRadii.read(path).values == pytest.approx((3 * factor, 5 * factor))


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("d [mm]\n1\n-2\nx\n", "row 3 holds no positive number; row 4 holds"),
        ("d [kg]\n1\n", "unit 'kg'"),
        ("d [mm]\n3\n4\n1e9\n5\n", r"row 4 has a size 2.22e\+08 times the median, .*; correct the"),
        (
            "r [mm]\n3\n4e-9\n4\n4\n",
            "row 3 has a size 1.14e-09 times .* 10000 times it, up or down",
        ),
        ("d\n1\n", r"column 'd' has no unit; write it in the header: 'd \[mm\]'$"),
        ("Diameter\n1\n", r"write it in the header: 'Diameter \[mm\]'$"),
        ("length [mm]\n1\n", "no column r"),
        ("d [mm]\n", "no row"),
        ("", "is empty"),
        (
            "d [mm]\n1,25\n1,71\n1,93\n",
            "row 2 holds '1,25', 2 fields where the header has 1: a decimal comma",
        ),
        ("d [mm]\n0,8\n", "row 2 holds '0,8'.*decimal comma"),
        ("d [m(]\n1\n", r"unit 'm\(', which is not a length"),
        ("d [1/0]\n1\n", "unit '1/0', which is not a length"),
        ("d [mm]\n" + "1" * 200_000 + "\n", "cannot be read as rows of numbers"),
        ("d [mm],\n1,25\n", "row 2 holds '1,25'.*decimal comma"),
        (
            "name;d [mm]\na;1.5\nb;1,25\n",
            r"row 3 holds '1,25', a decimal comma, and row 2 '1\.5', a point",
        ),
        ("d [mm],r [mm]\n2,1\n", "'d .mm.' and 'r .mm.' both give r"),
        ("r [mm],radius [mm]\n2,2\n", "'r .mm.' and 'radius .mm.' both give r"),
    ],
)
def test_a_list_that_makes_no_sense_is_refused(text, pattern, case, capfd):
    (case.parent / "diameters.csv").write_text(text, encoding="utf-8")
    assert main(["check", str(case)]) == 2
    err = capfd.readouterr().err
    assert len(err.splitlines()) == 1
    assert "microstructure.packing.file" in err
    with pytest.raises(ValueError, match=pattern):
        MeasuredRadii.read(case.parent / "diameters.csv")


@pytest.mark.parametrize("size", [2.1e-4, 1.9e4])
def test_a_list_may_be_wider_than_any_that_was_measured(size, tmp_path):
    path = tmp_path / "sizes.csv"
    path.write_text(f"d [mm]\n2\n{size}\n2\n", encoding="utf-8")
    assert 1e-3 * size / 2 in MeasuredRadii.read(path).values


def test_a_trailing_comma_and_a_stray_quote_are_no_decimal_comma(tmp_path):
    path = tmp_path / "sizes.csv"
    path.write_text('name,d [mm]\na",1,\nb,3,\n', encoding="utf-8")
    assert MeasuredRadii.read(path).values == pytest.approx((0.5e-3, 1.5e-3))


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_where_no_comma_separates(separator, tmp_path):
    path = tmp_path / "sizes.csv"
    rows = [("name", "d [mm]"), ("a", "1,25"), ("b", "3"), ("c", "2,5e-1")]
    path.write_text("\n".join(map(separator.join, rows)), encoding="utf-8")
    assert MeasuredRadii.read(path).values == pytest.approx((0.125e-3, 0.625e-3, 1.5e-3))


@pytest.mark.parametrize("seed", range(8))
def test_rounded_diameters_pass_the_test_of_their_own_law(seed):
    listed = np.round(np.random.default_rng(seed).lognormal(0, 0.4, 300), 1)
    law = MeasuredRadii(tuple(np.maximum(listed, 0.1) * 1e-3))
    assert len(np.unique(law.values)) < 40
    packing = Packing(2000, 0.2, law)
    packing.check(packing.make(np.random.default_rng(seed)))


def test_the_test_of_a_law_with_atoms_still_sees_another_law():
    law, other = MeasuredRadii((1.0, 1.0, 1.0, 2.0, 2.0)), MeasuredRadii((1.0, 1.0, 2.0, 2.0, 2.0))
    drawn = other.sample(2000, np.random.default_rng(1))
    distance, probability = _law_test(drawn, law)
    assert distance == pytest.approx(0.25, abs=0.05)
    assert probability < 1e-4


def test_a_continuous_law_is_tested_as_scipy_does():
    law = MeasuredRadii(tuple(np.linspace(1, 2, 50)))
    drawn = law.sample(500, np.random.default_rng(2))
    assert _law_test(drawn, law) == pytest.approx(tuple(kstest(drawn, law.cdf))[:2], rel=1e-9)


def test_a_case_packs_discs_of_the_listed_sizes(case):
    law = source(load(case)).packing.radii
    assert len(law.values) == 300
    assert law.label == "300 values of diameters.csv"
    assert main(["check", str(case)]) == 0


@pytest.mark.parametrize(
    ("changes", "pattern"),
    [
        (
            ["microstructure.packing.smallest_radius=1 mm"],
            "smallest_radius.*come from a file besides",
        ),
        (["microstructure.packing.file=none.csv"], "there is no such file"),
    ],
)
def test_radii_come_from_one_place(changes, pattern, case):
    with pytest.raises(BadInput, match=pattern):
        load(case, changes)


@pytest.mark.parametrize("end", ["smallest_radius", "largest_radius"])
def test_without_a_file_both_ends_are_needed(end, tmp_path):
    text = [
        line
        for line in CONCRETE.read_text(encoding="utf-8").splitlines()
        if not line.startswith(end)
    ]
    path = tmp_path / "own.toml"
    path.write_text("\n".join(text), encoding="utf-8")
    with pytest.raises(BadInput, match=f"microstructure.packing.{end}: missing"):
        load(path)
