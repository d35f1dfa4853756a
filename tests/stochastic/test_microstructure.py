"""From particles to the radius map: neighbours, windows, files, images, and the whole study."""

import json
import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from alphacut import main
from alphacut.fuzzy import RefusedError
from alphacut.stochastic import (
    MeasuredRadii,
    Particles,
    fit_radius_map,
    microstructure,
    pack,
    read_particles,
)
from benchmarks.stochastic import packing_figures, paper_data
from tests.refused import refuses

ROOT = Path(__file__).parents[2]
needs_voro = pytest.mark.skipif(not shutil.which("voro++"), reason="needs Voro++")


@pytest.fixture(scope="module", autouse=True)
def few_resamples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(microstructure, "RESAMPLES", 100)
        yield


GOOD = "x [mm],y [mm],r [mm]\n10,10,4\n30,12,5\n20,30,3\n"


def circles_of(tmp_path, text: str, size=(0.04, 0.04)) -> Particles:
    path = tmp_path / "circles.csv"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    return read_particles(path, size=size)


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        "# a comment\n\nx (cm); y [mm]; d [mm]; note\n1;10;8;a\n3;12;10;b\n2;30;6;c\n",
        "﻿x [m]\ty [m]\tRadius [m]\n0.01\t1e-2\t0.004\n0.03\t0.012\t0.005\n.02\t0.03\t0.003\n",
    ],
)
def test_circles_from_a_file(tmp_path, text):
    discs = circles_of(tmp_path, text)
    assert discs.centres == pytest.approx(np.array([(0.01, 0.01), (0.03, 0.012), (0.02, 0.03)]))
    assert discs.radii == pytest.approx([4e-3, 5e-3, 3e-3], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "key", "allowed"),
    [
        (GOOD + "11,11,4\n", "row 5", "do not overlap; mend the row; columns of radii"),
        (GOOD + "35,35,-1\n", "row 5", "radii from"),
        (GOOD + "35,,1\n", "row 5, column 2", "numbers"),
        (GOOD + "35,٣٥,1\n", "row 5, column 2", "numbers"),
        (GOOD + "35,85,1\n", "row 5", "section of 40 × 40 mm; mend the row, or the size"),
        (GOOD.replace("y [mm]", "y"), "header", "'y [mm]'"),
        (GOOD.replace("r [mm]", "r [kg]"), "header", "'d [mm]'"),
        (GOOD.replace(",", ";").replace("12", "1,2,3"), "row 3, column 2", "numbers"),
        (GOOD + "12,5,15,0,4,0\n", "row 5", "as many fields as the header"),
        ("", "circles.csv", "rows of numbers"),
        ("\udcff", "circles.csv", "text files in UTF-8"),
    ],
)
def test_rows_without_meaning_are_refused(tmp_path, text, key, allowed):
    with pytest.raises(RefusedError) as refused:
        circles_of(tmp_path, text)
    assert refused.value.key.endswith(key)
    assert allowed in str(refused.value)
    assert len(str(refused.value)) < 250


def picture(seed: int, *, noise: float, fraction: float = 0.3):
    """Image of a packing (gaps of 3 pixels, radii from 8) and the circles that it shows whole."""
    rng = np.random.default_rng(seed)
    (packing,) = pack(40, packings=1, fraction=fraction, radii=(9.5, 31.5), seed=seed)
    packing = replace(packing, radii=packing.radii - 1.5)
    side, fine = int(np.ceil(packing.size[0])), 3
    edge = np.minimum(packing.centres, side - packing.centres).min(axis=1) - packing.radii
    at = (np.arange(side * fine) + 0.5) / fine
    mask = np.zeros((side * fine, side * fine))
    shown = np.abs(edge) > 2  # those that the edge just grazes are left out of the picture
    for (x, y), r in zip(packing.centres[shown], packing.radii[shown], strict=True):
        mask += np.hypot(at[None] - x, at[:, None] - y) < r
    grey = mask.reshape(side, fine, side, fine).mean(axis=(1, 3))[::-1]
    grey = 0.2 + 0.6 * grey + 0.6 * noise * rng.standard_normal(grey.shape)
    return grey, packing.centres[edge > 2], packing.radii[edge > 2]


