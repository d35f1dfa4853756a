"""Figures of a fitted radius map: of packings, and of circles that were seen in an image."""

import numpy as np
import pytest
from PIL import Image

from alphacut.case.microstructure import MicrostructureSection
from alphacut.figures.microstructure import draw
from alphacut.stochastic import fit_radius_map, pack, read_particles


@pytest.fixture
def image(tmp_path):
    """An image of discs of many sizes on a grid, one grey level each for discs and matrix."""
    rows, columns = np.mgrid[:480, :480]
    sizes = np.random.default_rng(1).uniform(6, 26, (8, 8))[rows // 60, columns // 60]
    inside = np.hypot(rows % 60 - 30, columns % 60 - 30) < sizes
    path = tmp_path / "section.png"
    Image.fromarray((60 + 120 * inside).astype(np.uint8)).save(path)
    return path


def section_of(**source):
    return MicrostructureSection.model_validate({"seed": 1, **source})


def test_a_fit_to_packings_is_drawn(tmp_path):
    packing = {"particles": 60, "packings": 5, "fraction": 0.2}
    packing |= {"smallest_radius": "1 mm", "largest_radius": "4 mm"}
    sections = pack(60, packings=5, fraction=0.2, radii=(1e-3, 4e-3))
    draw(fit_radius_map(sections), tmp_path, section_of(packing=packing))
    names = {"pbox.png", "pbox.svg", "radius_map.png", "radius_map.svg"}
    assert {file.name for file in tmp_path.iterdir()} == names
    assert all(file.stat().st_size > 2000 for file in tmp_path.iterdir())


def test_circles_of_an_image_are_drawn_on_it(tmp_path, image):
    fitted = fit_radius_map([read_particles(image, pixel=1e-4)])
    section = section_of(image={"file": str(image), "pixel": "0.1 mm"})
    draw(fitted, tmp_path / "figures", section)
    assert (tmp_path / "figures/image_circles.png").stat().st_size > 2000
