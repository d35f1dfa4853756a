"""Sieve curves as laws of radii, bare sieve sizes refused, order of dense packings measured."""

import re

import numpy as np
import pytest
from scipy.stats import kstest

from alphacut.entry import main
from alphacut.stages.material.microstructure import kinds, left_out
from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.microstructure import Study, study
from alphacut.stochastic.microstructure_summary import summary
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii
from alphacut.stochastic.particles.sieve import SieveRadii, read_radii
from alphacut.stochastic.sections import Simulated
from alphacut.stochastic.tessellation.delaunay import Neighbours, hexagonal_order

CURVE = "size [mm],passing [%]\n16,100\n1,0\n4,60\n2,25\n8,60\n"
CASE = """schema = 1
title = "Sieved"
about = "Sizes from a sieve."
stages = ["microstructure"]
[microstructure]
seed = 3
bootstrap = 100
[microstructure.packing]
discs = 200
packings = 5
area_fraction = 0.3
file = "sieve.csv"
"""


def written(folder, text):
    path = folder / "sieve.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("power", [2, 3])
def test_drawn_particles_hold_the_volume_that_each_sieve_passes(power, tmp_path):
    law = read_radii(written(tmp_path, CURVE), power)
    assert isinstance(law, SieveRadii)
    assert (law.smallest, law.largest) == (0.5e-3, 8e-3)
    drawn = law.sample(400_000, np.random.default_rng(1))
    for size, passing in ((1.5, None), (2, 0.25), (4, 0.6), (8, 0.6), (16, 1.0)):
        volume = (drawn[drawn <= size / 2e3] ** power).sum() / (drawn**power).sum()
        if passing is None:  # evenly over the logarithm between two sieves
            passing = 0.25 * np.log(1.5) / np.log(2)
        assert volume == pytest.approx(passing, abs=0.01 * (power - 1))
    assert not ((drawn > 2e-3) & (drawn < 4e-3)).any()  # nothing between 4 and 8 mm
    assert kstest(drawn[:20_000], law.cdf).pvalue > 1e-3
    assert law.cdf([0, 0.5e-3, 3e-3, 8e-3, 1]) == pytest.approx([0, 0, law.cdf(2e-3), 1, 1])


@pytest.mark.parametrize(
    "text",
    [
        CURVE.replace(",", ";"),
        "# a comment\nd [cm];passing\n0,1;0\n0,2;0,25\n0,4;0,6\n0,8;0,6\n1,6;1\n",
        "r [mm],passing [1]\n0.5,0\n1,0.25\n2,0.6\n4,0.6\n8,1\n",
        "D [mm],Passing\n1,0\n2,25\n4,60\n8,60\n16,100\n",
        "d [mm],retained [%],passing [%]\n1,25,0\n2,35,25\n4,0,60\n8,40,60\n16,0,100\n",
        "d [mm],passing [%],retained [1]\n16,100,0\n8,60,0.4\n4,60,\n2,25,0.35\n1,0,0.25\n",
        "d [mm],passing [%],retained [%]\n1,0,100\n2,25,75\n4,60,40\n8,60,40\n16,100,0\n",
    ],
)
def test_the_same_curve_in_other_words(text, tmp_path):
    law = read_radii(written(tmp_path, text))
    assert law.radii == pytest.approx((0.5e-3, 1e-3, 2e-3, 4e-3, 8e-3))
    assert law.passing == pytest.approx((0, 0.25, 0.6, 0.6, 1))


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("d [mm]\n1\n2\n4\n8\n16\n", "5 sizes, 1 to 16 mm, are openings of sieves, each once"),
        ("size [mm]\n0.063\n0.125\n0.25\n0.5\n", "add a column passing"),
        ("size [mm],passing [%]\n1,0\n2,50\n4,40\n8,100\n", "cannot fall as the size rises"),
        ("size [mm],passing [%]\n1,3\n2,50\n4,100\n", "from 0, at the size below which grains"),
        ("size [mm],passing [%]\n1,0\n2,50\n4,98\n", "goes from 0 to 0.98; it must go"),
        ("size [mm],passing [%]\n1,0\n2,150\n", "row 3 has a share outside 0 to 100 %"),
        ("size [mm],passing [kg]\n1,0\n2,100\n", "unit 'kg'; it takes % or 1"),
        ("size [mm],passing [%]\n1,0\nx,50\n2,100\n", "row 3 holds no positive size and share"),
        ("size [mm],passing [%]\n1,0\n2,\n2,100\n", "row 3 holds no positive size and share"),
        ("size [mm],passing [%]\n2,0\n4,60\n8e9,100\n", "row 4 has a size 2e.09 times the median"),
        ("size [mm],passing [%]\n2,0\n2,100\n", "two or more, positive, all unlike"),
        ("d [µm],count\n4.1,100\n6.6,3000\n5,20\n", "column 'count' is not read, and frequen"),
        ("d [µm],number\n4,20\n6,100\n", "'number' is not read"),
        ("d [µm];share\n4;20 %\n6;80 %\n", "'share' is not read"),
        ("d [µm];\n4;3,5\n6;\n", "row 2 holds"),
        ("d [µm],count per image\n4,20\n6,9\n", "'count per image' is not read"),
        (",d [µm]\n7,4\n7,6\n", "column '' is not read"),
        ("size [µm],retained [%]\n4,20\n6,80\n", "'retained .%.' is not read"),
        (
            "size [mm],passing [%],retained [%]\n1,0,25\n2,25,35\n4,60,12\n8,100,0\n",
            r"column 'retained' has 12.0000% at 4 mm, where passing leaves 40.0000%; correct one",
        ),
        ("size [mm],passing [%],retained [g]\n1,0,2\n2,100,0\n", "'retained' has the unit 'g'"),
        ("size [µm],volume [%]\n4,20\n6,80\n", "write one row for each particle"),
        ("size [mm],passing [%],passing [%]\n1,0,0\n2,100,100\n", "'passing .%.' is not read"),
        ("d [px]\n4\n6\n", "unit 'px', which is not a length"),
        ("size,passing [%]\n1,0\n2,100\n", r"'size' has no unit; write .*: 'size \[mm\]'$"),
        ("passing [%]\n0\n100\n", "no column r"),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(text, pattern, tmp_path, capfd):
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=pattern):
        read_radii(path)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    err = capfd.readouterr().err
    assert len(err.splitlines()) == 1
    assert "microstructure.packing.file" in err