@pytest.mark.parametrize(
    ("seed", "dark"), [pytest.param(0, False, marks=pytest.mark.slow), (1, True)]
)
def test_image_in_circles_out(tmp_path, seed, dark):
    grey, centres, radii = picture(seed, noise=1 / 5, fraction=[0.15, 0.3][seed % 2])
    path, grey = tmp_path / "section.png", np.clip(1 - grey if dark else grey, -0.5, 1.5) + 0.5
    Image.fromarray((127 * grey).astype(np.uint8)).save(path)
    discs = read_particles(path, pixel=1.0)
    assert len(discs) == len(radii)
    apart = np.hypot(*np.moveaxis(discs.centres[:, None] - centres[None], -1, 0))
    match = np.argmin(apart, axis=0)
    assert len(set(match)) == len(radii)
    assert np.median(np.abs(discs.radii[match] - radii)) < 0.5
    assert np.median(apart.min(axis=0)) < 0.5


def under_light() -> np.ndarray:
    """Discs under slow light, 240 × 240 pixels."""
    x, y = np.meshgrid(np.arange(240), np.arange(240))
    return (np.hypot(x % 48 - 24, y % 48 - 24) < 14) + 0.6 * x / 240


def labyrinth() -> np.ndarray:
    """Two phases of one kind, 240 × 240 pixels."""
    field = gaussian_filter(np.random.default_rng(1).normal(size=(240, 240)), 6)
    return np.asarray(field > 0, float)


@pytest.mark.parametrize(
    ("image", "allowed"),
    [
        (np.ones((50, 50)), "two greys"),
        (np.random.default_rng(1).normal(size=(200, 200)), "3 standard deviations"),
        (labyrinth(), "round particles"),
        (under_light(), "values up to 0.2"),
    ],
)
def test_images_that_hide_their_particles_are_refused(tmp_path, image, allowed):
    Image.fromarray(image.astype(np.float32)).save(tmp_path / "image.tif")
    with refuses("image.tif") as refused:
        read_particles(tmp_path / "image.tif", pixel=1.0)
    assert allowed in refused.value.allowed


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"pixel": 1.0}, "image.file"),
        ({"pixel": 0.0}, "image.pixel [m]"),
        ({"size": (1.0, 0.0)}, "size"),
        ({}, "size, pixel"),
        ({"size": (1.0, 1.0), "pixel": 1.0}, "size, pixel"),
    ],
)
def test_what_is_no_image_is_refused(tmp_path, options, key):
    path = tmp_path / "image.png"
    path.write_text("no image")
    with refuses(key):
        read_particles(path, **options)


@pytest.fixture(scope="module")
def result():
    sections = pack(300, packings=8, fraction=0.2, radii=(1e-3, 1e-2), seed=3)
    return fit_radius_map(sections, limits=(0.15, 0.85), seed=3)


@pytest.mark.parametrize("sections", [[], [1.0], Particles([[1, 1]], [0.1], [2, 2])])
def test_a_fit_takes_a_list_of_sections(sections):
    with refuses("sections"):
        fit_radius_map(sections)


@pytest.mark.parametrize("limits", [(0.5,), (0.8, 0.2), (0.1, 1.2), "0.1 to 0.8"])
def test_limits_that_are_no_range_are_refused(limits):
    with refuses("limits"):
        fit_radius_map(pack(20, packings=1, fraction=0.2, radii=(1e-3, 1e-2)), limits=limits)


def test_study_of_packings(result):
    numbers = result.numbers()
    assert json.loads(json.dumps(numbers)) == numbers
    assert numbers["area_fraction"] == pytest.approx(0.2, abs=1e-12)
    assert numbers["area_fraction_of_cells"] == pytest.approx(0.2, abs=1e-12)  # eq. 10
    assert numbers["neighbours"]["mean"] == 6
    for section in result.sections:
        assert section.cells.sum() == pytest.approx(section.particles.measure, rel=1e-10)
    assert numbers["mean_area_fraction_of_map"] == pytest.approx(0.2, abs=0.005)
    assert result.pbox.excess(result.truncated) <= result.band + 1e-6


