"""From particles to the radius map: neighbours, windows, circles from files and images, and the
whole study.
"""

import json
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from alphacut.stages.material.microstructure import left_out
from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.figures.all import draw
from alphacut.stochastic.fit.pbox import PBox, least_pbox
from alphacut.stochastic.microstructure import TIGHTEST, Microstructure, Study, study
from alphacut.stochastic.microstructure_summary import fragment, summary
from alphacut.stochastic.particles.circles_csv import CircleFile
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.sections import Measured, Simulated
from alphacut.stochastic.tessellation.apollonius import apollonius
from alphacut.stochastic.tessellation.delaunay import cell_correlation, neighbours
from alphacut.stochastic.tessellation.edge_correction import whole_cells

EQUAL, TENFOLD = LogNormalRadii(1e-3, 1e-3), LogNormalRadii(1e-3, 1e-2)
SMALL = Simulated(Packing(300, 0.2, TENFOLD), 12)


@pytest.mark.parametrize("discs", [12, 300, 3000])
def test_neighbours_on_the_torus(discs):
    packing = Packing(discs, 0.3, EQUAL).make(np.random.default_rng(discs))
    found = neighbours(packing)
    assert found.number.sum() == 6 * discs  # Euler: exactly six on average
    assert found.number.min() >= 3
    assert found.distances.min() >= 2e-3
    assert found.number.sum() == len(found.first)


def test_neighbours_across_wide_voids():
    centres = np.mod(0.5 + 0.03 * np.random.default_rng(7).standard_normal((900, 2)), 1)
    discs = Discs(centres, np.full(900, 1e-6), (1, 1))
    assert neighbours(discs).number.sum() == 6 * 900
    assert (
        neighbours(discs).number.tolist()
        == np.bincount(apollonius(discs).cell, minlength=900).tolist()
    )


def test_neighbours_are_those_of_the_cells():
    packing = Packing(200, 0.3, EQUAL).make(np.random.default_rng(1))
    assert (
        neighbours(packing).number.tolist()
        == np.bincount(apollonius(packing).cell, minlength=200).tolist()
    )


def test_neighbours_in_a_window_are_those_of_the_larger_section():
    large = Packing(2000, 0.3, EQUAL).make(np.random.default_rng(2))
    inside = (large.centres < 0.5 * large.size).all(axis=1)
    window = Discs(large.centres[inside], large.radii[inside], 0.5 * large.size, periodic=False)
    seen, truth = neighbours(window), neighbours(large).number[inside]
    counted = np.unique(seen.first)
    assert seen.number.tolist() == truth[counted].tolist()
    assert 0.6 * inside.sum() < len(counted) < inside.sum()


def test_centres_in_one_line_have_no_triangulation():
    with pytest.raises(ValueError, match="not in one line"):
        neighbours(Discs([(0.1, 0.5), (0.5, 0.5), (0.9, 0.5)], [0.1] * 3, (1, 1), periodic=False))


def test_cells_of_neighbours_are_weakly_correlated():
    packing = Packing(4000, 0.2, EQUAL).make(np.random.default_rng(3))
    diagram = apollonius(packing)
    correlation = cell_correlation(diagram, diagram.reduced_radii)
    assert 0.02 < abs(correlation) < 0.4
    shuffled = np.random.default_rng(0).permutation(diagram.reduced_radii)
    assert abs(cell_correlation(diagram, shuffled)) < 0.03


def windows(number: int) -> list[tuple[Discs, np.ndarray, float]]:
    """Windows cut from one packing: the discs seen, the true areas of their cells, and the true
    area-weighted mean of r_n.
    """
    large = Packing(3000, 0.25, TENFOLD).make(np.random.default_rng(4))
    diagram = apollonius(large)
    cut = []
    for origin in np.random.default_rng(5).random((number, 2)) * large.size:
        centres, size = np.mod(large.centres - origin, large.size), 0.3 * large.size
        inside = (centres < size).all(axis=1)
        mean = float(diagram.areas @ diagram.reduced_radii / large.area)
        cut.append(
            (
                Discs(centres[inside], large.radii[inside], size, periodic=False),
                diagram.areas[inside],
                mean,
            )
        )
    return cut