@pytest.mark.parametrize("text", ["", "\n", "# diameters of 2026\n\n"])
def test_an_empty_file_is_told_headers_that_are_read(text, tmp_path):
    with pytest.raises(ValueError, match="is empty; it needs rows of numbers below") as refused:
        read_radii(written(tmp_path, text))
    headers = re.findall("'(.*?)'", str(refused.value))
    assert headers == ["d [mm]", "r [mm]", "size [mm],passing [%]"]
    for header in headers:
        rows = "2,0\n4,100\n" if "," in header else "2\n4\n"
        law = read_radii(written(tmp_path, f"{header}\n{rows}"))
        assert law.largest == pytest.approx(4e-3 if header == "r [mm]" else 2e-3)


def test_the_widest_curve_of_a_soil_from_clay_to_stones_is_read(tmp_path):
    rows = "".join(f"{size},{5 * k}\n" for k, size in enumerate(np.geomspace(2e-4, 200, 21)))
    law = read_radii(written(tmp_path, f"size [mm],passing [%]\n{rows}"))
    assert law.largest / law.smallest == pytest.approx(1e6)


NUMBERED = [
    f"{name},d [mm]\n4,3\n7,1\n9,2\n"
    for name in (
        "id",
        "Particle ID",
        "x [mm]",
        "label",
        "Area [mm^2]",
        "Circ.",
        "MinFeret",
        "Feret X",
    )
] + [f"{name},d [mm]\n4,3\n5,1\n6,2\n" for name in ("No.", "number", "")]


@pytest.mark.parametrize(
    "text",
    ["d [mm]\n1\n2\n4\n4\n", "d [mm]\n1\n2\n4\n", "d [mm]\n3\n1\n2\n4\n", *NUMBERED],
)
def test_measured_diameters_are_not_taken_for_sieves(text, tmp_path):
    assert isinstance(read_radii(written(tmp_path, text)), MeasuredRadii)


@pytest.mark.parametrize(
    ("passing", "retained", "agree"),
    [
        ("0,33,67,100", "33.4,33.3,33.3,0", True),
        ("0,33.3,66.7,100", "33.3,33.4,33.3,0", True),
        ("0,33.3,66.7,100", "33.3,33.4,33.0,0", False),
        ("0,33,67,100", "33,33,32,0", True),
        ("0,33.33,66.67,100", "33,33,33,0", True),
        ("0,33,67,100", "36,33,31,0", False),
    ],
)
def test_what_is_retained_may_differ_by_rounding(passing, retained, agree, tmp_path):
    columns = zip((1, 2, 4, 8), passing.split(","), retained.split(","), strict=True)
    rows = "".join(f"{size},{one},{other}\n" for size, one, other in columns)
    path = written(tmp_path, "size [mm],passing [%],retained [%]\n" + rows)
    if agree:
        assert isinstance(read_radii(path), SieveRadii)
    else:
        with pytest.raises(ValueError, match="column 'retained' has"):
            read_radii(path)


