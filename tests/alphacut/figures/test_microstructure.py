"""Figures of a fitted radius map: of packings, and of circles that were seen in an image."""

import numpy as np
import pytest
from PIL import Image

from alphacut.stochastic import microstructure
from tests.alphacut.small import told_by

CASE = """
title = "Particles of a section"
stages = ["microstructure"]
[microstructure]
seed = 1
"""
PACKING = """
[microstructure.packing]
particles = 60
packings = 5
fraction = 0.2
smallest_radius = "1 mm"
largest_radius = "4 mm"
"""
IMAGE = """
[microstructure.image]
file = "section.png"
pixel = "0.1 mm"
"""


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    monkeypatch.setattr(microstructure, "RESAMPLES", 20)


def figures(folder, section):
    """Figures of a run of a case, with their sizes in bytes."""
    (folder / "case.toml").write_text(CASE + section, encoding="utf-8")
    told_by("run", f"{folder}/case.toml", f"--out={folder}/out", "--quiet")
    return {file.name: file.stat().st_size for file in (folder / "out/figures").iterdir()}


def test_a_fit_to_packings_is_drawn(tmp_path):
    sizes = figures(tmp_path, PACKING)
    assert set(sizes) == {"pbox.png", "pbox.svg", "radius_map.png", "radius_map.svg"}
    assert min(sizes.values()) > 2000


def test_circles_of_an_image_are_drawn_on_it(tmp_path):
    """Discs of many sizes on a grid, one grey level each for discs and matrix."""
    rows, columns = np.mgrid[:360, :360]
    sizes = np.random.default_rng(1).uniform(6, 26, (6, 6))[rows // 60, columns // 60]
    inside = np.hypot(rows % 60 - 30, columns % 60 - 30) < sizes
    Image.fromarray((60 + 120 * inside).astype(np.uint8)).save(tmp_path / "section.png")
    assert figures(tmp_path, IMAGE)["image_circles.png"] > 2000
