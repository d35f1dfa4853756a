"""Touching and overlapping particles of an image: their number, their area, what is left out."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy import ndimage

from alphacut.stochastic.figures.cells import draw_overlay
from alphacut.stochastic.particles.image import CUT_OFF, SectionImage
from alphacut.stochastic.particles.touching import pushed_apart, roundness, split


def discs_at_random(generator, *, size, count, fraction, overlap):
    """Centres and radii in pixels; two discs overlap by at most a share of the smaller radius."""
    radii = np.exp(0.2 * generator.standard_normal(count))
    radii *= size * np.sqrt(fraction / np.pi / (radii**2).sum())
    kept = np.zeros((0, 3))
    for radius in np.sort(radii)[::-1]:
        for _ in range(3000):
            place = generator.uniform(0, size, 2)
            apart = np.hypot(*(kept[:, :2] - place).T) - kept[:, 2] - radius
            if (apart >= -overlap * np.minimum(kept[:, 2], radius)).all():
                kept = np.vstack([kept, [*place, radius]])
                break
    return kept[:, :2], kept[:, 2]


def picture(centres, radii, size, generator, noise=0.08):
    """Grey image of the discs, blurred and noisy, and their true area fraction."""
    y, x = (np.mgrid[: 2 * size, : 2 * size] + 0.5) / 2
    inside = np.zeros(x.shape, bool)
    for (at_x, at_y), radius in zip(centres, radii, strict=True):
        inside |= (x - at_x) ** 2 + (y - at_y) ** 2 < radius**2
    share = inside.reshape(size, 2, size, 2).mean((1, 3))
    grey = ndimage.gaussian_filter(share, 0.7) + noise * generator.standard_normal(share.shape)
    return grey, share.mean()


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize(("fraction", "overlap"), [(0.25, 0.0), (0.45, 0.1), (0.6, 0.2)])
def test_touching_discs_are_told_apart_and_none_is_lost(fraction, overlap, dark):
    generator = np.random.default_rng(round(100 * fraction))
    form = {"size": 384, "count": 160, "fraction": fraction, "overlap": overlap}
    centres, radii = discs_at_random(generator, **form)
    grey, truth = picture(centres, radii, 384, generator)
    found = SectionImage("none", 1.0).circles(-grey if dark else grey)
    assert found.phase_fraction == pytest.approx(truth, rel=0.01)
    assert found.lost < 0.01
    inner = ((centres > radii[:, None]) & (centres < 384 - radii[:, None])).all(1)
    assert len(found.discs) == pytest.approx(inner.sum(), rel=0.06)
    taken = np.pi * (found.discs.radii**2).sum() / 384**2
    rest = sum(reason == "is cut by the image's edge" for reason in found.rejected.values())
    assert taken < truth
    assert taken + rest * np.pi * radii.mean() ** 2 / 384**2 > truth


def test_what_is_not_round_is_refused_until_it_may_be_dropped():
    y, x = np.mgrid[:300, :300]
    grey = np.zeros((300, 300))
    for k in range(5):
        grey[((x - 50 - 50 * k) / 9) ** 2 + ((y - 90) / 36) ** 2 < 1] = 1
        grey[(x - 50 - 50 * k) ** 2 + (y - 200) ** 2 < 15**2] = 1
    with pytest.raises(
        ValueError, match=r"left out \(5 not round\).*\[microstructure.image\] drop = true"
    ):
        SectionImage("ellipses.png", 1.0).circles(grey)
    found = SectionImage("ellipses.png", 1.0, drop=True).circles(grey)
    assert len(found.discs) == 5
    assert found.lost == pytest.approx(9 * 36 / (9 * 36 + 15**2), rel=0.02)
    with pytest.raises(ValueError, match=r"no round particle.*\[cell\] image"):
        SectionImage("ellipses.png", 1.0).circles(grey * (y < 140))


def test_a_disc_stays_whole_and_two_that_overlap_are_split():
    y, x = np.mgrid[:80, :120]
    one = (x - 40) ** 2 + (y - 40) ** 2 < 20**2
    assert roundness(*np.nonzero(one)) == pytest.approx(1, abs=0.06)
    assert not split(*np.nonzero(one), 0.7, 10).any()
    both = one | ((x - 74) ** 2 + (y - 40) ** 2 < 20**2)
    part = split(*np.nonzero(both), 0.7, 10)
    assert np.bincount(part) == pytest.approx([both.sum() / 2] * 2, rel=0.03)


def test_overlapping_circles_are_pushed_apart_and_others_stay():
    centres = np.array([[0.0, 0.0], [1.5, 0.0], [9.0, 9.0]])
    moved = pushed_apart(centres, np.ones(3))
    assert np.hypot(*(moved[1] - moved[0])) == pytest.approx(2)
    assert moved[2] == pytest.approx(centres[2], abs=0)
    assert moved[:2].mean(0) == pytest.approx(centres[:2].mean(0))


def test_the_overlay_draws_every_circle_over_its_particle():
    generator = np.random.default_rng(1)
    centres, radii = discs_at_random(generator, size=200, count=30, fraction=0.25, overlap=0.0)
    grey, _ = picture(centres, radii, 200, generator)
    found = SectionImage("none", 1e-3).circles(grey)
    drawn = draw_overlay(grey, found.discs)
    (circles,) = drawn.axes[0].collections
    at = circles.get_offsets()
    assert len(at) == len(found.discs)
    inside = [ndimage.map_coordinates(grey, [[200 - y], [x]], order=1)[0] for x, y in at]
    assert min(inside) > 0.6
    plt.close(drawn)


def test_a_disc_whose_centre_lies_beyond_the_image_is_cut_by_its_edge():
    grey, _ = picture([(30, 40), (80, 60)], [12, 14], 120, np.random.default_rng(3))
    image = SectionImage("none", 1.0)
    segmented = image._segmented(grey)
    whole, *_ = image._sorted(segmented)
    assert len(whole) == 2
    label = int(segmented.labels[40, 30])
    for beyond in ((-1.1, 30.0), (60.0, 120.2)):
        moved = segmented._replace(centres={label: beyond})
        kept, rejected, *_ = image._sorted(moved)
        assert len(kept) == 1
        assert rejected[label] == CUT_OFF