def test_whole_cells_are_those_of_the_larger_section():
    for window, areas, _ in windows(12):
        diagram = apollonius(window)
        whole = whole_cells(diagram)
        assert diagram.areas[whole.disc] == pytest.approx(areas[whole.disc], rel=1e-10)
        assert len(whole.disc) > 0.4 * len(window)


def test_weights_of_whole_cells_remove_the_bias_against_large_ones():
    plain, weighted = [], []
    cut = windows(60)
    for window, _, _ in cut:
        diagram = apollonius(window)
        whole = whole_cells(diagram)
        area = diagram.areas[whole.disc]
        plain.append(area.sum() / len(area))
        weighted.append((area @ whole.weight) / whole.weight.sum())
    truth = np.concatenate([areas for _, areas, _ in cut]).mean()
    assert abs(np.mean(weighted) / truth - 1) < 0.03
    assert np.mean(plain) / truth - 1 < -0.03


def test_window_without_a_whole_cell_is_refused():
    with pytest.raises(RefusedError, match="larger window"):
        whole_cells(apollonius(Discs([(0.3, 0.5), (0.7, 0.5)], [0.1, 0.1], (1, 1), periodic=False)))


GOOD = "x [mm],y [mm],r [mm]\n10,10,4\n30,12,5\n20,30,3\n"


def circle_file(tmp_path, text: str, **options) -> CircleFile:
    path = tmp_path / "circles.csv"
    path.write_text(text, encoding="utf-8")
    return CircleFile(path, **(dict(size=(0.04, 0.04)) | options))


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        "# a comment\n\nx (cm); y [mm]; d [mm]; note\n1;10;8;a\n3;12;10;b\n2;30;6;c\n",
        "X (mm), Y (mm), Radius (mm), label\n10,10,4,a\n30,12,5,b\n20,30,3,c\n",
        "r,y,x\n4,10,10\n5,12,30\n3,30,20\n",
        "﻿x [m]\ty [m]\tr [m]\n0.01\t0.01\t0.004\n0.03\t0.012\t0.005\n0.02\t0.03\t0.003\n",
    ],
)
def test_circles_from_a_file(tmp_path, text):
    discs = circle_file(tmp_path, text, unit="mm").read().discs
    assert discs.centres == pytest.approx(
        np.array([(0.01, 0.01), (0.03, 0.012), (0.02, 0.03)]), rel=1e-12
    )
    assert discs.radii == pytest.approx([4e-3, 5e-3, 3e-3], rel=1e-12)