def test_a_packing_of_a_curve_covers_what_it_says(tmp_path):
    law = read_radii(written(tmp_path, "size [mm],passing [%]\n2,0\n4,40\n8,100\n"))
    packing = Packing(1500, 0.3, law)
    discs = packing.make(np.random.default_rng(2))
    packing.check(discs)
    fine = (discs.radii[discs.radii < 2e-3] ** 2).sum() / (discs.radii**2).sum()
    assert fine == pytest.approx(0.4, abs=0.06)


def test_bond_order_is_one_in_a_lattice_and_small_at_random():
    turn = np.pi / 3 * np.arange(6) + 0.3
    lattice = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    assert hexagonal_order(Neighbours(np.array([6]), np.zeros(6, int), lattice)) == pytest.approx(1)
    turn = np.random.default_rng(1).uniform(0, 2 * np.pi, 3000)
    anyhow = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    assert hexagonal_order(Neighbours(np.array([6]), np.zeros(3000, int), anyhow)) < 0.06


@pytest.mark.parametrize(("fraction", "ordered"), [(0.81, True), (0.4, False)])
def test_equal_discs_that_crystallise_are_warned_of(fraction, ordered):
    packing = Packing(200, fraction, LogNormalRadii(1e-3, 1e-3))
    limits = (0.9, 0.985) if ordered else None
    found = study(Study(Simulated(packing, 5), limits, bootstrap=100, seed=4))
    told = [line for line in left_out(found) if "as in a crystal" in line]
    assert found.is_crystalline is ordered
    assert summary(found)["crystalline"] is ordered
    assert len(told) == ordered
    if ordered:
        assert f"{found.hexagonal_order:.3f}" in told[0]


def test_particles_too_tight_for_square_cells_are_refused_with_the_way_out():
    packing = Packing(200, 0.76, LogNormalRadii(1e-3, 1e-3))
    with pytest.raises(RefusedError, match=r"tighter than r_n = 0\.99.*\[cell\] image"):
        study(Study(Simulated(packing, 5), bootstrap=100))


@pytest.mark.parametrize(("fraction", "largest", "said"), [(0.8, 1, 1), (0.79, 1, 0), (0.8, 2, 0)])
def test_check_says_that_equal_discs_will_crystallise(fraction, largest, said, tmp_path, capfd):
    text = CASE.replace('file = "sieve.csv"', 'smallest_radius = "1 mm"\n')
    text = text.replace("0.3", str(fraction)) + f'largest_radius = "{largest} mm"\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    out, err = capfd.readouterr()
    assert (out + err).count("crystallise") == said


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (CURVE, "sieve curve of sieve.csv, diameters from 1.000 mm to 16.00 mm"),
        ("Diameter (µm)\n300\n100\n120\n", "diameters from 100.0 µm to 300.0 µm, median 120.0 µm"),
        ("Sieve [mm],passing [%]\n1,0\n3,100\n", "diameters from 1.000 mm to 3.000 mm"),
    ],
)
def test_check_tells_the_sizes_that_it_read(text, told, tmp_path, capfd):
    written(tmp_path, text)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    assert told in capfd.readouterr().out


def test_check_tells_the_circles_that_it_read(tmp_path, capfd):
    written(tmp_path, "x [mm],y [mm],r [mm]\n10,10,2\n30,10,3\n20,30,4\n")
    head, _, _ = CASE.partition("[microstructure.packing]")
    text = head + '[microstructure.circles]\nfile = "sieve.csv"\nsize = ["40 mm", "40 mm"]\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    assert (
        "3 circles, diameters from 4.000 mm to 8.000 mm, median 6.000 mm" in capfd.readouterr().out
    )


def test_reasons_of_what_was_left_out_are_whole_sentences():
    small, far = "is smaller than 2 pixels in radius", "overlaps the circle of row {} by {} mm"
    assert list(kinds([small, far.format(2, 6.59), small, far.format(3, 1), far.format(4, 1)])) == [
        "3 such as one that overlaps the circle of row 2 by 6.59 mm",
        "2 since each is smaller than 2 pixels in radius",
    ]
