"""Discs around gaps that smoothing closes keep their places; doubtful clusters are told."""

import numpy as np
import pytest
from scipy import ndimage

from alphacut.stochastic.particles.arcs import DIFFERENT, deepest_in, parted
from alphacut.stochastic.particles.image import SectionImage

SIDE = 200
PAIRS = [(70.0, 140.0), (104.0, 140.0), (150.0, 60.0)]


def drawn(centres, radii, generator, blur):
    """Blurred and noisy discs, at (row, column) in pixels."""
    rows, columns = (np.mgrid[: 4 * SIDE, : 4 * SIDE] + 0.5) / 4
    inside = np.any(
        [np.hypot(rows - x, columns - y) < r for (x, y), r in zip(centres, radii, strict=True)], 0
    )
    share = inside.reshape(SIDE, 4, SIDE, 4).mean((1, 3))
    noise = 0.06 * generator.standard_normal(share.shape)
    return ndimage.gaussian_filter(share, blur) + noise


def ring(count, radius):
    """Centres of discs that touch two others each, around a gap."""
    angle = 2 * np.pi * np.arange(count) / count + 0.3
    return 100 + radius / np.sin(np.pi / count) * np.column_stack([np.sin(angle), np.cos(angle)])


@pytest.mark.parametrize("blur", [1.1, 3.0])
@pytest.mark.parametrize("count", [3, 4, 5])
def test_discs_around_a_gap_keep_their_places_and_none_is_invented(count, blur):
    centres = ring(count, 17.0)
    grey = drawn(centres, [17.5] * count, np.random.default_rng(), blur)
    read = SectionImage("ring.png", 1.0, "bright").circles(grey)
    assert len(read.discs) == count
    found = np.column_stack([SIDE - read.discs.centres[:, 1], read.discs.centres[:, 0]])
    away = np.hypot(*(found[:, None] - centres[None]).transpose(2, 0, 1)).min(1)
    assert away.max() < 0.1 * 17.5
    assert not len(read.unsure)


def test_a_cluster_that_no_circles_make_is_told_with_its_place():
    grey = drawn(PAIRS, [17.5, 17.5, 17.5], np.random.default_rng(), 1.1)
    image = SectionImage("pair.png", 1.0, "bright", drop=True)
    assert not len(image.circles(grey).unsure)
    grey[88:94, 150:172] = grey[70, 140]  # a spur beside the two that touch
    ((x, y),) = image.circles(grey).unsure
    assert np.hypot(SIDE - y - 91, x - 160) < 12


def test_a_disc_that_shows_no_arc_is_a_piece_of_its_own():
    rows, columns = np.mgrid[:SIDE, :SIDE]
    hexagon = [(100.0, 100.0), *ring(6, 15.0)]
    mask = np.min([np.hypot(rows - x, columns - y) - 15.3 for x, y in hexagon], axis=0) < 0
    mask |= np.hypot(rows - 100, columns - 100) < 25  # its gaps are filled
    share = ndimage.gaussian_filter(mask.astype(float), 1.5)
    found = parted(share, mask, np.ones_like(mask), 4.0)
    assert len(found.circles) == 6
    assert found.unsure[0] == pytest.approx((100, 100), abs=2)
    assert found.differs > DIFFERENT
    assert found.rest[100, 100] == 1
    assert np.bincount(deepest_in(found.circles, *np.nonzero(mask))).min() > 500