def test_study_of_measured_circles(tmp_path):
    drawn = {"fraction": 0.2, "radii": (1e-3, 1e-2)}
    (packing,) = pack(600, packings=1, seed=8, **drawn)
    table = 1e3 * np.column_stack([packing.centres, packing.radii])
    rows = "".join(f"{x!r},{y!r},{r!r}\n" for x, y, r in table.tolist())
    truth = fit_radius_map(pack(600, packings=5, **drawn))
    text, size = "x [mm],y [mm],r [mm]\n" + rows, tuple(packing.size)
    measured = fit_radius_map([circles_of(tmp_path, text, size)])
    assert measured.sample.mean == pytest.approx(truth.sample.mean, abs=0.03)
    for discs, side in ((GOOD, 9.0), ("x [m],y [m],r [m]\n0.3,0.5,0.1\n0.7,0.5,0.1\n", 1.0)):
        far = circles_of(tmp_path, discs, (side, side))
        with refuses("size"):
            fit_radius_map([far])


def test_cells_as_tight_as_no_square_are_counted_or_refused():
    dense = fit_radius_map(pack(300, packings=5, fraction=0.55, radii=(1e-3, 2e-3)))
    assert dense.limits[1] == 0.99 < dense.sample.values[-1]
    assert 0 < dense.rule.capped_fraction(dense.sample) < 0.05
    assert dense.fraction_within > 0.99
    with refuses("particles"):
        fit_radius_map(pack(80, packings=5, fraction=0.75, radii=(1e-3, 1e-3)))


def test_equal_cells_leave_nothing_to_fit():
    grid = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) + 0.5
    with refuses("r_n"):
        fit_radius_map([Particles(grid, np.full(36, 0.3), (6, 6))], seed=3)


@pytest.fixture(scope="module")
def few_packings(tmp_path_factory):
    """Path of the shipped case of packings, of five small ones."""
    path = tmp_path_factory.mktemp("few") / "few.toml"
    case = (ROOT / "cases/concrete.toml").read_text(encoding="utf-8")
    few = case.replace("particles = 2000", "particles = 60").replace("= 20  ", "= 5  ")
    path.write_text(few, encoding="utf-8")
    return path


def test_the_command_prints_a_section_that_gives_the_map(few_packings, capfd):
    assert main(["microstructure", str(few_packings), "--json", "-"]) == 0
    numbers = json.loads(capfd.readouterr().out)
    assert f"of the particles: {numbers['area_fraction']:.4f}" in numbers["fragment"]
    radius = tomllib.loads(numbers["fragment"])["radius"]
    assert (radius["a1"], radius["a3"], radius["theta"]) == (0.13, 0.87, [-3, 3])
    for name in ("a2", "a4"):
        assert radius[name] == pytest.approx(numbers[name], rel=1e-7)


def test_the_papers_figures_are_drawn(few_packings, tmp_path, monkeypatch, capsys):
    for name, few in (("N_EQUAL", 100), ("CORNER_DISCS", 30)):
        monkeypatch.setattr(packing_figures, name, few)
    packing_figures.main([str(few_packings), "--out", str(tmp_path)])
    files = list(map(Path, capsys.readouterr().out.splitlines()))
    numbers = ["03-04", "05-08", "06-07", "09", "10", "11", "12"]
    assert [re.search(r"fig([\d-]+)-", file.name)[1] for file in files[::2]] == numbers
    assert all(file.stat().st_size > 2000 for file in files)
    assert not list(tmp_path.glob("*partial*"))


@needs_voro
def test_spheres_take_the_same_way_and_keep_their_fraction():
    law = MeasuredRadii(tuple(np.linspace(1e-3, 2e-3, 20)))
    spheres = pack(150, packings=5, fraction=0.2, radii=law, shape="spheres", seed=2)
    result = fit_radius_map(spheres, seed=2)
    numbers = result.numbers()
    assert numbers["mean_volume_fraction_of_map"] == pytest.approx(0.2, rel=6e-3)
    fraction = pytest.approx(numbers["volume_fraction"], rel=1e-5)
    assert numbers["volume_fraction_of_cells"] == fraction
    for section in result.sections:
        assert section.cells.sum() == pytest.approx(section.particles.measure, rel=1e-5)


@pytest.mark.slow
def test_the_papers_data_as_described(tmp_path, capsys):
    options = ["--discs", "200", "--packings", "5", "--out", str(tmp_path)]
    paper_data.main(options)
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 6
    assert (tmp_path / "paper_data.svg").is_file()
