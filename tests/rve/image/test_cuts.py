"""Guaranteed cuts: fuzzy threshold, fuzzy phases, phases without order."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.fuzzy import FailedError, RefusedError
from alphacut.rve.image.model import ImageModel, solve_image, usual_division
from alphacut.rve.image.phases import (
    ModuliImages,
    ModuliInterval,
    PhaseModuli,
    moduli_images,
    require_phases,
    threshold_ranges,
)

ALPHA = (0.0, 0.5, 1.0)


def smooth(size, seed):
    """Smooth periodic grey values in [0, 1], shape (size, size)."""
    rng = np.random.default_rng(seed)
    waves = np.fft.fftfreq(size) * size
    damping = np.exp(-((np.hypot(waves[:, None], waves[: size // 2 + 1]) / 5) ** 2))
    values = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(size, size))) * damping, s=(size, size))
    return (values - values.min()) / np.ptp(values)


def phases(alpha, ordered=True):
    """Intervals of K and G of both phases at a level."""
    matrix, particle = ((10.0, 5.0), (40.0, 25.0)) if ordered else ((10.0, 25.0), (40.0, 5.0))
    ends = [1 + s * (1 - alpha) for s in (-0.1, 0.1)]
    pairs = (matrix, particle)
    return [ModuliInterval(*(PhaseModuli((k + g / 3) * e, g * e) for e in ends)) for k, g in pairs]


def images(grey, alpha, ordered=True):
    slack = 0.05 * (1 - alpha)
    ranges = threshold_ranges(grey, [(0.5 - slack, 0.5 + slack)])
    return moduli_images(*ranges, phases(alpha, ordered))


def sample(rng, grey, alpha, ordered):
    """Bounds of one image from inside a cut."""
    slack = 0.05 * (1 - alpha)
    mask = grey >= rng.uniform(0.5 - slack, 0.5 + slack)
    moduli = []
    for phase in phases(alpha, ordered):
        ends = [(p.bulk - p.shear / 3, p.shear) for p in (phase.lower, phase.upper)]
        bulk, shear = rng.uniform(*ends)
        moduli.append((bulk + shear / 3, shear))
    return solve_image(*(np.where(mask, b, a) for a, b in zip(*moduli, strict=True))).bounds


@pytest.mark.parametrize("ordered", [True, False])
def test_samples_never_leave_the_cut(ordered):
    grey, rng, model = smooth(24, 1), np.random.default_rng(2), ImageModel(division=1)
    pairs = [images(grey, alpha, ordered) for alpha in ALPHA]
    cuts = model.cuts(pairs, (pairs[-1], model.solve(pairs[-1])))
    for cut, alpha in zip(cuts, ALPHA, strict=True):
        for _ in range(4):
            inside = sample(rng, grey, alpha, ordered)
            assert cut.bounds.contains((inside.lower + inside.upper) / 2)
            low, high = inside.young(model.average)
            assert cut.modulus[0] <= high
            assert low <= cut.modulus[1]
    moduli = np.array([cut.modulus for cut in cuts])  # rising levels lie inside one another
    assert (np.diff(moduli[:, 0]) >= 0).all()
    assert (np.diff(moduli[:, 1]) <= 0).all()
    if ordered:
        corner = model.solve(ModuliImages(pairs[0].lower, pairs[0].lower))
        assert (
            np.abs(corner.bounds.lower - cuts[0].bounds.lower).max()
            < 1e-3 * corner.bounds.lower[0, 0]
        )


@pytest.mark.parametrize("seed", range(5))
def test_an_interval_of_poisson_ratios_is_enclosed_and_no_wider_than_it_must(seed):
    rng = np.random.default_rng(seed)
    ratios = tuple(np.sort(rng.uniform(-0.5, 0.45, 2)))
    interval = ModuliInterval.of_young((2.0, 3.0), ratios)
    nu = np.linspace(*ratios, 2001)
    ends = [[PhaseModuli.of_young(e, float(n)) for n in nu] for e in (2.0, 3.0)]
    for name in ("bulk", "shear"):
        low, high = (np.array([getattr(m, name) for m in end]) for end in ends)
        assert getattr(interval.lower, name) == pytest.approx(low.min(), rel=1e-6)
        assert getattr(interval.upper, name) == pytest.approx(high.max(), rel=1e-6)
        assert getattr(interval.lower, name) <= low.min()
        assert getattr(interval.upper, name) >= high.max()


def test_cuts_that_leave_out_an_image_inside_them_are_refused():
    grey, model = smooth(24, 1), ImageModel(division=1)
    pairs = [images(grey, alpha) for alpha in ALPHA]
    cuts = model.cuts(pairs, (pairs[-1], model.solve(pairs[-1])))
    model.require_consistent(pairs, cuts)
    for level in (0, 2):
        high = cuts[level].modulus[1]
        moved = cuts[level].modulus._replace(lower=high + 1e-3 * high, upper=1.1 * high)
        wrong = [replace(cut, modulus=moved) if k == level else cut for k, cut in enumerate(cuts)]
        with pytest.raises(FailedError, match="the proof is wrong: E of an image inside a cut"):
            model.require_consistent(pairs, wrong)


@pytest.mark.parametrize(("contrast", "rows", "parts"), [(9, 4, 2), (11, 4, 1), (9, 1 << 19, 1)])
def test_pixels_are_divided_where_that_is_cheap(contrast, rows, parts):
    image = np.ones((rows, 4))
    image[0] = contrast
    assert usual_division(ModuliImages.crisp(image, image)) == parts


@pytest.mark.parametrize(
    "thresholds", [((9.0, 9.0),), ((0.0, 2.0),), ((3.0, 3.5), (3.6, 4.0)), ((6.0, 6.0), (3.0, 3.0))]
)
def test_thresholds_that_leave_a_phase_empty_are_refused(thresholds):
    with pytest.raises(RefusedError) as error:
        require_phases(np.arange(8), thresholds)
    assert error.value.key == "threshold"