def test_origin_of_the_section(tmp_path):
    text = "x [mm],y [mm],r [mm]\n-10,-10,4\n10,-8,5\n"
    assert circle_file(tmp_path, text, origin=(-0.02, -0.02)).read().discs.centres == pytest.approx(
        np.array([(0.01, 0.01), (0.03, 0.012)])
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "11,11,4\n", r"row 5 overlaps the circle of row 2 by 6\.59 mm"),
        (GOOD + "35,35,-1\n", "row 5 has the radius -1 mm"),
        (GOOD + "35,,1\n", "row 5 lacks a finite number"),
        (GOOD + "35,35,nan\n", "row 5 lacks"),
        (GOOD + "35,85,1\n", "row 5 has its centre .* outside"),
        (GOOD.replace("[mm]", ""), r"'x' has no unit; write it in the header: 'x \[mm\]'$"),
        (GOOD.replace("y [mm]", "y"), r"'y' has no unit; write it in the header: 'y \[mm\]'$"),
        (GOOD.replace("r [mm]", "d"), r"'d' has no unit; write it in the header: 'd \[mm\]'$"),
        (GOOD.replace("[mm]", "[kg]"), "not a length"),
        (GOOD.replace("r [mm]", "q [mm]"), "has no column r"),
        (GOOD.replace("r [mm]", "Area"), r"no column r; .*add a column 'd \[unit\]' of 2·√"),
        ("x [mm],y [mm],r [mm],count\n10,10,4,3\n", "'count' is not read"),
        ("", r"is empty; it needs .* header 'x \[mm\],y \[mm\],r \[mm\]'.*; d may stand for r$"),
        ("x [mm],y [mm],r [mm]\n", "no row holds a circle"),
    ],
)
def test_nonsense_in_a_file_is_refused_by_row_and_reason(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        circle_file(tmp_path, text).read()


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        CircleFile(tmp_path / "none.csv", (1, 1)).read()


def test_rows_are_dropped_on_demand_and_listed(tmp_path):
    found = circle_file(tmp_path, GOOD + "11,11,4\n35,35,x\n", drop=True).read()
    assert len(found.discs) == 3
    assert sorted(found.rejected) == [5, 6]


def test_periodic_overlaps_are_seen_across_the_edge(tmp_path):
    text = "x [mm],y [mm],r [mm]\n1,20,3\n37,20,3\n"
    assert len(circle_file(tmp_path, text).read().discs) == 2
    with pytest.raises(
        ValueError,
        match=r"overlaps the circle of row 2 by 2 mm across the periodic edge.*periodic.*overlap =",
    ):
        circle_file(tmp_path, text, periodic=True).read()


@pytest.mark.parametrize(("x", "needed"), [(15.99, 0.01), (15.9, 0.04), (15.0, 0.34), (13.5, 0.84)])
def test_the_overlap_that_a_refusal_names_is_taken(tmp_path, x, needed):
    text = f"x [mm],y [mm],r [mm]\n10,20,3\n{x},20,3\n30,20,3\n35.99,20,3\n"
    with pytest.raises(ValueError, match=rf"errors of measurement: overlap = {needed}$"):
        circle_file(tmp_path, text).read()
    assert len(circle_file(tmp_path, text, overlap=needed).read().discs) == 4
    with pytest.raises(ValueError, match=r"drop = true$"):  # the row besides stays wrong
        circle_file(tmp_path, text + "35,35,-1\n").read()


def test_no_overlap_allows_a_disc_that_lies_in_another(tmp_path):
    with pytest.raises(ValueError, match=r"drop = true$"):
        circle_file(tmp_path, "x [mm],y [mm],r [mm]\n10,20,3\n11,20,1\n").read()


def test_a_unit_for_all_columns_is_a_length_even_where_each_has_its_own(tmp_path):
    with pytest.raises(ValueError, match=r"unit for all columns.*'GPa', which is not a length"):
        circle_file(tmp_path, GOOD, unit="GPa").read()


def test_decimal_commas_in_a_file_of_circles_are_refused_even_where_rows_may_be_dropped(tmp_path):
    with pytest.raises(ValueError, match=r"row 5 holds.*decimal comma"):
        circle_file(tmp_path, GOOD + "35,5,35,5,1,25\n", drop=True).read()


def test_a_section_far_larger_than_its_particles_asks_for_its_size(tmp_path):
    rows = "".join(
        f"{10 * i + 5},{10 * j + 5},{3 + (i * j) % 2}\n" for i in range(10) for j in range(10)
    )
    file = circle_file(tmp_path, "x [mm],y [mm],r [mm]\n" + rows, size=(100.0, 100.0))
    with pytest.raises(RefusedError, match=r"1 of the 25 patches.*size of the section"):
        study(Study(Measured(file), (0.1, 0.99)))


def picture(
    seed: int, *, noise: float, fraction: float = 0.3
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image of a packing (gaps of 3 pixels, radii from 8) with the circles that it shows whole, in
    pixels, y upwards.
    """
    rng = np.random.default_rng(seed)
    packing = Packing(90, fraction, LogNormalRadii(8, 30), gap=3).make(rng)
    side, fine = int(np.ceil(packing.size[0])), 3
    edge = np.minimum(packing.centres, side - packing.centres).min(axis=1) - packing.radii
    shown = np.abs(edge) > 2  # those that the edge just grazes are left out of the picture
    at = (np.arange(side * fine) + 0.5) / fine
    mask = np.zeros((side * fine, side * fine))
    for (x, y), r in zip(packing.centres[shown], packing.radii[shown], strict=True):
        rows, columns = (
            slice(max(0, int((c - r) * fine)), int((c + r) * fine) + 2) for c in (y, x)
        )
        mask[rows, columns] += np.hypot(at[None, columns] - x, at[rows, None] - y) < r
    grey = mask.reshape(side, fine, side, fine).mean(axis=(1, 3))[::-1]
    whole = edge > 2
    return (
        0.2 + 0.6 * grey + 0.6 * noise * rng.standard_normal(grey.shape),
        packing.centres[whole],
        packing.radii[whole],
    )


@pytest.mark.parametrize(("seed", "dark"), [(0, False), (1, True), (2, True), (3, False)])
def test_image_in_circles_out(seed, dark):
    grey, centres, radii = picture(seed, noise=1 / 5, fraction=[0.15, 0.3][seed % 2])
    found = SectionImage("none", 1.0).circles(1 - grey if dark else grey).discs
    assert len(found) == len(radii)
    apart = np.hypot(*np.moveaxis(found.centres[:, None] - centres[None], -1, 0))
    match = np.argmin(apart, axis=0)
    assert len(set(match)) == len(radii)
    assert np.median(np.abs(found.radii[match] - radii)) < 0.5
    assert np.median(apart.min(axis=0)) < 0.5


def test_image_file_and_its_pixel(tmp_path):
    from skimage import io

    grey, _, radii = picture(0, noise=0.05)
    io.imsave(
        tmp_path / "section.png", (255 * np.clip(grey, 0, 1)).astype(np.uint8), check_contrast=False
    )
    found = SectionImage(tmp_path / "section.png", 1e-4).read()
    assert np.sort(found.discs.radii) == pytest.approx(1e-4 * np.sort(radii), rel=0.03)
    assert all("cut" in reason for reason in found.rejected.values())
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(ValueError, match="cannot be read as an image"):
        SectionImage(tmp_path / "text.png", 1e-4).read()


def test_images_that_show_nothing_are_refused():
    with pytest.raises(ValueError, match="one grey throughout"):
        SectionImage("blank", 1.0).circles(np.ones((50, 50)))
    with pytest.raises(ValueError, match="a pixel is"):
        SectionImage("blank", 0.0)
    with pytest.raises(ValueError, match="auto, bright, dark"):
        SectionImage("blank", 1.0, "red")


@pytest.fixture(scope="module")
def found():
    return study(Study(SMALL, limits=(0.15, 0.85), seed=3, bootstrap=100))


def test_study_of_packings(found):
    numbers = summary(found)
    assert json.loads(json.dumps(numbers)) == numbers
    assert numbers["area_fraction"] == pytest.approx(0.2, abs=1e-12)
    # eq. 10 is an identity
    assert numbers["area_fraction_of_cells"] == pytest.approx(0.2, abs=1e-12)
    assert numbers["neighbours"]["mean"] == 6
    assert numbers["cell_areas_sum_error"] < 1e-10
    assert numbers["mean_area_fraction_of_map"] == pytest.approx(0.2, abs=0.005)
    assert found.pbox.contains(found.kept, found.allowed)
    assert (numbers["a1"], numbers["a3"]) == (0.15, 0.85)
    assert numbers["a2"][0] <= numbers["a2"][1] <= numbers["a2"][2]


def test_fragment_is_toml_that_gives_the_map(found):
    radius = tomllib.loads(fragment(found))["radius"]
    assert (radius["a1"], radius["a3"]) == (0.15, 0.85)
    assert radius["a2"] == pytest.approx(found.pbox.a2, rel=1e-7)
    assert radius["theta"] == [-3, 3]


def test_slopes_that_differ_by_round_off_alone_are_crisp(found):
    a2, width = found.pbox.a2, found.pbox.fit.a3 - found.pbox.fit.a1
    for near, crisp in ((1e-9, True), (1e-4, False)):
        box = replace(found.pbox, a2=(a2[1] - near * width, a2[1], a2[1] + near * width))
        slopes = tomllib.loads(fragment(replace(found, pbox=box)))["radius"]["a2"]
        assert (len(set(slopes)) == 1) is crisp


def test_narrower_band_gives_a_wider_pbox(found):
    crisp = PBox(found.pbox.fit, (found.pbox.a2[1],) * 3, (found.pbox.a4[1],) * 3)
    least = crisp.excess(found.kept)
    boxes = [
        least_pbox(found.pbox.fit, found.kept, band)
        for band in (1.2 * least, 0.9 * least, 0.8 * least)
    ]
    areas = [box.area for box in boxes]
    assert areas[0] == pytest.approx(0, abs=1e-9)
    assert areas == sorted(areas)
    assert areas[2] > 1e-5
    assert boxes[2].contains(found.kept, 0.8 * least)
    assert not crisp.contains(found.kept, 0.8 * least)


def test_supports_hold_what_chance_may_do_to_the_slopes(found):
    wider = study(Study(SMALL, limits=(0.15, 0.85), seed=3, bootstrap=100, sampling=True))
    assert wider.slopes == found.slopes
    for slope, band in ((wider.pbox.a2, wider.slopes.a2), (wider.pbox.a4, wider.slopes.a4)):
        assert slope[0] <= max(band[0], 0) + 1e-9
        assert slope[2] >= band[2] - 1e-9
    assert wider.pbox.contains(wider.kept, wider.allowed)
    assert wider.pbox.area > found.pbox.area


def test_study_is_the_same_whatever_the_workers(found):
    with ThreadPoolExecutor(3) as pool:
        again = study(Study(SMALL, limits=(0.15, 0.85), seed=3, bootstrap=100), executor=pool)
    assert fragment(again) == fragment(found)
    assert again.band == found.band


def test_study_by_share_of_area():
    shared = study(Study(SMALL, share=0.98, seed=3, bootstrap=100))
    assert shared.share_kept == pytest.approx(0.98, abs=2e-3)


def test_study_of_measured_circles(tmp_path):
    packing = Packing(900, 0.2, TENFOLD).make(np.random.default_rng(8))
    rows = "".join(
        f"{x * 1e3!r},{y * 1e3!r},{r * 1e3!r}\n"
        for (x, y), r in zip(packing.centres.tolist(), packing.radii.tolist(), strict=True)
    )
    truth = study(Study(Simulated(Packing(900, 0.2, TENFOLD), 6), share=0.98, bootstrap=100))
    for periodic in (True, False):
        file = circle_file(
            tmp_path, "x [mm],y [mm],r [mm]\n" + rows, size=tuple(packing.size), periodic=periodic
        )
        measured = study(Study(Measured(file), share=0.98, bootstrap=100))
        assert measured.sample.mean == pytest.approx(truth.sample.mean, abs=0.03)
        assert (
            len(measured.sample.values) == 900
            if periodic
            else 500 < len(measured.sample.values) < 900
        )


def test_measured_circles_have_fuzzy_slopes_unless_told_otherwise(tmp_path, monkeypatch):
    packing = Packing(300, 0.55, LogNormalRadii(1e-3, 2e-3)).make(np.random.default_rng(5))
    rows = "".join(
        f"{x!r},{y!r},{r!r}\n"
        for (x, y), r in zip(packing.centres.tolist(), packing.radii.tolist(), strict=True)
    )
    file = circle_file(tmp_path, "x [m],y [m],r [m]\n" + rows, size=tuple(packing.size))
    own, crisp = (
        study(Study(Measured(file), bootstrap=100, sampling=sampling)) for sampling in (None, False)
    )
    assert own.study.holds_slopes
    assert not Study(SMALL).holds_slopes
    assert own.pbox.area > crisp.pbox.area
    assert own.limits[1] == TIGHTEST < own.sample.values[-1]
    assert 0 < own.share_capped < 0.05
    assert own.share_kept > 0.99
    (said,) = (line for line in left_out(own) if "r_n" in line)
    assert f"{own.share_capped:.2%} of the area lies in cells tighter than r_n = 0.99" in said
    monkeypatch.setattr(Microstructure, "share_capped", 2e-16)
    assert not [line for line in left_out(own) if "r_n" in line]


def test_figures_are_drawn(found, tmp_path):
    files = draw(found, tmp_path)
    assert {
        "03-04_two_point",
        "06-07_neighbour_statistics",
        "10_cells",
        "12_areas",
        "13_pbox",
    } <= set(files)
    assert all(path.stat().st_size > 2000 for paths in files.values() for path in paths)
    assert not list(tmp_path.glob("*partial*"))


def test_too_few_packings_are_refused():
    with pytest.raises(ValueError, match="5 or more"):
        Simulated(SMALL.packing, 3)
